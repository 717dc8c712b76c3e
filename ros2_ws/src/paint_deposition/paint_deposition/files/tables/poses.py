"""A table of poses as a trajectory: timed poses, or programmed passes with their speeds."""

from collections.abc import Callable
from dataclasses import replace
from itertools import compress
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from paint_deposition.errors import RecordingError, did_you_mean
from paint_deposition.files.tables.gauge_formats import FOLDERS
from paint_deposition.files.tables.headings import LENGTHS, SPEEDS, Heading, find_table
from paint_deposition.files.tables.pose_columns import (
    POSITION,
    QUATERNION,
    ROLL_PITCH_YAW,
    ROTATION_VECTOR,
    SCALAR_FIRST,
    column_name,
    find,
    find_all,
    joints_of,
    read_columns,
    read_rotations,
    stamps_of,
    units_of,
    values_of,
)
from paint_deposition.files.tables.reading_columns import Layout, columns_of
from paint_deposition.files.tables.sheets import read_sheets
from paint_deposition.files.tables.table import SWITCHED, Table
from paint_deposition.model.eq1_pattern import MOST
from paint_deposition.motion.programmed import PROGRAMMED, Move, timed
from paint_deposition.motion.stream_quality import FARTHEST_PART_M, StreamQuality
from paint_deposition.motion.trajectory import ONLY_BRUSH, Trajectory, relative_flow
from paint_deposition.request import MotionOptions

if TYPE_CHECKING:
    from paint_deposition.files.recordings.joint_states import Robot

SUFFIXES = ('.csv', '.tsv', '.txt', '.xlsx', '.xls')
# Names of columns, as `column_name` leaves them.
TIME = ('time', 'timestamp', 'stamp', 'timefromstart', 'elapsed', 'zeit', 't')
TRIGGER = ('spraying', 'trigger', 'gun', 'gunon', 'on', 'spray', 'sprayon', 'paint', 'painton')
FLOW = ('flow', 'relativeflow')
BRUSH = ('brush', 'brushnumber', 'brushno')
SPEED = ('speed', 'velocity', 'v', 'tcpspeed')


def is_pose_table(path: Path) -> bool:
    """Whether a file is named as a table."""
    return path.suffix.lower() in SUFFIXES


def holds_readings(path: Path, points_given: bool) -> bool:
    """Whether a file has gauge readings, and not poses.

    JSON and a gauge's folder have. In a table a quaternion is of poses. Else it is of readings
    where a file of their points is given or a column is known as the thickness, or where there is
    no column of times, speeds or angles, as few tables of readings have.
    """
    if path.is_dir():
        names_in = {file.name for file in path.iterdir()}
        return any({*files} <= names_in for files in FOLDERS.values())
    if not is_pose_table(path):
        return path.suffix.lower() == '.json'
    sheets = read_sheets(path, RecordingError)
    motion = {*TIME, *SPEED, *QUATERNION, *ROTATION_VECTOR, *ROLL_PITCH_YAW}

    def has(known: Callable[[list[Heading]], int]) -> bool:
        return find_table(path, RecordingError, known, sheets=sheets)[1] is not None

    def names(headings: list[Heading]) -> set[str]:
        return {column_name(heading) for heading in headings}

    if has(lambda row: {*QUATERNION} <= names(row) or {*SCALAR_FIRST} <= names(row)):
        return False
    return (
        points_given
        or has(lambda row: len(at) if 'thickness' in (at := columns_of(row, Layout())) else 0)
        or not has(lambda row: len(names(row) & motion))
    )


def read_pose_table(
    path: Path, options: MotionOptions, robot: 'Robot | None' = None
) -> Trajectory:
    """The motion in a table, with what was understood as a note.

    A table with times holds poses as recorded, or with ``robot`` its joints; one with speeds,
    passes as programmed, such as ``passes.csv``. Of the options the trigger is the heading of the
    column that opens the gun, which else is found, and units are for headings without.

    Raises:
        RecordingError: naming the file, the column and the remedy.
    """
    table = read_columns(path, robot)
    try:
        return _motion(table, robot, options)
    except RecordingError as error:
        reason = str(error).removeprefix(f'{path}: ')
        raise RecordingError(f'{path}: {reason}') from None


def _motion(table: Table, robot: 'Robot | None', options: MotionOptions) -> Trajectory:
    """The poses with their times or speeds, and with what switches the gun."""
    flows, by_trigger, warnings = _flows(table, options.state_topic)
    brushes, by_brush = _brushes(table)
    if flows is None and brushes.any():
        flows, warnings = np.ones(len(brushes)), ()
    # Beside o and a, the letter t is an angle of Kawasaki's.
    times = TIME[:-1] if find(table, 'o') is not None and find(table, 'a') is not None else TIME
    time, speed = find(table, *times), None if robot else find(table, *SPEED)
    if time is None and speed is None:
        or_speed = '' if robot else ', or speed_m_per_s for programmed passes'
        raise RecordingError(
            f'no time among the columns {table.written(())}; give a column time_s{or_speed}'
        )
    stamps, unit = (np.zeros(len(table), np.int64), '') if time is None else stamps_of(table, time)
    if robot is not None:
        joints, recorded = joints_of(table, robot)
        poses = robot.trajectory(stamps, joints, recorded, table.path.name)
        (how,) = poses.notes
    else:
        positions, its_unit = _positions_m(table, options.pose_unit)
        quaternions, its_rotation = read_rotations(table, options.rotation, options.angle_unit)
        poses = Trajectory(stamps, positions, quaternions, _frame(table))
        how = f'{len(table)} poses: x y z in {its_unit}; {its_rotation}'
    note = f'{how}; {by_trigger}{by_brush}'
    if time is None and speed is not None:
        programmed = timed(_moves(table, poses, speed, flows, brushes), flows is not None)
        return replace(
            programmed, frame_id=poses.frame_id, notes=(PROGRAMMED, note), warnings=warnings
        )
    notes = (f'{note}; {table.written([time or 0])} in {unit}',)
    values = np.hstack([poses.positions_m, poses.quaternions_xyzw])
    faults = StreamQuality.of(stamps, values).faults(table.path.name)
    poses = replace(poses, notes=notes, warnings=(*warnings, *faults))
    if flows is None:
        return poses
    return replace(
        poses,
        trigger_stamps_ns=stamps,
        trigger_flow=flows,
        trigger_brush=brushes,
    )


def _frame(table: Table) -> str:
    """The frame that a column names, '' for none."""
    column = find(table, 'frame', 'frameid')
    names = set() if column is None else {*table.texts(column)}
    if len(names) > 1:
        raise RecordingError(f'poses in frames {", ".join(sorted(names))}; give one frame')
    return ''.join(names).lstrip('/')


def _moves(
    table: Table, poses: Trajectory, speed: int, flows: np.ndarray | None, brushes: np.ndarray
) -> list[Move]:
    """Each row as the move to its pose at its speed."""
    (unit,) = units_of(table, [speed])
    if (unit or 'm/s') not in SPEEDS:
        raise RecordingError(f"{table.written([speed])}: '{unit}' is no unit of speed")
    speeds = values_of(table, [speed])[:, 0] * SPEEDS[unit or 'm/s']
    spraying = np.ones(len(speeds)) if flows is None else flows
    columns = (speeds.tolist(), spraying.tolist(), table.lines, brushes.tolist())
    return [
        Move(position, quaternion, one, bool(flow), line=line, flow=flow or 1.0, brush=brush)
        for position, quaternion, one, flow, line, brush in zip(
            poses.positions_m, poses.quaternions_xyzw, *columns, strict=True
        )
    ]


def _positions_m(table: Table, given: str | None) -> tuple[np.ndarray, str]:
    """Positions (N, 3) [m], and their unit as it was understood."""
    columns = find_all(table, POSITION) or []
    units = units_of(table, columns)
    if len(units) > 1 or not units <= {'', 'm', 'mm', 'cm'}:
        found = ', '.join(sorted(unit or 'no unit' for unit in units))
        raise RecordingError(f'{table.written(columns)} in {found}; give all in m or in mm')
    unit = units.pop() or given or ''
    positions = values_of(table, columns) * LENGTHS[unit or 'm']
    largest = float(np.nanmax(np.abs(positions), initial=0.0))
    if not unit and largest > FARTHEST_PART_M:
        raise RecordingError(
            f'{table.written(columns)} reach {largest:.4g} and have no unit; write it in the '
            'heading, as in x [mm], or give --pose-unit mm'
        )
    return positions, unit or 'm (no unit is given)'


def _flows(table: Table, name: str | None) -> tuple[np.ndarray | None, str, tuple[str, ...]]:
    """Flow (N,) from each row on, relative to the calibrated one, how it was read, warnings."""
    texts = [heading.text for heading in table.headings]
    if name is None:
        trigger, flow = find(table, *TRIGGER), find(table, *FLOW)
    elif name.strip() in texts:
        trigger, flow = texts.index(name.strip()), find(table, *FLOW)
        if trigger == flow:  # with a unit it says only whether the gun is on
            trigger, flow = (None, flow) if units_of(table, [flow]) == {''} else (trigger, None)
    else:
        raise RecordingError(f'no column is called {name}; {did_you_mean(name, texts)}')
    if trigger is None and flow is None:
        each = [{its.lower() for its in table.texts(k)} for k in range(len(texts))]
        switched = [len(its) > 1 and its <= {'0', '1', *SWITCHED} for its in each]
        doubts: tuple[str, ...] = ()
        if named := ', '.join(filter(None, compress(texts, switched))):
            doubt = f'the gun counts as always on; if {named} is its trigger'
            doubts = (f'{doubt}, give --trigger NAME',)
        return None, 'no trigger, the gun sprays throughout', doubts
    if flow is not None and units_of(table, [flow]) != {''}:
        raise RecordingError(
            f'{table.written([flow])}: the flow is relative to the calibrated one, 1 for the '
            'same; divide by it and drop the unit'
        )
    used = [column for column in (trigger, flow) if column is not None]
    values = values_of(table, used)
    on = np.nan_to_num(values[:, 0]) != 0.0
    relative = values[:, -1] if flow is not None else np.full(len(on), np.nan)
    flows = [relative_flow(bool(a), float(b)) for a, b in zip(on, relative, strict=True)]
    return np.array(flows), f'gun by {table.written(used)}', ()


def _brushes(table: Table) -> tuple[np.ndarray, str]:
    """Number of the brush (N,) from each row on, and how it was read."""
    column = find(table, *BRUSH)
    if column is None:
        return np.full(len(table), ONLY_BRUSH, np.int64), ''
    values, written = values_of(table, [column])[:, 0], table.written([column])
    strange = np.flatnonzero(~((values >= 0) & (values <= MOST) & (values == np.round(values))))
    if len(strange):
        raise RecordingError(
            f'line {table.lines[strange[0]]}: {written} is {values[strange[0]]:g}; give the '
            'number of a brush, 0 for the only one'
        )
    return values.astype(np.int64), f', brush by {written}'

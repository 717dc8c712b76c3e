"""A campaign as files: what a user would have, and apart from it, in `truth/`, what is hidden."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import trimesh
import yaml
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from .gauge import Readings
from .jobs import Log
from .shop import Campaign

ATOMIZER_STATE = Path(__file__).parents[2] / 'ros2_ws/src/paint_msgs/msg/AtomizerState.msg'
STATE_TYPE = 'paint_msgs/msg/AtomizerState'
SET_POINTS = ('shaping_air_l_per_min', 'bell_speed_rpm', 'voltage_kv', 'flow_cm3_per_min')
NOT_KNOWN = dict.fromkeys((*SET_POINTS, 'programmed_speed_m_per_s'), float('nan'))
POSE_TOPIC, STATE_TOPIC = '/atomizer/pose', '/atomizer/state'


def write(campaign: Campaign, folder: str | Path, *, sigma_column: bool = False) -> Path:
    """Write campaign.yaml (its path is returned) into a new folder, the hidden into `truth/`."""
    folder = Path(folder)
    (folder / 'truth').mkdir(parents=True)
    entries = []
    for experiment in campaign.experiments:
        mesh, body = f'{experiment.part.kind}.stl', (experiment.vertices_m, experiment.faces)
        trimesh.Trimesh(*body, process=False).export(folder / mesh)
        name, plan = experiment.name, experiment.plan
        write_bag(experiment.log, folder / name, plan.flow, plan.brushes)
        _write_readings(experiment.readings, folder / f'{name}.csv', sigma_column)
        entry = {
            'name': name, 'mesh': mesh, 'trajectory': name, 'pose_topic': POSE_TOPIC,
            'state_topic': STATE_TOPIC, 'measurements': f'{name}.csv',
        }  # fmt: skip
        if plan.upside_down:
            entry['down'] = [0.0, 0.0, 1.0]
        if plan.switched_off:
            entry['switched_off'] = list(plan.switched_off)
        entries.append(entry)
    (folder / 'truth' / 'truth.json').write_text(json.dumps(campaign.truth, indent=1) + '\n')
    path = folder / 'campaign.yaml'
    path.write_text(yaml.safe_dump({'experiments': entries}, sort_keys=False))
    return path


def write_bag(log: Log, folder: Path, flow: float = 1.0, brushes: tuple[int, ...] = ()) -> None:
    """A rosbag2 folder (MCAP): triggers as Bool, with brushes or another flow as AtomizerState."""
    types = get_typestore(Stores.ROS2_JAZZY)
    types.register(get_types_from_msg(ATOMIZER_STATE.read_text(), STATE_TYPE))
    time_type = types.types['builtin_interfaces/msg/Time']
    header_type = types.types['std_msgs/msg/Header']
    pose_type = types.types['geometry_msgs/msg/PoseStamped']
    bool_type = types.types['std_msgs/msg/Bool']
    of_pose = ('Pose', 'Point', 'Quaternion')
    inner, point, quaternion = (types.types[f'geometry_msgs/msg/{name}'] for name in of_pose)
    queue = []
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        poses = bag.add_connection(POSE_TOPIC, pose_type.__msgtype__, typestore=types)
        plain = flow == 1.0 and not brushes
        state_type = bool_type.__msgtype__ if plain else STATE_TYPE
        states = bag.add_connection(STATE_TOPIC, state_type, typestore=types)
        columns = (log.stamps_ns, log.positions_m, log.quaternions_xyzw)
        for stamp, p, q in zip(*(column.tolist() for column in columns), strict=True):
            header = header_type(time_type(stamp // 10**9, stamp % 10**9), 'part')
            message = pose_type(header, inner(point(*p), quaternion(*q)))
            queue.append((stamp, poses, types.serialize_cdr(message, pose_type.__msgtype__)))
        number = 0
        for stamp, on in zip(log.trigger_stamps_ns.tolist(), log.trigger_on.tolist(), strict=True):
            if plain:
                message = bool_type(on)
            else:
                header = header_type(time_type(stamp // 10**9, stamp % 10**9), '')
                brush = brushes[number % len(brushes)] if brushes and on else 0
                number += on
                state = types.types[STATE_TYPE]
                message = state(header, on, flow=flow * on, brush=brush, **NOT_KNOWN)
            queue.append((stamp, states, types.serialize_cdr(message, state_type)))
        for stamp, connection, data in sorted(queue, key=lambda entry: entry[0]):
            bag.write(connection, stamp, data)


def _write_readings(table: Readings, path: Path, sigma_column: bool) -> None:
    columns = dict(zip(('x_m', 'y_m', 'z_m'), np.round(table.positions_m, 4).T, strict=True))
    columns |= {'thickness_um': table.thickness_um, 'point': table.point}
    if any(table.group):
        columns['group'] = table.group
    if sigma_column:
        columns['sigma_um'] = np.round(table.sigma_um, 3)
    with path.open('w', newline='') as file:
        out = csv.writer(file)
        out.writerow(columns)
        out.writerows(zip(*(column.tolist() for column in columns.values()), strict=True))

"""The readers of the project, each with small files to begin from."""

import shutil
import tempfile
import zipfile
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache, partial
from io import BytesIO
from pathlib import Path

import trimesh
from mcap.writer import CompressionType, Writer

import paint_deposition as pd
from booth import SAMPLES
from files.recorded import Messages, pose_entries, straight_pass, write_bag
from files.tables.test_gauge_layouts import LAYOUTS
from paint_deposition.batch.sweep_file import read_sweep
from paint_deposition.files.gauge_readings import read_list, read_points
from paint_deposition.files.model_file import read_model_file
from paint_deposition.files.provenance import planned_model
from paint_deposition.files.recordings.bag_files import open_bag
from paint_deposition.files.recordings.joint_states import Robot
from paint_deposition.files.recordings.mcap_recovery import recover
from paint_deposition.files.recordings.pose_topics import sources_of_poses
from paint_deposition.files.tables.reading_columns import Layout
from robot_arm import URDF
from workbook import write_workbook

GAUGE_JSON = (
    b'{"unit": "um", "results": [{"x_m": 0, "y_m": 0, "z_m": 0, "thickness_um": 20, "id": "a"}, '
    b'{"x_m": 0, "y_m": 0, "z_m": 1, "thickness_um": 21.5, "id": null}]}'
)
# What none of the programs under tests/files has.
RAPID = rb"""MODULE Door
  CONST robtarget p1:=[[0,0,0],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  PROC main()
    MoveLDO p1,v50,z1,tBell,doGun,0;
    FOR i FROM 1 TO 3 STEP 2 DO
      MoveC Offs(p1,0,Round(i/2),0),Offs(p1,i,9,0),v100\V:=200,z50,tBell;
    ENDFOR
    IF NOT TestDI(di1) OR FALSE TPWrite "x";
  ENDPROC
ENDMODULE
"""
ZONES = b"""zones:
  - name: edge
    target_um: 20
    tolerance_um: 3
    box: [[-0.3, -1, -1], [0.3, 1, 1]]
"""
SWEEP = b"""mesh: panel.stl
trajectory: panel_577
grid: {K2: [0.1, 0.2], speed_factor: {from: 0.5, to: 1.5, steps: 3}}
sample: {count: 3, seed: 1, vary: {K3: [0.1, 0.2]}}
"""


@dataclass(frozen=True)
class Target:
    """A reader under test."""

    suffix: str  # of the file
    read: Callable[[Path], object]  # what it may raise is PaintError
    seeds: list[bytes]  # files as they should be
    words: str = ''  # what is worth inserting
    # The file that holds the bytes as its changing part, for compressed formats.
    around: Callable[[bytes], bytes] = field(default=lambda data: data)


def _mesh(path: Path) -> object:
    # Fine enough for a small part, and no work worth speaking of for the largest that is taken.
    return pd.read_mesh(path, max_edge_length_m=5.0)


def _box(kind: str, **options: str) -> bytes:
    made = trimesh.creation.box((0.4, 0.02, 0.3)).export(file_type=kind, **options)
    return made.encode() if isinstance(made, str) else made


def _in_zip(template: bytes, member: str, data: bytes) -> bytes:
    """The file with one of its members replaced by the bytes."""
    made = BytesIO()
    with zipfile.ZipFile(BytesIO(template)) as old, zipfile.ZipFile(made, 'w') as new:
        for name in old.namelist():
            new.writestr(name, data if name == member else old.read(name))
    return made.getvalue()


def _written(write: Callable[[Path], object], name: str) -> bytes:
    """The bytes of a file that `write` makes in a new folder."""
    with tempfile.TemporaryDirectory() as folder:
        write(Path(folder) / name)
        return (Path(folder) / name).read_bytes()


def _entries(ros1: bool = False) -> list[tuple[str, int, object]]:
    """Poses, states, transforms and joints of a moment."""
    motion, messages = straight_pass(5), Messages(ros1)
    stamp = int(motion.stamps_ns[0])
    place = [0.1, 0.2, 0.3, 0.0, 0.0, 0.0, 1.0]
    more = [('/tf_static', stamp, messages.transforms((stamp, 'door', 'part', place)))]
    if not ros1:
        more += [
            ('/atomizer/state', stamp, messages.state(stamp, True, 0.8)),
            ('/joint_states', stamp, messages.joints(stamp, ['elbow'], [0.1])),
        ]
    return [*pose_entries(motion, ros1=ros1), *more]


def _mcap() -> bytes:
    """A plain one, whose every byte counts: neither compressed nor with checksums."""
    messages, made = Messages(), BytesIO()
    writer = Writer(made, compression=CompressionType.NONE, enable_crcs=False)
    writer.start(profile='ros2', library='')
    channels: dict[str, int] = {}
    for topic, time_ns, message in _entries():
        kind = message.__msgtype__
        if topic not in channels:
            text = messages.store.generate_msgdef(kind, ros_version=2)[0]
            schema = writer.register_schema(kind, 'ros2msg', text.encode())
            channels[topic] = writer.register_channel(topic, 'cdr', schema)
        cdr = bytes(messages.serialised(message))
        writer.add_message(channels[topic], time_ns, cdr, time_ns)
    writer.finish()
    return made.getvalue()


def _bag(path: Path) -> object:
    with open_bag(path) as bag:
        list(sources_of_poses(bag, 0.25))
    state = None if path.suffix == '.bag' else '/atomizer/state'
    return pd.read_recording(path, pose_topic='/atomizer/pose', state_topic=state)


def _recovered(path: Path) -> object:
    with tempfile.TemporaryDirectory(dir=path.parent) as folder:
        return recover(path, Path(folder) / 'recovered')


def _metadata(path: Path) -> object:
    with tempfile.TemporaryDirectory(dir=path.parent) as folder:
        run = Path(folder) / 'run'
        shutil.copytree(SAMPLES / 'panel_577', run)
        (run / 'metadata.yaml').unlink()
        (run / 'metadata.yaml').symlink_to(path)
        return planned_model(run), _bag(run)


@cache
def targets() -> dict[str, Target]:
    """All readers by name."""
    points = b'point,x_m,y_m,z_m\nP1,0.1,0,0.2\nP2,0.2,0,0.2\n'
    cells = 'x_mm thickness_um mils [mm] ; \t " 1e308 nan - ,,'
    rows = [['x_m', 'y_m', 'z_m', 'thickness_um'], [0.1, 0.0, 0.2, 24.5], [0.2, 0.0, 0.2, 'n/a']]
    book = _written(lambda path: write_workbook(path, {'Readings': rows}), 'book.xlsx')
    sheet = 'xl/sheet1.xml'
    ros1 = _written(lambda path: write_bag(path, _entries(True), 'ros1'), 'run.bag')
    readings, poses, programs = (
        [path.read_bytes() for path in sorted(LAYOUTS.parents[1].glob(names))]
        for names in ('tables/layouts/*.txt', 'tables/poses/*.csv', 'rapid/programs/*.mod')
    )
    model = (SAMPLES.parents[3] / 'config/model.yaml').read_bytes()
    campaign = (SAMPLES / 'measured_door/campaign.yaml').read_bytes()
    return {
        'rapid': Target(
            '.mod', pd.read_recording, [RAPID, *programs],
            r'PROC ENDPROC MoveL MoveC PaintL TriggL SetDO SetAO Offs( RelTool( wobj0 [[ ]] := '
            '{1} .trans /0 not 9E9 - FOR WHILE TRUE DO ENDFOR IF TEST RETURN Incr UseBrushTab ,',
        ),
        'readings': Target('.csv', pd.read_readings, readings, cells),
        'gauge_json': Target(
            '.json', pd.read_readings, [GAUGE_JSON], '[ ] { } , : " null NaN 1e999 -1 "x": [[ []',
        ),
        'measuring_points': Target(
            '.csv', lambda path: read_list(path, Layout(), None), [points], cells
        ),
        'points': Target('.csv', read_points, [points], cells),
        'poses': Target('.csv', pd.read_recording, poses, cells),
        'workbook': Target('.xlsx', pd.read_readings, [book]),
        'worksheet': Target(
            '.xlsx', pd.read_readings, [zipfile.ZipFile(BytesIO(book)).read(sheet)],
            '<c r="A1"> <v> </v> t="s" t="d" AAAAA99999999', partial(_in_zip, book, sheet),
        ),
        'stl': Target('.stl', _mesh, [_box('stl'), _box('stl_ascii')], 'solid facet vertex'),
        'ply': Target(
            '.ply', _mesh, [_box('ply'), _box('ply', encoding='ascii')],
            'element vertex 1000000000 face property list uchar int format end_header double',
        ),
        'obj': Target('.obj', _mesh, [_box('obj')], 'v f vt o mtllib /'),
        'glb': Target('.glb', _mesh, [_box('glb')], '"count":1000000000 "byteOffset": "nodes":'),
        'ros1': Target('.bag', _bag, [ros1]),
        'mcap': Target('.mcap', _bag, [_mcap()]),
        'mcap_recovery': Target('.mcap', _recovered, [_mcap()]),
        'model': Target('.yaml', read_model_file, [model], r'&a :*a !!bool !!int "" "\ud800"'),
        'metadata': Target(
            '.yaml', _metadata, [(SAMPLES / 'panel_577/metadata.yaml').read_bytes()],
            'custom_data: model_sha256: &a *a null [] {}',
        ),
        'zones': Target('.yaml', lambda path: pd.read_zones(path, SAMPLES / 'panel.stl'), [ZONES]),
        'sweep': Target('.yaml', read_sweep, [SWEEP], 'grid: cases: sample: vary: &a *a null'),
        'campaign': Target('.yaml', pd.read_campaign, [campaign], '&a *a <<: tf: points:'),
        'urdf': Target(
            '.urdf', lambda path: Robot.read(path).arm, [URDF.read_bytes()], '<mimic xyz="1"'
        ),
    }  # fmt: skip

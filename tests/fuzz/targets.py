"""The readers of the project, each with small files to begin from."""

from __future__ import annotations

import shutil
import tempfile
import zipfile
from collections.abc import Callable
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path

import pyarrow as pa
import trimesh
from mcap.writer import CompressionType, Writer

from files.recorded import Messages, pose_entries, straight_pass, write_bag
from fuzz.seeds import CAMPAIGN, MODEL, POSES, RAPID, READINGS
from paint_deposition.files.campaign_file import read_campaign
from paint_deposition.files.gauge_readings import MeasuringPoints, read_points, read_readings
from paint_deposition.files.meshes import read_mesh
from paint_deposition.files.model_file import read_model_file
from paint_deposition.files.motion_files import read_recording
from paint_deposition.files.parquet import write_parquet
from paint_deposition.files.recordings.bag_summary import summarise
from paint_deposition.files.recordings.joint_states import Robot
from paint_deposition.files.recordings.mcap_recovery import recover
from paint_deposition.files.tables.reading_columns import Layout
from paint_deposition.motion.trajectory import Trajectory
from robot_arm import urdf
from workbook import write_workbook

# Fine enough for a small part, and no work worth speaking of for the largest that is taken.
EDGE_M = 5.0


@dataclass(frozen=True)
class Target:
    """A reader under test.

    Attributes:
        suffix: of the file.
        read: the reader; what it may raise is PaintError.
        seeds: files as they should be, bytes.
        words: what is worth inserting, for the fuzzer.
        around: the file that holds the bytes as its changing part, for compressed or checked
            formats; default: the bytes are the file.
    """

    suffix: str
    read: Callable[[Path], object]
    seeds: Callable[[], list[bytes]]
    words: tuple[str, ...] = ()
    around: Callable[[bytes], bytes] = field(default=lambda data: data)


def _mesh(path: Path) -> object:
    return read_mesh(path, max_edge_length_m=EDGE_M)


def _box(kind: str) -> Callable[[], list[bytes]]:
    def seeds() -> list[bytes]:
        made = trimesh.creation.box((0.4, 0.02, 0.3)).export(file_type=kind)
        return [made.encode() if isinstance(made, str) else made]

    return seeds


def _stl_seeds() -> list[bytes]:
    return _box('stl')() + _box('stl_ascii')()


def _ply_seeds() -> list[bytes]:
    text = trimesh.creation.box((0.4, 0.02, 0.3)).export(file_type='ply', encoding='ascii')
    return [*_box('ply')(), text.encode() if isinstance(text, str) else text]


def _3mf() -> bytes:
    """A box in millimetres."""
    return trimesh.creation.box((400.0, 20.0, 300.0)).export(file_type='3mf')


def _3mf_model() -> bytes:
    with zipfile.ZipFile(BytesIO(_3mf())) as package:
        name = next(name for name in package.namelist() if name.endswith('.model'))
        return package.read(name)


def _in_zip(template: bytes, ends_with: str) -> Callable[[bytes], bytes]:
    """The file with one of its members replaced by the bytes."""

    def around(data: bytes) -> bytes:
        made = BytesIO()
        with zipfile.ZipFile(BytesIO(template)) as old, zipfile.ZipFile(made, 'w') as new:
            for name in old.namelist():
                new.writestr(name, data if name.endswith(ends_with) else old.read(name))
        return made.getvalue()

    return around


def _written(write: Callable[[Path], object], name: str) -> bytes:
    """The bytes of a file that `write` makes in a new folder."""
    folder = Path(tempfile.mkdtemp())
    try:
        write(folder / name)
        return (folder / name).read_bytes()
    finally:
        shutil.rmtree(folder)


def _motion() -> Trajectory:
    return straight_pass(5)


def _entries(ros1: bool = False) -> list[tuple[str, int, object]]:
    """Poses, states, transforms and joints of a moment."""
    motion, messages = _motion(), Messages(ros1)
    stamp = int(motion.stamps_ns[0])
    place = [0.1, 0.2, 0.3, 0.0, 0.0, 0.0, 1.0]
    more = [('/tf_static', stamp, messages.transforms((stamp, 'door', 'part', place)))]
    if not ros1:
        more += [
            ('/atomizer/state', stamp, messages.state(stamp, True, 0.8)),
            ('/joint_states', stamp, messages.joints(stamp, ['elbow'], [0.1])),
        ]
    return [*pose_entries(motion, ros1=ros1), *more]


def _mcap_seeds() -> list[bytes]:
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
    return [made.getvalue()]


def _summary(path: Path) -> object:
    summarise(path, 0.25)
    return read_recording(path, pose_topic='/atomizer/pose', state_topic='/atomizer/state')


def _recovered(path: Path) -> object:
    with tempfile.TemporaryDirectory(dir=path.parent) as folder:
        return recover(path, Path(folder) / 'recovered')


def _pose_summary(path: Path) -> object:
    summarise(path, 0.25)
    return read_recording(path, pose_topic='/atomizer/pose')


RAPID_WORDS = (
    'PROC', 'ENDPROC', 'MoveL', 'MoveC', 'PaintL', 'TriggL', 'SetDO', 'SetAO', 'Offs(',
    'RelTool(', 'wobj0', '[[', ']]', ':=', '{1}', '.trans', '.rot', '/0', 'not ', '9E9', '-',
)  # fmt: skip


def _sheet() -> tuple[bytes, bytes]:
    """A workbook and the XML of its sheet."""
    rows = [['x_m', 'y_m', 'z_m', 'thickness_um'], [0.1, 0.0, 0.2, 24.5], [0.2, 0.0, 0.2, 'n/a']]
    book = _written(lambda path: write_workbook(path, {'Readings': rows}), 'book.xlsx')
    with zipfile.ZipFile(BytesIO(book)) as package:
        return book, package.read('xl/sheet1.xml')


def _parquet() -> bytes:
    columns = {
        'x_m': [0.1, 0.2],
        'y_m': [0.0, 0.0],
        'z_m': [0.2, 0.2],
        'thickness_um': [24.5, 9.0],
    }
    table = pa.table(columns | {'point': ['P1', 'P2']})
    return _written(lambda path: write_parquet(path, table), 'readings.parquet')


def _table(read: Callable[[Path], object], *seeds: bytes) -> Target:
    words = ('x_mm', 'thickness_um', 'mils', '[mm]', ';', '\t', '"', '1e308', 'nan', '-', ',,')
    return Target('.csv', read, lambda: [*seeds], words)


def _measuring_points(path: Path) -> object:
    return MeasuringPoints.read(path, Layout(), None)


def targets() -> dict[str, Target]:
    """All readers by name."""
    points = b'point,x_m,y_m,z_m\nP1,0.1,0,0.2\nP2,0.2,0,0.2\n'
    return {
        'rapid': Target(
            '.mod', read_recording, lambda: [RAPID], RAPID_WORDS
        ),
        'readings': _table(read_readings, *READINGS),
        'measuring_points': _table(_measuring_points, points),
        'points': _table(read_points, points),
        'poses': _table(read_recording, *POSES),
        'parquet': Target('.parquet', read_readings, lambda: [_parquet()]),
        'workbook': Target('.xlsx', read_readings, lambda: [_sheet()[0]]),
        'worksheet': Target(
            '.xlsx', read_readings, lambda: [_sheet()[1]],
            ('<c r="A1">', '<v>', '</v>', 't="s"', 't="d"', 'AAAAA99999999'),
            _in_zip(_sheet()[0], 'sheet1.xml'),
        ),
        'stl': Target('.stl', _mesh, _stl_seeds, ('solid', 'facet normal', 'vertex', 'endfacet')),
        'ply': Target(
            '.ply', _mesh, _ply_seeds,
            ('element vertex 1000000000', 'element face', 'property list uchar int', 'property',
             'format ascii 1.0', 'format binary_big_endian 1.0', 'end_header', 'double'),
        ),
        'obj': Target('.obj', _mesh, _box('obj'), ('v ', 'f ', 'vt ', 'o ', 'mtllib ', '/')),
        'glb': Target(
            '.glb', _mesh, _box('glb'),
            ('"count":1000000000', '"byteOffset":', '"children":[0]', '"bufferView":', '"nodes":'),
        ),
        '3mf': Target(
            '.3mf', _mesh, lambda: [_3mf_model()],
            ('<vertex ', '<triangle ', 'v1="', '<component objectid="', 'unit="inch"'),
            _in_zip(_3mf(), '.model'),
        ),
        'ros1': Target(
            '.bag', _pose_summary,
            lambda: [_written(lambda p: write_bag(p, _entries(True), 'ros1'), 'run.bag')],
        ),
        'mcap': Target('.mcap', _summary, _mcap_seeds),
        'mcap_recovery': Target('.mcap', _recovered, _mcap_seeds),
        'model': Target(
            '.yaml', read_model_file, lambda: [MODEL], ('posterior:', 'mean:', 'id: ', '&a', '*a'),
        ),
        'campaign': Target(
            '.yaml', read_campaign, lambda: [CAMPAIGN], ('&a', '*a', '<<:', 'tf:', 'points:'),
        ),
        'urdf': Target('.urdf', Robot.read, lambda: [urdf().encode()], ('<mimic ', 'xyz="1"')),
    }  # fmt: skip

"""A head that claims more than its file holds is refused before memory is taken for it."""

import resource
import struct
import zipfile
from collections.abc import Callable, Iterator
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest

from fuzz.seeds import RAPID
from fuzz.targets import targets
from paint_deposition.errors import PaintError
from paint_deposition.files import surface_cache
from workbook import open_document, open_row

CLAIMED = 1_000_000_000
MEMORY_BYTES = 500_000_000
PLY = """ply
format {form} 1.0
element vertex {vertices}
property float x
property float y
property float z
element face {faces}
property list uchar int vertex_indices
end_header
"""


def _ply(form: str, vertices: int, faces: int) -> bytes:
    return PLY.format(form=form, vertices=vertices, faces=faces).encode() + bytes(200)


def _glb(json: str, length: int | None = None) -> bytes:
    body = json.encode().ljust(-(-len(json) // 4) * 4)
    head = struct.pack('<4sIIII', b'glTF', 2, 20 + len(body), length or len(body), 0x4E4F534A)
    return head + body


def _gltf_accessor(more: str) -> str:
    """A triangle mesh whose positions are an accessor of a thousand million."""
    return (
        '{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],'
        '"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],'
        f'"accessors":[{{"count":{CLAIMED},"componentType":5126,"type":"VEC3"{more}}}]}}'
    )


def _many_transforms() -> bytes:
    """A recording whose static transforms are said to be a thousand million."""
    seed = targets()['mcap'].seeds()[0]
    head = b'\0\1\0\0' + struct.pack('<I', 1)
    at = seed.rindex(head, 0, seed.index(b'part\0'))
    return seed[:at] + head[:4] + struct.pack('<I', CLAIMED) + seed[at + 8 :]


def _mcap_chunk(compression: bytes, uncompressed: int) -> bytes:
    """A chunk that is said to become so large."""
    records = b'\x28\xb5\x2f\xfd' + bytes(20)
    content = struct.pack('<QQQI', 0, 1, uncompressed, 0)
    content += struct.pack('<I', len(compression)) + compression
    content += struct.pack('<Q', len(records)) + records
    chunk = b'\x06' + struct.pack('<Q', len(content)) + content
    magic = b'\x89MCAP0\r\n'
    header = b'\x01' + struct.pack('<Q', 12) + struct.pack('<I4sI', 4, b'ros2', 0)
    footer = b'\x02' + struct.pack('<QQQI', 20, 0, 0, 0)
    return magic + header + chunk + footer + magic


def _mcap_record(length: int) -> bytes:
    magic = b'\x89MCAP0\r\n'
    return magic + b'\x05' + struct.pack('<Q', length) + bytes(50) + magic


def _bag(head: int, data: int) -> bytes:
    """A ROS 1 bag whose first record claims these lengths."""
    field = b'op=\x03'
    record = struct.pack('<I', head) + struct.pack('<I', len(field)) + field
    return b'#ROSBAG V2.0\n' + record + struct.pack('<I', data) + bytes(100)


def _mcap_index(length: int) -> bytes:
    """A recording whose index says that a chunk is so long."""
    seed = targets()['mcap'].seeds()[0]
    at = seed.index(b'\x08' + struct.pack('<Q', 104))
    end = at + 9 + 104
    return seed[: end - 16] + struct.pack('<QQ', length, length) + seed[end:]


def _bag_index() -> bytes:
    """A ROS 1 bag that has its index where some bytes say a length above a thousand million."""
    seed = targets()['ros1'].seeds()[0]
    places = range(20, len(seed) - 4)
    place = next(p for p in places if struct.unpack_from('<I', seed, p)[0] > CLAIMED)
    at = seed.index(b'index_pos=') + len(b'index_pos=')
    return seed[:at] + struct.pack('<Q', place) + seed[at + 8 :]


def _far_cell(cell: bytes = b'<c r="XFD1048576">') -> bytes:
    sheet = targets()['worksheet']
    far = b'<row r="1048576">' + cell + b'<v>1</v></c></row></sheetData>'
    return sheet.around(sheet.seeds()[0].replace(b'</sheetData>', far))


HEADINGS = open_row('x_m', 'y_m', 'z_m', 'thickness_um')


CLAIMS: dict[str, tuple[str, Callable[[], bytes]]] = {
    'vertices of a binary PLY': ('ply', lambda: _ply('binary_little_endian', CLAIMED, 1)),
    'vertices of a text PLY': ('ply', lambda: _ply('ascii', CLAIMED, 1)),
    'faces of a binary PLY': ('ply', lambda: _ply('binary_little_endian', 3, CLAIMED)),
    'faces of a text PLY': ('ply', lambda: _ply('ascii', 3, CLAIMED)),
    'triangles of an STL': ('stl', lambda: bytes(80) + struct.pack('<I', CLAIMED) + bytes(50)),
    'triangles of an STL that begins as text': (
        'stl', lambda: b'solid facet'.ljust(80) + struct.pack('<I', CLAIMED) + bytes(50),
    ),
    'a chunk of a glTF': ('glb', lambda: _glb('{}', 4_000_000_000)),
    'an accessor of a glTF without bytes': ('glb', lambda: _glb(_gltf_accessor(''))),
    'a sparse accessor of a glTF': (
        'glb', lambda: _glb(_gltf_accessor(
            ',"sparse":{"count":1,"indices":{"bufferView":0,"componentType":5125},'
            '"values":{"bufferView":0}}')),
    ),
    'a record of an MCAP file': ('mcap', lambda: _mcap_record(2**40)),
    'a chunk in the index of an MCAP file': ('mcap', lambda: _mcap_index(2**40)),
    'a record to recover': ('mcap_recovery', lambda: _mcap_record(2**40)),
    'a zstd chunk of an MCAP file': ('mcap', lambda: _mcap_chunk(b'zstd', 2**40)),
    'a zstd chunk to recover': ('mcap_recovery', lambda: _mcap_chunk(b'zstd', 2**40)),
    'an lz4 chunk to recover': ('mcap_recovery', lambda: _mcap_chunk(b'lz4', 2**40)),
    'the head of a ROS 1 record': ('ros1', lambda: _bag(4_000_000_000, 10)),
    'the data of a ROS 1 record': ('ros1', lambda: _bag(8, 4_000_000_000)),
    'the index of a ROS 1 bag': ('ros1', _bag_index),
    'transforms of a message': ('mcap', lambda: _many_transforms()),
    'a cell of a workbook': ('workbook', _far_cell),
    'a cell of a workbook in single quotes': (
        'workbook', lambda: _far_cell(b"<c r='XFD1048576'>"),
    ),
    'a row of .ods that repeats': (
        'workbook', lambda: open_document(HEADINGS + open_row(1.0, rows=CLAIMED, last=100)),
    ),
    'a cell of .ods that repeats, and a row after many empty ones': (
        'workbook',
        lambda: open_document(
            open_row('x_m', last=CLAIMED) + open_row(rows=CLAIMED, empty=3) + open_row(1.0)
        ),
    ),
    'an array of RAPID': ('rapid', lambda: RAPID.replace(b'n{2}:=', b'n{1000000000}:=[[')),
}  # fmt: skip


@pytest.fixture
def little_memory() -> Iterator[None]:
    """So much beside what the process has."""
    taken = int(Path('/proc/self/statm').read_text().split()[0]) * resource.getpagesize()
    before = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (taken + MEMORY_BYTES, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_AS, before)


@pytest.mark.parametrize('what', CLAIMS)
def test_what_a_head_claims_is_not_believed(what, tmp_path, little_memory):
    name, content = CLAIMS[what]
    target = targets()[name]
    path = tmp_path / f'claims{target.suffix}'
    path.write_bytes(content())
    with pytest.raises(PaintError) as refused:
        target.read(path)
    error = refused.value
    assert '\n' not in str(error)
    while error is not None:
        assert not isinstance(error, MemoryError), f'{what}: memory was asked for'
        error = error.__cause__ or error.__context__


def test_a_kept_part_that_claims_more_than_it_has_is_prepared_anew(tmp_path, little_memory):
    place = tmp_path / 'part.npz'
    place.write_bytes(targets()['kept_part'].seeds()[0])
    assert surface_cache.find(place) is not None
    with zipfile.ZipFile(place) as package:
        members = {name: package.read(name) for name in package.namelist()}
    rows = np.load(BytesIO(members['vertices_m.npy'])).shape[0]
    claimed = members['vertices_m.npy'].replace(
        f'({rows}, 3), }}'.ljust(20).encode(), f'({CLAIMED}, 3), }}'.ljust(20).encode()
    )
    assert claimed != members['vertices_m.npy']
    with zipfile.ZipFile(place, 'w') as package:
        for name, content in (members | {'vertices_m.npy': claimed}).items():
            package.writestr(name, content)
    assert surface_cache.find(place) is None


NESTED = {
    'arrays of RAPID': ('rapid', lambda: RAPID.replace(b'[[0,0,0]', b'[' * 20_000 + b'[0,0,0]')),
    'signs of RAPID': ('rapid', lambda: RAPID.replace(b'100*(1+2)', b'-' * 20_000 + b'1')),
    'lists of a model': ('model', lambda: b'effects: ' + b'[' * 20_000),
    'lists of a campaign': ('campaign', lambda: b'experiments: ' + b'[' * 20_000),
    'lists of metadata': (
        'metadata', lambda: b'rosbag2_bagfile_information: ' + b'[' * 20_000,
    ),
    'links of a URDF': ('urdf', lambda: b'<robot name="a">' + b'<link name="x">' * 20_000),
}  # fmt: skip


@pytest.mark.parametrize('what', NESTED)
def test_what_is_nested_without_end_is_refused_in_a_line(what, tmp_path):
    name, content = NESTED[what]
    target = targets()[name]
    path = tmp_path / f'nested{target.suffix}'
    path.write_bytes(content())
    with pytest.raises(PaintError) as refused:
        target.read(path)
    assert '\n' not in str(refused.value)


def test_ten_thousand_headings_are_not_all_told(tmp_path):
    path = tmp_path / 'wide.csv'
    path.write_text(','.join(['x_m'] * 10_000) + '\n' + ','.join(['1'] * 10_000) + '\n')
    with pytest.raises(PaintError) as refused:
        targets()['readings'].read(path)
    assert len(str(refused.value)) < 1000
    assert 'and 9980 more' in str(refused.value)

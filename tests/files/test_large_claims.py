"""A head that claims more than its file holds is refused before memory is taken for it."""

import os
import resource
import struct
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from fuzz.targets import RAPID, targets
from paint_deposition.errors import PaintError

CLAIMED = 1_000_000_000
J = 0x4E4F534A  # a chunk of JSON
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


def _mcap_chunk() -> bytes:
    """A zstd chunk that is said to become very large."""
    records = b'\x28\xb5\x2f\xfd' + bytes(20)
    content = struct.pack('<QQQII', 0, 1, 2**40, 0, 4) + b'zstd'
    content += struct.pack('<Q', len(records)) + records
    magic = b'\x89MCAP0\r\n'
    header = b'\x01' + struct.pack('<QI4sI', 12, 4, b'ros2', 0)
    chunk = b'\x06' + struct.pack('<Q', len(content)) + content
    return magic + header + chunk + b'\x02' + struct.pack('<QQQI', 20, 0, 0, 0) + magic


def _far_cell() -> bytes:
    cell = b'<c r="XFD1048576">'
    sheet = targets()['worksheet']
    far = b'<row r="1048576">' + cell + b'<v>1</v></c></row></sheetData>'
    return sheet.around(sheet.seeds[0].replace(b'</sheetData>', far))


CLAIMS: dict[str, tuple[str, Callable[[], bytes]]] = {
    'vertices of a binary PLY': ('ply', lambda: _ply('binary_little_endian', CLAIMED, 1)),
    'faces of a text PLY': ('ply', lambda: _ply('ascii', 3, CLAIMED)),
    'triangles of an STL': ('stl', lambda: bytes(80) + struct.pack('<I', CLAIMED) + bytes(50)),
    'a chunk of a glTF': ('glb', lambda: struct.pack('<4s4I', b'glTF', 2, 20, 4 * CLAIMED, J)),
    'a zstd chunk to recover': ('mcap_recovery', _mcap_chunk),
    'a cell of a workbook': ('workbook', _far_cell),
    'an array of RAPID': ('rapid', lambda: RAPID.replace(b'n{2}:=', b'n{1000000000}:=[[')),
}


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


NESTED = {
    'arrays of RAPID': ('rapid', lambda: RAPID.replace(b'[[0,0,0]', b'[' * 20_000 + b'[0,0,0]')),
    'lists of a model': ('model', lambda: b'effects: ' + b'[' * 4_000),
    'lists of a campaign': ('campaign', lambda: b'experiments: ' + b'[' * 4_000),
    'links of a URDF': ('urdf', lambda: b'<robot name="a">' + b'<link name="x">' * 20_000),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize('what', NESTED)
def test_what_is_nested_without_end_is_refused_in_a_line(what, tmp_path):
    name, content = NESTED[what]
    target = targets()[name]
    path = tmp_path / f'nested{target.suffix}'
    path.write_bytes(content())
    with pytest.raises(PaintError) as refused:
        target.read(path)
    assert '\n' not in str(refused.value)


def test_ten_thousand_headings_are_not_all_shown(tmp_path):
    path = tmp_path / 'wide.csv'
    path.write_text(','.join(['x_m'] * 10_000) + '\n' + ','.join(['1'] * 10_000) + '\n')
    with pytest.raises(PaintError) as refused:
        targets()['readings'].read(path)
    assert len(str(refused.value)) < 1000
    assert 'and 9980 more' in str(refused.value)


@pytest.mark.parametrize('name', targets())
def test_a_device_or_a_pipe_is_not_read(name, tmp_path):
    target = targets()[name]
    device, pipe = tmp_path / f'zero{target.suffix}', tmp_path / f'pipe{target.suffix}'
    device.symlink_to('/dev/zero')
    os.mkfifo(pipe)
    for path in (device, pipe):
        with pytest.raises(PaintError, match='is a device or a pipe; give a file'):
            target.read(path)

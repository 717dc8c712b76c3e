"""A head that claims more than its file holds is refused before memory is taken for it."""

import json
import os
import resource
import shutil
import struct
import zipfile
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from io import BytesIO
from pathlib import Path

import pytest
import zstandard
from mcap.writer import Writer

from booth import SAMPLES
from fuzz.targets import RAPID, targets
from paint_deposition.errors import PaintError
from paint_deposition.files.recordings import bag_files
from paint_deposition.files.recordings.bag_files import custom_data, open_bag
from refusals import refusal

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


def _mcap_chunk(claimed: int, data: bytes) -> bytes:
    """A bag of one zstd chunk that is said to become so large."""
    plain = targets()['mcap'].seeds[0]
    content = struct.pack('<QQQII', 0, 1, claimed, 0, 4) + b'zstd'
    content += struct.pack('<Q', len(data)) + data
    chunk = b'\x06' + struct.pack('<Q', len(content)) + content
    head = 8 + 9 + struct.unpack('<Q', plain[9:17])[0]
    data_end = b'\x0f' + struct.pack('<QI', 4, 0)
    footer = b'\x02' + struct.pack('<QQQI', 20, 0, 0, 0)
    return plain[:head] + chunk + data_end + footer + plain[:8]


def _glb(count: int, nodes: list) -> bytes:
    """Zeros at these nodes."""
    head = {'nodes': nodes, 'scenes': [{'nodes': [0]}], 'scene': 0}
    head |= {'bufferViews': [], 'meshes': [{'primitives': [{'attributes': {'POSITION': 0}}]}]}
    head['accessors'] = [{'componentType': 5126, 'count': count, 'type': 'VEC3'}]
    content = json.dumps(head).encode()
    return struct.pack('<4s4I', b'glTF', 2, 20 + len(content), len(content), J) + content


def _doubled(around: bytes, between: bytes = b', ') -> bytes:
    """Thirty lists of YAML, each with the one before it ten times."""
    lines = [b'a0: &a0 {k0: 1}' if b'<<' in around else b'a0: &a0 [1]']
    for k in range(30):
        aliases = between.join([b'*a%d' % k] * 10)
        lines.append(b'a%d: &a%d ' % (k + 1, k + 1) + around % aliases)
    return b'\n'.join(lines)


def _bomb_chunk() -> bytes:
    """Its 100 kB expand to 3 GB, as it says."""
    compressor = zstandard.ZstdCompressor().compressobj(size=3 * CLAIMED)
    parts = [compressor.compress(bytes(10**7)) for _ in range(300)]
    return _mcap_chunk(3 * CLAIMED, b''.join([*parts, compressor.flush()]))


def _mcap_with(field: bytes) -> bytes:
    made = BytesIO()
    writer = Writer(made)
    writer.start(profile='ros2', library='')
    schema = writer.register_schema('geometry_msgs/msg/PoseStamped', 'ros2msg', field)
    channel = writer.register_channel('/atomizer/pose', 'cdr', schema)
    writer.add_message(channel, 1, bytes(64), 1)
    writer.finish()
    return made.getvalue()


def _book(sheet: Iterable[bytes], texts: bytes = b'<sst/>') -> bytes:
    """A workbook with this sheet, given in pieces, and these shared texts."""
    made, old = BytesIO(), zipfile.ZipFile(BytesIO(targets()['workbook'].seeds[0]))
    with zipfile.ZipFile(made, 'w', zipfile.ZIP_DEFLATED) as new:
        for name in set(old.namelist()) - {'xl/sheet1.xml'}:
            new.writestr(name, old.read(name))
        new.writestr('xl/sharedStrings.xml', texts)
        with new.open('xl/sheet1.xml', 'w', force_zip64=True) as member:
            member.writelines(sheet)
    return made.getvalue()


RAPID_BODIES = {
    'arrays': b'VAR num x{1000,1000,1000}; x{1,1,1}:=1;',
    'copies': b'VAR num x{100000}; VAR num y{100000}; FOR i FROM 1 TO 9999 DO y:=x; ENDFOR',
    'strings': b'VAR string s:="a"; FOR i FROM 1 TO 9999 DO s:=s+s; ENDFOR',
    'sums': b'VAR num x{100000}; VAR num n; FOR i FROM 1 TO 9999 DO n:=Dim(x+x,1); ENDFOR',
    'empty loops': b'FOR i FROM 1 TO 9998 DO FOR j FROM 1 TO 9998 DO ENDFOR ENDFOR',
}


def _row(text: bytes) -> bytes:
    sheet = targets()['worksheet']
    return sheet.seeds[0].replace(b'</sheetData>', text + b'><v>1</v></c></row></sheetData>')


def _main(body: bytes) -> bytes:
    return b'MODULE M\nPROC main()\n' + body.replace(b'; ', b';\n') + b'\nENDPROC\nENDMODULE\n'


def _calls() -> bytes:
    """Thirty procedures that each call the next twice, where only the robot knows whether."""
    procedures = [b'PROC p%d()\np%d;\np%d;\nENDPROC' % (k, k + 1, k + 1) for k in range(30)]
    procedures.append(b'PROC p30()\nMoveJ p,v100,fine,tool0;\nENDPROC')
    body = b'IF TestDI(di1) THEN\np0;\nENDIF'
    return _main(body).replace(b'ENDMODULE', b'\n'.join(procedures) + b'\nENDMODULE')


CLAIMS: dict[str, tuple[str, Callable[[], bytes]]] = {
    'vertices of a binary PLY': ('ply', lambda: _ply('binary_little_endian', CLAIMED, 1)),
    'faces of a text PLY': ('ply', lambda: _ply('ascii', 3, CLAIMED)),
    'triangles of an STL': ('stl', lambda: bytes(80) + struct.pack('<I', CLAIMED) + bytes(50)),
    'a chunk of a glTF': ('glb', lambda: struct.pack('<4s4I', b'glTF', 2, 20, 4 * CLAIMED, J)),
    'zeros of a glTF': ('glb', lambda: _glb(CLAIMED, [{'mesh': 0}])),
    'nodes within each other': (
        'glb', lambda: _glb(3, [{'children': [1]}, {'mesh': 0, 'children': [0]}]),
    ),
    'a zstd chunk to recover': (
        'mcap_recovery', lambda: _mcap_chunk(2**40, b'\x28\xb5\x2f\xfd' + bytes(20)),
    ),
    'lists of YAML': ('model', lambda: b'name: ' + b'[' * 100_000),
    'nested YAML': ('model', lambda: b'- ' * 100_000),
    'aliases of YAML': ('model', lambda: _doubled(b'[%s]')),
    'merged aliases of YAML': ('campaign', lambda: _doubled(b'{<<: [%s]}')),
    'aliases behind colons of YAML': ('model', lambda: _doubled(b'[{"k":%s}]', b'}, {"k":')),
    'an alias within itself': ('model', lambda: b'effects: &a [*a]'),
    'a zstd chunk': ('mcap', _bomb_chunk),
    'strings of a schema': ('mcap', lambda: _mcap_with(b'string[2000000000] a\n')),
    'blanks of a workbook': ('workbook', lambda: _book([_row(b'<row><c'), *400 * [10**6 * b' ']])),
    'a text in many cells': (
        'workbook', lambda: _book(
            [_row(b'<row>' + 1000 * b'<c t="s"><v>0</v></c>' + b'<c')],
            b'<sst><si><t>%s</t></si></sst>' % (10**6 * b'a'),
        ),
    ),
    'a far place with blanks': ('worksheet', lambda: _row(b'<row r="1048576"><c r = "XFD1"')),
    'cells without a place': (
        'worksheet', lambda: _row(10**6 * b'<row/>' + b'<row>' + 10**4 * b'<c/>' + b'<c'),
    ),
    'a cell no sheet has': ('worksheet', lambda: _row(b'<row r="1"><c r="AAAAA999999991"')),
    **{f'{name} of RAPID': ('rapid', partial(_main, body)) for name, body in RAPID_BODIES.items()},
    'calls of RAPID': ('rapid', _calls),
    'nested arrays of RAPID': (
        'rapid', lambda: RAPID.replace(b'[[0,0,0]', b'[' * 20_000 + b'[0,0,0]'),
    ),
    'links of a URDF': ('urdf', lambda: b'<robot name="a">' + b'<link name="x">' * 20_000),
    'an array of RAPID': ('rapid', lambda: RAPID.replace(b'p1:=', b'p1{1000000000}:=[[')),
}  # fmt: skip


@pytest.fixture
def little_memory() -> Iterator[None]:
    """So much beside what the process has."""
    taken = int(Path('/proc/self/statm').read_text().split()[0]) * resource.getpagesize()
    before = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (taken + MEMORY_BYTES, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_AS, before)


@pytest.mark.slow
@pytest.mark.parametrize('what', CLAIMS)
def test_what_a_head_claims_is_not_believed(what, tmp_path, little_memory):
    name, content = CLAIMS[what]
    target = targets()[name]
    path = tmp_path / f'claims{target.suffix}'
    path.write_bytes(target.around(content()))
    with pytest.raises(PaintError) as refused:
        target.read(path)
    error = refused.value
    assert '\n' not in str(error)
    while error is not None:
        assert not isinstance(error, MemoryError), f'{what}: memory was asked for'
        error = error.__cause__ or error.__context__


def test_a_recording_compressed_as_a_whole_is_not_expanded_beyond_measure(tmp_path, monkeypatch):
    """20 MB of zeros in 3 kB, in a place of 10 MB."""
    monkeypatch.setattr(bag_files, 'MOST_FILE_BYTES', 10_000_000)
    run = Path(shutil.copytree(SAMPLES / 'panel_577', tmp_path / 'run'))
    (file,) = run.glob('*.mcap')
    compressed = file.with_name(f'{file.name}.zstd')
    compressed.write_bytes(zstandard.ZstdCompressor().compress(file.read_bytes()))
    file.unlink()
    told = (run / 'metadata.yaml').read_text().replace(file.name, f'{file.name}.zstd')
    told = told.replace("compression_format: ''", 'compression_format: zstd')
    told = told.replace("compression_mode: ''", 'compression_mode: FILE')
    (run / 'metadata.yaml').write_text(told)
    with open_bag(run) as bag:
        assert bag.find('/atomizer/pose')
    compressed.write_bytes(zstandard.ZstdCompressor().compress(bytes(10_000_000)) * 2)
    with pytest.raises(PaintError, match=r'it holds over 0\.01 GB, .* \(zstd -d\)'), open_bag(run):
        pass


def test_ten_thousand_headings_are_not_all_shown(file):
    path = file('wide.csv', '\n'.join(','.join(10_000 * [cell]) for cell in ('x_m', '1')) + '\n')
    line = refusal(PaintError, targets()['readings'].read, path)
    assert len(line) < 1000
    assert 'and 9980 more' in line


@pytest.mark.parametrize('text', [b'[ #]\n' * 100_000, _doubled(b'[%s]')])
def test_the_metadata_of_a_bag_end_no_process(text, tmp_path):
    """Parsers written in C would."""
    shutil.copytree(SAMPLES / 'panel_577', tmp_path / 'run')
    (tmp_path / 'run/metadata.yaml').write_bytes(text)
    assert custom_data(tmp_path / 'run') == {}
    with pytest.raises(PaintError, match='is damaged'), open_bag(tmp_path / 'run'):
        pass


# Figures that are no file are as if they were not there.
@pytest.mark.parametrize('name', sorted(targets().keys() - {'comparison', 'stats'}))
def test_a_device_or_a_pipe_is_not_read(name, tmp_path):
    target = targets()[name]
    device, pipe = tmp_path / f'zero{target.suffix}', tmp_path / f'pipe{target.suffix}'
    device.symlink_to('/dev/zero')
    os.mkfifo(pipe)
    for path in (device, pipe):
        with pytest.raises(PaintError, match='is a device or a pipe; give a file'):
            target.read(path)

"""A short run of the fuzzer, by the command behind `make fuzz`."""

import re
import subprocess
import sys

import pytest

pytest.importorskip('atheris', reason='has wheels for Linux on x86-64 only')

QUICK = ('rapid', 'readings', 'ply', 'urdf', 'mcap_recovery')
INPUTS = 200


@pytest.mark.slow
def test_changed_files_are_read_or_refused_in_a_line(tmp_path, repository):
    done = subprocess.run(
        [sys.executable, '-m', 'fuzz.run', *QUICK, '--inputs', str(INPUTS), '--seed', '1',
         '--place', tmp_path],
        cwd=repository / 'tests', capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    counts = dict(re.findall(r'^(\w+): (\d+) inputs, 0 findings$', done.stdout, re.M))
    assert counts.keys() == {*QUICK}
    # All but the few files to begin from are new inputs.
    assert all(INPUTS - 5 <= int(count) < INPUTS for count in counts.values())


@pytest.mark.slow
def test_what_a_reader_does_wrong_is_found(tmp_path, repository):
    """Of a reader that is right for its own file only, fails for others or takes 2 GB."""
    code = """
import sys
from pathlib import Path
from fuzz import reading

def read(path):
    content = path.read_bytes()
    if content != b'good' and len(content) % 2:
        raise ValueError('broken')
    return bytearray(4 if content == b'good' else 2_000_000_000)

target = reading.Target('.bin', read, lambda: [b'good'])
reading.fuzz('faulty', target, Path(sys.argv[1]), ['-runs=200', '-seed=1'])
"""
    subprocess.run(
        [sys.executable, '-c', code, tmp_path], cwd=repository / 'tests',
        capture_output=True, check=True,
    )  # fmt: skip
    found = {path.name for path in (tmp_path / 'findings/faulty').glob('*.bin')}
    assert found == {'ValueError-elsewhere.bin', 'MemoryError-elsewhere.bin'}

"""A short run of the fuzzer, by the command behind `make fuzz`."""

import re
import subprocess
import sys

import pytest

pytest.importorskip('atheris', reason='has wheels for Linux on x86-64 only')

QUICK = ('rapid', 'readings', 'mcap_recovery')
INPUTS = 60


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

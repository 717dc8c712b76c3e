"""`paint inspect` and `paint recover`, as a user runs them."""

import json
import os
import subprocess
import sys

import pytest

from files.recorded import straight_pass
from paint_deposition.files.recordings.bags import read_trajectory, write_pose_bag


@pytest.fixture
def paint(tmp_path, repository):
    """`paint(argument, ...)`: the finished process of the command, run in a folder of its own."""
    sources = str(repository / 'ros2_ws/src/paint_deposition')
    environment = os.environ | {
        'PYTHONPATH': os.pathsep.join([sources, os.environ.get('PYTHONPATH', '')])
    }

    def paint(*arguments: object) -> subprocess.CompletedProcess:
        return subprocess.run(
            [sys.executable, '-m', 'paint_deposition.cli.main', *map(str, arguments)],
            capture_output=True,
            text=True,
            cwd=tmp_path,
            env=environment,
            check=False,
        )

    return paint


@pytest.fixture
def cut_run(tmp_path):
    folder = write_pose_bag(tmp_path / 'run', straight_pass(4_000))
    path = folder / 'run_0.mcap'
    content = path.read_bytes()
    path.write_bytes(content[: int(0.7 * len(content))])
    (folder / 'metadata.yaml').unlink()
    return folder


def test_inspect_a_real_bag(paint, shared_data):
    done = paint('inspect', shared_data / 'bags/evo_ROS_example.bag')
    assert done.returncode == 0
    assert done.stderr == ''
    line = next(line for line in done.stdout.splitlines() if line.startswith('poses on groundtr'))
    assert "12765 in frame 'groundtruth' over 889.019 s" in line
    assert '95 gaps, longest interval 2.041 s' in line


def test_inspect_as_json(paint, tmp_path):
    written = straight_pass(300)
    folder = write_pose_bag(tmp_path / 'pass', written)
    done = paint('inspect', folder, '--json', '--max-pose-gap-s', '0.02')
    figures = json.loads(done.stdout)
    (stream,) = figures['pose_streams']
    assert (stream['topic'], stream['poses'], stream['frame_id']) == (
        '/atomizer/pose',
        300,
        'door',
    )
    assert stream['gaps'] == sum(written.stamps_ns[1:] - written.stamps_ns[:-1] > 20_000_000)
    assert figures['triggers'] == ['/atomizer/state']


def test_inspect_an_unfinished_run(paint, cut_run):
    done = paint('inspect', cut_run)
    assert done.returncode == 2
    assert done.stdout == ''
    (line,) = done.stderr.splitlines()
    assert line.endswith(f'run: paint recover {cut_run}')


def test_recover_does_what_inspect_says(paint, cut_run, tmp_path):
    done = paint('recover', cut_run)
    assert done.returncode == 0
    assert done.stderr == ''
    first, *_, last = done.stdout.splitlines()
    assert first.endswith('the end is missing')
    assert last.endswith('messages recovered: ' + str(tmp_path / 'run_recovered'))
    assert len(read_trajectory(tmp_path / 'run_recovered')) > 2_000
    again = paint('recover', cut_run)
    assert again.returncode == 2
    assert 'run_recovered already exists; choose another name' in again.stderr


def test_recover_as_json(paint, cut_run, tmp_path):
    done = paint('recover', cut_run / 'run_0.mcap', '-o', tmp_path / 'whole', '--json')
    figures = json.loads(done.stdout)
    assert figures['folder'] == str(tmp_path / 'whole')
    assert figures['messages'] == sum(figures['topics'].values()) > 2_000
    assert figures['damaged_chunks'] == 0


@pytest.mark.parametrize('value', ['nan', 'inf', '0'])
def test_a_gap_that_is_no_time_is_refused(paint, tmp_path, value):
    folder = write_pose_bag(tmp_path / 'run', straight_pass(100))
    done = paint('inspect', folder, '--max-pose-gap-s', value)
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert '--max-pose-gap-s' in line
    assert value in line


def test_a_gap_longer_than_clocks_count_is_none(paint, tmp_path):
    folder = write_pose_bag(tmp_path / 'run', straight_pass(100))
    done = paint('inspect', folder, '--max-pose-gap-s', '1e300')
    assert done.returncode == 0, done.stderr
    assert ' 0 gaps' in done.stdout


@pytest.mark.parametrize('command', ['inspect', 'recover'])
def test_nothing_there_is_one_line(paint, command):
    done = paint(command, 'nowhere')
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert 'nowhere' in line

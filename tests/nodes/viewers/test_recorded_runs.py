"""A run as the libraries of viewers read it: those of Foxglove and Lichtblick, and Rerun."""

import json
import os
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from paint_msgs.msg import ThicknessField
from rclpy.serialization import deserialize_message

from nodes.bags.runs import finish, messages
from nodes.cell import two_passes

HERE = Path(__file__).parent
POSES = 100


@pytest.fixture
def run(simulator, record, robot, painted, wait_until):
    """The messages of a run with poses and the film that they gave, and its file."""
    node = simulator(max_edge_length_m=0.1, publish_rate_hz=20.0)
    recorder = record()
    arm, count = robot(node, recorder), recorder.run.counts.get
    wait_until(lambda: count('/thickness/field'), what='the bare part recorded')
    bare = count('/thickness/field')
    arm.send(two_passes(POSES))
    painted(node, POSES)
    wait_until(lambda: count('/atomizer/pose') == POSES, what='every pose recorded')
    wait_until(lambda: count('/thickness/field') > bare, what='the film recorded')
    finish(recorder)
    (path,) = recorder.run.folder.glob('*.mcap')
    return messages(path), path


@pytest.fixture(scope='session')
def libraries():
    """Install those of npm, once for a checkout."""
    if shutil.which('npm') is None:
        pytest.skip('npm is not installed')
    if not (HERE / 'node_modules').is_dir():
        install = ['npm', 'ci', '--ignore-scripts', '--no-audit', '--prefer-offline']
        if subprocess.run(install, cwd=HERE, capture_output=True, timeout=120).returncode:
            pytest.skip('the registry of npm cannot be reached')


@pytest.mark.slow
def test_foxglove_reads_poses_film_and_what_is_latched(libraries, run):
    recorded, path = run
    command = ['node', HERE / 'read_run.mjs', path]
    topics = json.loads(subprocess.run(command, capture_output=True, check=True).stdout)
    names = [name for name, _ in recorded]
    assert {n: found['count'] for n, found in topics.items()} == {n: names.count(n) for n in names}
    x, y, z = two_passes(POSES).positions_m[-1]
    assert topics['/atomizer/pose']['newest']['pose']['position'] == {'x': x, 'y': y, 'z': z}
    film, field = topics['/thickness/field']['newest'], dict(recorded)['/thickness/field']
    field = deserialize_message(field, ThicknessField)
    assert max(field.thickness_um) > 1.0
    assert np.array_equal(np.float32(film['thickness_um']), field.thickness_um)
    assert (film['mesh_id'], film['header']['frame_id']) == (field.mesh_id, 'part')
    cloud = topics['/thickness/cloud']['newest']
    assert [one['name'] for one in cloud['fields']] == ['x', 'y', 'z', 'thickness_um']
    assert cloud['width'] == len(field.thickness_um)
    assert 'transient_local' in topics['/thickness/stats']['qos']


@pytest.mark.slow
@pytest.mark.skipif(find_spec('rerun') is None, reason='rerun-sdk is not installed')
def test_rerun_reads_every_topic(run, tmp_path):
    recorded, path = run

    def rerun(*arguments: object) -> str:
        command = [sys.executable, '-m', 'rerun', *map(str, arguments)]
        done = subprocess.run(
            command, env=os.environ | {'HOME': str(tmp_path)}, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr
        return done.stdout + done.stderr

    rerun('mcap', 'convert', path, '-o', tmp_path / 'run.rrd')
    rerun('rrd', 'verify', tmp_path / 'run.rrd')
    figures = rerun('rrd', 'stats', tmp_path / 'run.rrd')
    assert all(f'\n{topic}: ' in figures for topic, _ in recorded)

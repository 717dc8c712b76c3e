"""Nodes told to end or killed at random moments, by the command behind `make reliability`."""

import json
import subprocess
import sys

import pytest

pytest.importorskip('rclpy')

WAYS = ('SIGINT once', 'SIGINT twice', 'SIGTERM once', 'SIGTERM twice', 'SIGKILL')


@pytest.mark.timeout(600)
def test_a_recorder_that_ends_at_any_moment_keeps_its_run(ros_domain, repository):
    done = subprocess.run(
        [sys.executable, repository / 'benchmarks/reliability.py', '--times', '5',
         '--nodes', 'run_recorder', '--seed', '3'],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    held = json.loads(done.stdout)['held']
    assert sum(held.values()) == len(WAYS)
    # Few moments are so early that no code of the node runs yet.
    assert len({*held} & {f'run_recorder, {way}' for way in WAYS}) >= len(WAYS) - 1

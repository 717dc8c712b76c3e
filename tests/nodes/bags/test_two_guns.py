"""Two guns recorded in one run, and replayed into a simulator of two guns."""

from dataclasses import replace

import numpy as np
import pytest

from nodes.cell import Robot, offline_um, two_passes
from paint_deposition.api.simulation import simulate
from paint_deposition.files.motion_files import MotionSource, read_gun_motions

GUNS = ['robot_1', 'robot_2']
HIGH, OTHER = two_passes(poses=400), two_passes(poses=320)
LOW = replace(OTHER, positions_m=OTHER.positions_m + np.array([0.1, 0.0, -0.15]))
POSES = len(HIGH) + len(LOW)


def test_a_run_of_two_guns_replayed_is_the_film_that_was_painted(
    simulator, record, ros_context, spin, wait_until, painted, play
):
    """Live, from one bag by a player for each gun, and offline: the same film to the last bit."""
    node = simulator(atomizers=GUNS)
    recorder = record(atomizers=GUNS)
    robots = [Robot(ros_context, namespace=name) for name in GUNS]
    spin(*robots)
    publishers = [p for robot in robots for p in (robot.pose_publisher, robot.state_publisher)]
    wait_until(lambda: all(p.get_subscription_count() == 2 for p in publishers), what='discovery')
    for start in range(0, len(HIGH), 37):
        robots[1].send(LOW, slice(start, start + 37))
        robots[0].send(HIGH, slice(start, start + 37))
    live = painted(node, POSES)
    assert np.array_equal(live, offline_um(node, HIGH) + offline_um(node, LOW))
    recorder.close()
    run = recorder.run.folder

    node.reset()
    players = [
        play(
            run, namespace=f'/{name}', pose_topic=f'/{name}/atomizer/pose', rate=0.0,
            state_topic=f'/{name}/atomizer/state', publish_clock=name == GUNS[0],
        )
        for name in GUNS
    ]  # fmt: skip
    wait_until(lambda: all(player.finished.done() for player in players), what='both replays')
    assert np.array_equal(painted(node, POSES), live)

    guns = read_gun_motions([run], MotionSource(), GUNS)
    film = simulate(node.surface, [gun.trajectory for gun in guns], names=GUNS)
    assert film.film_um.max() == pytest.approx(live.max(), rel=1e-6)
    assert np.abs(film.film_um - live).max() < 1e-5 * live.max()

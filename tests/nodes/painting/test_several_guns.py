"""Several guns on one part: one film, live and replayed, whoever's poses come first."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import paint_deposition as pd
from brushes import two_brushes
from nodes.cell import offline_um, parameters, turned, two_passes
from paint_deposition.files.motion_files import read_gun_motions
from paint_deposition.request import MotionOptions


def moved(motion: pd.Trajectory, by_m: list[float]) -> pd.Trajectory:
    return replace(motion, positions_m=motion.positions_m + by_m)


GUNS = ['robot_1', 'robot_2']
HIGH = two_passes(poses=400)
LOW = moved(two_passes(poses=320, trigger=False), [0.1, 0.0, -0.15])
THIN = pd.DepositionModel(planar={'K1_cm3_per_s': 1.0})


@pytest.fixture
def guns(robot):
    """`guns(node)`: a robot for each of GUNS, heard by the node."""
    return lambda node: [robot(node, namespace=name) for name in GUNS]


def test_each_guns_share_is_reported(simulator, guns, painted, onlooker, wait_until):
    node = simulator(atomizers=GUNS)
    fields = [f'{gun}/thickness/field' for gun in GUNS]
    viewer = onlooker('thickness/stats', *fields)
    first, second = guns(node)
    first.send(HIGH)
    second.send(LOW)
    poses = len(HIGH) + len(LOW)
    painted(node, poses)
    alone = [offline_um(node, motion) for motion in (HIGH, LOW)]
    wait_until(lambda: viewer.shows('thickness/stats', lambda m: m.poses_received == poses))
    stats = viewer.newest('thickness/stats')
    volumes = np.array([film @ node.surface.vertex_areas_m2 for film in alone])
    assert stats.atomizers == GUNS
    assert np.allclose(stats.atomizer_volume_cm3, volumes, rtol=1e-12)
    assert np.allclose(stats.atomizer_share, volumes / volumes.sum(), rtol=1e-12)
    assert sum(stats.atomizer_volume_cm3) == pytest.approx(stats.painted_volume_cm3, rel=1e-12)
    for topic, film in zip(fields, alone, strict=True):
        same = partial(np.array_equal, film.astype(np.float32))
        wait_until(lambda t=topic, s=same: viewer.shows(t, lambda m: s(m.thickness_um)), topic)
    for task, key, value in (
        ('film', 'share of robot_2', f'{volumes[1] / volumes.sum():.1%}'),
        ('robot_2/poses', 'poses taken', str(len(LOW))),
    ):
        told = f'deposition_simulator: {task}', key
        wait_until(lambda t=told, v=value: viewer.value(*t) == v, what=value)


def test_the_first_gun_decides_which_side_is_outward(simulator, guns, painted, wait_until):
    """Two guns on the two sides of a sheet; the one behind it comes first."""
    node = simulator(atomizers=GUNS)
    first, second = guns(node)
    behind = turned(LOW, 180.0)
    second.send(behind)
    painted(node, len(behind))
    wait_until(lambda: node.surface.outward[1] > 0.0, what='the part turned to the second gun')
    first.send(HIGH)
    painted(node, len(behind) + len(HIGH))
    wait_until(lambda: node.surface.outward[1] < 0.0, what='the part turned to the first gun')
    assert np.array_equal(node.film.snapshot().film_um, offline_um(node, HIGH))


def test_no_gun_uses_a_model_that_another_refuses(simulator, guns, wait_until, tmp_path):
    both, files = two_brushes(), [str(tmp_path / name) for name in ('both.yaml', 'one.yaml')]
    for file, brushes in zip(files, (both.brushes, both.brushes[:1]), strict=True):
        pd.write_model(file, pd.DepositionModel(brushes=brushes))
    node = simulator(atomizers=GUNS, model_file=files[0], repaint=False)
    for number, gun in enumerate(guns(node), start=1):
        gun.send_state(HIGH.stamps_ns[0], 1.0, brush=number)
    wait_until(lambda: all(source.spraying for source in node.inputs), what='the states')
    node.set_parameters(parameters(model_file=files[1]))
    wait_until(lambda: not node.repainting, what='the end of the trial')
    assert 'brush 2 is not in the model' in node.model_problem
    assert [gun.model for gun in node.film.guns] == [both, both]


def test_the_film_is_the_sum_of_guns(simulator, record, guns, wait_until, painted, play, tmp_path):
    """In turn, one after the other, from one bag by a player for each gun, and offline."""
    pd.write_model(tmp_path / 'thin.yaml', THIN)
    low = moved(two_passes(poses=320), [0.1, 0.0, -0.15])
    node = simulator(atomizers=GUNS, model_files=['', str(tmp_path / 'thin.yaml')])
    poses = len(HIGH) + len(low)
    recorder, (first, second) = record(atomizers=GUNS), guns(node)
    wait_until(lambda: first.has_subscribers(2) and second.has_subscribers(2), what='discovery')
    for start in range(0, len(HIGH), 37):
        second.send(low, slice(start, start + 37))
        first.send(HIGH, slice(start, start + 37))
        painted(node, min(start + 37, len(HIGH)) + min(start + 37, len(low)))
    live = painted(node, poses)
    alone = offline_um(node, HIGH), offline_um(node, low, THIN)
    assert min(film.max() for film in alone) > 1.0
    assert np.array_equal(live, sum(alone))
    recorder.close()
    run = recorder.run.folder

    node.reset()
    first.send(HIGH)
    second.send(low)
    assert np.array_equal(painted(node, poses), live)
    node.reset()
    players = [
        play(
            run, namespace=f'/{name}', pose_topic=f'/{name}/atomizer/pose', rate=0.0,
            state_topic=f'/{name}/atomizer/state', publish_clock=name == GUNS[0],
        )
        for name in GUNS
    ]  # fmt: skip
    wait_until(lambda: all(player.finished.done() for player in players), what='both replays')
    assert np.array_equal(painted(node, poses), live)

    motions = [motion for _, motion in read_gun_motions([run], MotionOptions(), GUNS)]
    film = pd.simulate(node.surface, motions, [pd.DepositionModel(), THIN], names=GUNS)
    assert film.film_um.max() == pytest.approx(live.max(), rel=1e-6)
    assert np.abs(film.film_um - live).max() < 1e-5 * live.max()

"""Passes are told apart however the robot turns between them, and not split on curved parts."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import scenes
from paint_deposition.motion.path_builder import spray_path
from paint_deposition.motion.trajectory import Trajectory

SPEED_M_PER_S = 0.5
LENGTH_M = 1.2
PASSES = 4


def resampled(corners_m, spacing_m):
    """(N, 2) points at even steps along a polyline, and the distance along it."""
    corners_m = np.array(corners_m, dtype=float)
    along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(corners_m, axis=0), axis=1)))
    at = np.arange(0.0, along[-1], spacing_m)
    return np.stack([np.interp(at, along, corners_m[:, k]) for k in (0, 1)], axis=1), at


def turn_points(kind, radius_m):
    """From one pass to the next, up by `rise`: points right of the pass's end, and the rise."""
    arc = np.linspace(0.0, np.pi, 181)[1:-1]
    if kind == 'semicircle':
        return radius_m * np.stack([np.sin(arc), 1.0 - np.cos(arc)], axis=1), 2.0 * radius_m
    if kind == 'corner':
        return np.empty((0, 2)), radius_m
    # A link of 0.3 m whose corners are cut.
    points = radius_m * np.stack([np.sin(arc), 1.0 - np.cos(arc)], axis=1)
    points[len(arc) // 2 :, 1] += 0.3 - 2.0 * radius_m
    return points, 0.3


def raster(kind, radius_m, gun, noise_m=0.0, period_s=0.004):
    """To and fro in x-y; the gun is off in the turns, always on, or without trigger."""
    points, rise_m = turn_points(kind, radius_m)
    corners = []
    for k in range(PASSES):
        base = np.array([0.0, k * rise_m])
        turn = np.add(points, [LENGTH_M, 0.0]) if k < PASSES - 1 else np.empty((0, 2))
        leg = np.vstack([[[0.0, 0.0], [LENGTH_M, 0.0]], turn])
        corners.append((leg if k % 2 == 0 else leg * [-1, 1] + [LENGTH_M, 0.0]) + base)
    xy, at_m = resampled(np.vstack(corners), SPEED_M_PER_S * period_s)
    stamps = scenes.stamps_ns(at_m / SPEED_M_PER_S)
    trigger = {}
    if gun == 'off in turns':
        on = (xy[:, 0] > 0.0) & (xy[:, 0] < LENGTH_M)
        change = np.flatnonzero(np.diff(np.append(False, on)))
        trigger = {'trigger_stamps_ns': stamps[change], 'trigger_flow': on[change].astype(float)}
    elif gun == 'on':
        trigger = {'trigger_stamps_ns': stamps[:1], 'trigger_flow': np.ones(1)}
    positions = np.column_stack([xy, np.full(len(xy), 0.25)])
    positions += np.random.default_rng(3).normal(0.0, noise_m, positions.shape)
    quaternions = np.tile(scenes.LOOKING_DOWN, (len(xy), 1))
    return Trajectory(stamps, positions, quaternions, **trigger)


def assert_passes_are_the_rows(path):
    """Four passes; every row has its own number from 0.1 m behind the turn to the next."""
    assert path.spray_pass.max() == PASSES - 1
    middle = (path.flow > 0.0) & (np.abs(path.position_m[:, 0] - 0.5 * LENGTH_M) < 0.5)
    y = path.position_m[middle, 1]
    rows = np.round((PASSES - 1) * (y - y.min()) / np.ptp(y)).astype(int)
    assert np.array_equal(path.spray_pass[middle], rows)


@pytest.mark.parametrize('gun', ['off in turns', 'on', 'no trigger'])
@pytest.mark.parametrize(
    ('kind', 'size_m'),
    [
        ('corner', 0.05), ('corner', 0.3), ('semicircle', 0.05), ('semicircle', 0.15),
        ('semicircle', 0.29), ('zone', 0.01), ('zone', 0.05), ('zone', 0.14),
    ],
)  # fmt: skip
def test_every_row_of_a_raster_is_a_pass(kind, size_m, gun):
    path, _ = spray_path(raster(kind, size_m, gun, noise_m=2e-4))
    assert_passes_are_the_rows(path)


@pytest.mark.parametrize(('period_s', 'noise_m'), [(0.001, 2e-5), (0.03, 2e-4)])
def test_the_rate_of_the_poses_does_not_matter(period_s, noise_m):
    for kind, size_m in (('corner', 0.3), ('semicircle', 0.05), ('semicircle', 0.29)):
        path, _ = spray_path(raster(kind, size_m, 'on', noise_m, period_s))
        assert_passes_are_the_rows(path)


def arc_pass(radius_m, sweep_rad, followed, noise_m=2e-4):
    """There and back over a crowned part: an arc in x-z, the gun square to it or kept upright."""
    angle = np.arange(-0.5 * sweep_rad, 0.5 * sweep_rad, 0.15 * 0.01 / radius_m)
    angle = np.concatenate([angle, angle[::-1]])
    y = np.repeat([0.0, 0.3], len(angle) // 2)
    positions = radius_m * np.column_stack([np.sin(angle), 0.0 * angle, np.cos(angle)])
    positions[:, 1] = y
    link = np.linspace(positions[len(angle) // 2 - 1], positions[len(angle) // 2], 200)[1:-1]
    half = len(angle) // 2
    positions = np.vstack([positions[:half], link, positions[half:]])
    angle = np.concatenate([angle[:half], np.full(len(link), angle[half]), angle[half:]])
    positions += np.random.default_rng(4).normal(0.0, noise_m, positions.shape)
    tilt = Rotation.from_euler('y', angle if followed else 0.0 * angle)
    return Trajectory(
        scenes.stamps_ns(0.01 * np.arange(len(positions))),
        positions,
        (tilt * Rotation.from_quat(scenes.LOOKING_DOWN)).as_quat(),
    )


@pytest.mark.parametrize(
    ('radius_m', 'sweep_rad', 'followed'),
    [(3.0, 0.5, False), (1.2, 0.9, False), (1.2, 0.9, True), (0.25, 2.0, True)],
)
def test_a_pass_along_a_crowned_part_is_one(radius_m, sweep_rad, followed):
    path, _ = spray_path(arc_pass(radius_m, sweep_rad, followed))
    assert path.spray_pass.max() == 1
    for number, y in enumerate((0.0, 0.3)):
        rows = np.abs(path.position_m[:, 1] - y) < 0.002
        beyond = np.flatnonzero(rows)[20:]
        assert set(path.spray_pass[beyond]) == {number}
        assert len(set(path.stroke[beyond])) == 1


def test_a_gun_that_is_tilted_on_a_straight_pass_does_not_turn():
    x = np.arange(0.0, 1.2, 0.003)
    tilt = Rotation.from_euler('y', 2.0 * (x / 1.2 - 0.5))
    positions = np.column_stack([x, 0.0 * x, 0.25 + 0.0 * x])
    quaternions = (tilt * Rotation.from_quat(scenes.LOOKING_DOWN)).as_quat()
    path, _ = spray_path(Trajectory(scenes.stamps_ns(x / 0.3), positions, quaternions))
    assert path.stroke.max() == 0
    assert path.spray_pass.max() == 0


@pytest.mark.parametrize(('shift_m', 'passes'), [(0.0, 1), (0.2, 2)])
def test_a_gun_that_opens_again_on_another_track_begins_a_pass(shift_m, passes):
    """Off at 0.5 m, up by the shift at 45 degrees at most, on again 0.3 m farther."""
    xy, at_m = resampled([(0.0, 0.0), (0.5, 0.0), (0.8, shift_m), (1.5, shift_m)], 0.003)
    stamps = scenes.stamps_ns(at_m / 0.3)
    on_m = [0.0, 0.5, 0.5 + np.hypot(0.3, shift_m)]
    trajectory = Trajectory(
        stamps,
        np.column_stack([xy, np.full(len(xy), 0.25)]),
        np.tile(scenes.LOOKING_DOWN, (len(xy), 1)),
        trigger_stamps_ns=scenes.stamps_ns(np.array(on_m) / 0.3),
        trigger_flow=np.array([1.0, 0.0, 1.0]),
    )
    path, _ = spray_path(trajectory)
    assert path.stroke.max() == 0
    assert path.spray_pass.max() == passes - 1


@pytest.mark.parametrize('angle_deg', [65.0, 90.0, 180.0])
@pytest.mark.parametrize('noise_m', [0.0, 2e-4])
def test_a_turn_is_placed_where_the_path_turns(angle_deg, noise_m):
    angle = np.radians(angle_deg)
    for run_m in (0.5, 0.504, 0.507, 0.511):
        end = (run_m + 0.5 * np.cos(angle), 0.5 * np.sin(angle))
        xy, at_m = resampled([(0.0, 0.0), (run_m, 0.0), end], 0.002)
        positions = np.column_stack([xy, np.full(len(xy), 0.25)])
        positions += np.random.default_rng(6).normal(0.0, noise_m, positions.shape)
        quaternions = np.tile(scenes.LOOKING_DOWN, (len(xy), 1))
        path, _ = spray_path(Trajectory(scenes.stamps_ns(at_m / 0.5), positions, quaternions))
        assert path.stroke.max() == 1
        nearest_m = np.minimum(path.from_turn_m, path.to_turn_m)
        at_s = (path.stamp_ns - scenes.START_NS) * 1e-9
        near = np.abs(0.5 * at_s - run_m) < 0.05
        wanted_m = np.abs(0.5 * at_s - run_m)[near]
        # A turn is told to half the travel between poses that are followed, 4 mm.
        assert np.abs(nearest_m[near] - wanted_m).max() < (0.00201 if noise_m == 0.0 else 0.004)

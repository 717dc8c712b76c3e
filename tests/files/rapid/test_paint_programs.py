"""Nine paint programs of `programs/`, each with the poses that it means, by plain arithmetic."""

import math
import shutil
from pathlib import Path

import numpy as np
import pytest

import paint_deposition as pd

FOLDER = Path(__file__).with_name('programs')
STEP_S = 0.02


class Poses:
    """A table of poses over time: rows of time [s], place [mm], gun and brush."""

    def __init__(self, x, y, z=250.0):
        self.rows = [[0.0, x, y, z, 0, 0]]

    def go(self, x, y, v, brush=0, flow=1.0, z=250.0):
        """Straight to a place at a speed [mm/s]; with a brush the gun is open."""
        begin = np.array(self.rows[-1][1:4])
        way = np.array([x, y, z]) - begin
        return self._along(lambda s: begin + s * way, math.hypot(*way) / v, brush, flow)

    def stay(self, seconds, brush):
        at = self.rows[-1][1:4]
        return self._along(lambda s: at, seconds, brush, 1.0)

    def _along(self, place, duration, brush, flow):
        start, flow, brush = self.rows[-1][0], flow * bool(brush), brush or self.rows[-1][5]
        count = math.ceil(duration / STEP_S)
        for share in np.arange(1, count + 1) / max(count, 1):
            self.rows[-1][4:] = flow, brush
            self.rows.append([start + share * duration, *place(share), 0, brush])
        return self

    @property
    def trajectory(self) -> pd.Trajectory:
        time_s, *place, flow, brush = np.array(self.rows).T
        stamps = np.round(time_s * 1e9).astype(np.int64)
        gun = np.array([flow, brush * (flow > 0.0)])
        changes = np.append(True, (np.diff(gun) != 0.0).any(axis=0))
        return pd.Trajectory(
            stamps, np.array(place).T * 1e-3, np.tile([1.0, 0.0, 0.0, 0.0], (len(stamps), 1)),
            trigger_stamps_ns=stamps[changes], trigger_flow=flow[changes],
            trigger_brush=brush[changes].astype(np.int64),
        )  # fmt: skip


def zigzag() -> Poses:
    """The loop of a flat part, and an auxiliary output that is no gun."""
    poses = Poses(0, 0)
    for k in range(4):
        ends = (0, 600) if k % 2 == 0 else (600, 0)
        poses.go(ends[0], 100 * k, 500).go(ends[1], 100 * k, 600, brush=1)
    return poses


def arrays() -> Poses:
    """Heights, speeds and brushes of the strokes in arrays, and WHILE."""
    poses = Poses(0, 50)
    for y, v, brush in ((50, 400, 1), (130, 500, 2), (240, 600, 1)):
        poses.go(0, y, 1000).go(500, y, v, brush)
    return poses


def procedures() -> Poses:
    """Arguments, an optional one, a function, and one that comes back."""
    poses = Poses(100, 0)
    for x, v, brush in ((100, 500, 1), (220, 500, 2), (340, 250, 1)):
        poses.go(x, 0, 800).go(x, 400, v, brush)
    return poses


def styles() -> Poses:
    """TEST on the style of the part, RETURN, EXIT; speeds limited by VelSet; a displacement."""
    return Poses(0, 60).go(500, 60, 300, 2).go(500, 160, 250, 2)


def planes() -> Poses:
    """Brushes change at planes of a work object that turns the tool; the target turns it back."""
    poses = Poses(100, 0).go(100, 100, 500).go(100, 250, 500, 1).go(100, 400, 500, 2)
    return poses.go(100, 600, 500)


def conveyor() -> Poses:
    """A part on a conveyor: the way to it is left out, and poses are those on the part."""
    return Poses(0, 80).go(600, 80, 400, 2).go(600, 200, 1000).go(0, 200, 400, 2)


def outputs() -> Poses:
    """The gun by an output, its flow and brush by others, and a wait with the gun open."""
    poses = Poses(0, 100).go(100, 100, 500).go(450, 100, 500, 1, flow=0.8).go(500, 100, 500)
    return poses.go(500, 300, 500).stay(0.4, 2).go(0, 300, 500, 2)


def tools() -> Poses:
    """The way to the part with tool0, times instead of speeds, displacements along the tool."""
    return Poses(0, 0).go(300, 0, 150, 1).go(300, 150, 1000).go(0, 150, 500, 1)


def modules() -> Poses:
    """A program of three modules, two of which have a datum of the same name for themselves."""
    return Poses(0, 120).go(400, 120, 500, 1).go(400, 220, 700).go(0, 220, 500, 2)


@pytest.mark.parametrize('program', [
    zigzag, arrays, procedures, styles, planes, conveyor, outputs, tools, modules,
])  # fmt: skip
def test_a_paint_program_has_the_motion_that_it_means(program, tmp_path):
    path = FOLDER / program.__name__
    paths = [path / 'door.pgf' if path.is_dir() else path.with_suffix('.mod')]
    if path.is_dir():
        without_list = shutil.ignore_patterns('*.pgf')
        paths.append(shutil.copytree(path, tmp_path / 'modules', ignore=without_list))
    wanted = sampled(program().trajectory)
    for path in paths:
        np.testing.assert_allclose(sampled(pd.read_recording(path)), wanted, rtol=0, atol=1e-8)


def sampled(motion):
    """(1000, 6) place [m], flow, and brush while it is open, over the time of a motion."""
    times = np.linspace(0.0, motion.duration_s, 1002)[1:-1] + 1e-7
    own = (motion.stamps_ns - motion.stamps_ns[0]) * 1e-9
    place = [np.interp(times, own, motion.positions_m[:, axis]) for axis in range(3)]
    now = np.searchsorted((motion.trigger_stamps_ns - motion.stamps_ns[0]) * 1e-9, times) - 1
    flow = motion.trigger_flow[now]
    return np.array([times, *place, flow, motion.trigger_brush[now] * (flow > 0.0)]).T

"""The speed that the robot drove against the programmed one, along the way that it sprayed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from paint_deposition.errors import RecordingError
from paint_deposition.motion.path import SprayPath

# A place of the programme is known by where it is and whither it leads: a turn of the heading by
# 60 degrees counts as much as this distance.
HEADING_M = 0.2
# Zones cut corners by less.
NEAR_M = 0.05
# The speed is the mean over so much way: single poses carry the noise of the encoders.
WINDOW_M = 0.02
# Slower than programmed by more is told.
TOLERANCE = 0.05
# Robots need about so much way to get up to speed.
TURN_M = 0.1
# What is shorter is the end of another pass.
SHORTEST_PASS_M = 0.05


@dataclass(frozen=True)
class PassSpeed:
    """The speed on one pass, or on all of them, means over the way sprayed.

    Attributes:
        number: of the pass, from 1; 0 stands for all.
        way_m: sprayed on the programme's way [m].
        programmed_m_per_s, driven_m_per_s: means, way over time [m/s].
        slowest_m_per_s: over 20 mm [m/s].
        slower: share of the way that is driven more than 5 % slower than programmed, 0 to 1.
        slower_at_ends: share of that within 100 mm of a turn of the path or of a change of the
            gun, NaN where nothing is slower.
        film: paint for a metre of way over that at the programmed speed; 1 is the same.
    """

    number: int
    way_m: float
    programmed_m_per_s: float
    driven_m_per_s: float
    slowest_m_per_s: float
    slower: float
    slower_at_ends: float
    film: float

    @property
    def sentence(self) -> str:
        """The figures in a line."""
        change = round(100.0 * (self.film - 1.0), 1) + 0.0  # no -0.0
        at_ends = f', {100 * self.slower_at_ends:.0f} % of that at ends' if self.slower else ''
        return (
            f'programmed {self.programmed_m_per_s:.3f} m/s, driven {self.driven_m_per_s:.3f} (at '
            f'least {self.slowest_m_per_s:.3f}) over {self.way_m:.2f} m; {100 * self.slower:.0f} '
            f'% of the way more than {100 * TOLERANCE:.0f} % slower{at_ends}; film {change:+.1f} %'
        )


@dataclass(frozen=True)
class DrivenSpeed:
    """Driven against programmed speed along the way sprayed.

    Attributes:
        way_m: (N,) way sprayed up to here, passes one after the other [m].
        driven_m_per_s: (N,) over 20 mm around here [m/s].
        programmed_m_per_s: (N,) [m/s].
        spray_pass: (N,) int, number of the pass, from 1.
        passes: figures of each. whole: of all.
        on_programme: share of the way sprayed that lies on the programme's, 0 to 1.
    """

    way_m: np.ndarray
    driven_m_per_s: np.ndarray
    programmed_m_per_s: np.ndarray
    spray_pass: np.ndarray
    passes: tuple[PassSpeed, ...]
    whole: PassSpeed
    on_programme: float

    def to_dict(self) -> dict[str, Any]:
        """The figures by name."""
        return {
            'on_programme': self.on_programme,
            **{name: value for name, value in vars(self.whole).items() if name != 'number'},
            'passes': [vars(one) for one in self.passes],
        }


def driven_speed(driven: SprayPath, programmed: SprayPath) -> DrivenSpeed:
    """Compare a recorded motion with its programme.

    Args:
        driven: as recorded; some of it sprays.
        programmed: as programmed, in the same frame, whether it sprays or not.

    Raises:
        RecordingError: most of the way sprayed is not on the programme's.
    """
    programmed = programmed.select(programmed.speed_m_per_s > 0.0)
    where = np.flatnonzero((driven.flow > 0.0) & (driven.speed_m_per_s > 0.0))
    sprayed = driven.select(where)
    _, nearest = cKDTree(_places(programmed)).query(_places(sprayed))
    away_m = np.linalg.norm(sprayed.position_m - programmed.position_m[nearest], axis=1)
    step_m = sprayed.dwell_s * sprayed.speed_m_per_s
    near = away_m < NEAR_M
    on_programme = float(step_m[near].sum() / step_m.sum())
    if on_programme < 0.5:
        raise RecordingError(
            f'only {100 * on_programme:.0f} % of the way sprayed lies within '
            f'{1e3 * NEAR_M:.0f} mm of the programme: are both of the same part, and in the same '
            'frame? see --part-pose'
        )
    rows = [
        found
        for number in np.unique(sprayed.spray_pass)
        if step_m[found := np.flatnonzero((sprayed.spray_pass == number) & near)].sum()
        >= SHORTEST_PASS_M
    ]
    speed = programmed.speed_m_per_s[nearest]
    smooth = np.concatenate(
        [
            _over_window(step_m[stretch], sprayed.dwell_s[stretch])
            for found in rows
            for stretch in np.split(found, 1 + np.flatnonzero(np.diff(where[found]) > 1))
        ]
    )
    kept = np.concatenate(rows)
    owner = np.repeat(np.arange(1, len(rows) + 1), [len(found) for found in rows])
    ends = _at_ends(sprayed)[kept]
    columns = (step_m[kept], sprayed.dwell_s[kept], speed[kept], smooth, ends)
    passes = tuple(
        _figures(number, *(column[owner == number] for column in columns))
        for number in range(1, len(rows) + 1)
    )
    way_m = np.cumsum(step_m[kept]) - 0.5 * step_m[kept]
    whole = _figures(0, *columns)
    return DrivenSpeed(way_m, smooth, speed[kept], owner, passes, whole, on_programme)


def _places(path: SprayPath) -> np.ndarray:
    """(N, 6) places and headings, in metres."""
    headings = path.velocity_m_per_s / path.speed_m_per_s[:, None]
    return np.hstack([path.position_m, HEADING_M * headings])


def _over_window(step_m: np.ndarray, dwell_s: np.ndarray) -> np.ndarray:
    """(N,) way over time around each sub-step [m/s]."""
    way_m, time_s = (np.concatenate([[0.0], np.cumsum(column)]) for column in (step_m, dwell_s))
    middle_m = 0.5 * (way_m[1:] + way_m[:-1])
    begin_m = np.maximum(middle_m - 0.5 * WINDOW_M, 0.0)
    end_m = np.minimum(middle_m + 0.5 * WINDOW_M, way_m[-1])
    return (end_m - begin_m) / (
        np.interp(end_m, way_m, time_s) - np.interp(begin_m, way_m, time_s)
    )


def _at_ends(path: SprayPath) -> np.ndarray:
    """(N,) bool, within 100 mm of a turn or of where the gun is switched."""
    switch_s = np.minimum(path.since_on_s, path.until_off_s)
    to_end_m = np.minimum(path.from_turn_m, path.to_turn_m)
    return np.minimum(to_end_m, switch_s * path.speed_m_per_s) < TURN_M


def _figures(
    number: int, step_m: np.ndarray, dwell_s: np.ndarray, programmed: np.ndarray,
    driven: np.ndarray, ends: np.ndarray,
) -> PassSpeed:  # fmt: skip
    way_m = float(step_m.sum())
    slower = driven < (1.0 - TOLERANCE) * programmed
    slow_m = float(step_m[slower].sum())
    time_s, planned_s = float(dwell_s.sum()), float(np.sum(step_m / programmed))
    return PassSpeed(
        number=number,
        way_m=way_m,
        programmed_m_per_s=way_m / planned_s,
        driven_m_per_s=way_m / time_s,
        slowest_m_per_s=float(driven.min()),
        slower=slow_m / way_m,
        slower_at_ends=float(step_m[slower & ends].sum()) / slow_m if slow_m else float('nan'),
        film=time_s / planned_s,
    )

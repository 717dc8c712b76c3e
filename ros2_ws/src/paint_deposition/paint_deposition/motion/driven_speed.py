"""The speed that the robot drove against the programmed one, along the way that it sprayed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from paint_deposition.errors import RecordingError
from paint_deposition.motion.path import SprayPath

# Places of the programme differ by where they are and by their heading: a turn of it by 60 degrees
# counts as much as this distance.
HEADING_M = 0.2
# Zones cut corners by less.
NEAR_M = 0.05
# The speed is the mean over so much way: single poses carry the noise of the encoders.
WINDOW_M = 0.02
# Slower than programmed by more is reported.
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
        whole = {name: value for name, value in vars(self.whole).items() if name != 'number'}
        passes = [vars(one) for one in self.passes]
        return {'on_programme': self.on_programme, **whole, 'passes': passes}


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
    step_m, near = sprayed.dwell_s * sprayed.speed_m_per_s, away_m < NEAR_M
    on_programme = float(step_m[near].sum() / step_m.sum())
    if on_programme < 0.5:
        raise RecordingError(
            f'only {100 * on_programme:.0f} % of the way sprayed lies within '
            f'{1e3 * NEAR_M:.0f} mm of the programme: are both of the same part, and in the same '
            'frame? see --part-pose'
        )
    numbers = np.unique(sprayed.spray_pass)
    on_passes = [np.flatnonzero((sprayed.spray_pass == number) & near) for number in numbers]
    on_passes = [rows for rows in on_passes if step_m[rows].sum() >= SHORTEST_PASS_M]
    smooth = np.concatenate([
        _over_window(step_m[stretch], sprayed.dwell_s[stretch])
        for rows in on_passes
        for stretch in np.split(rows, 1 + np.flatnonzero(np.diff(where[rows]) > 1))
    ])  # fmt: skip
    kept = np.concatenate(on_passes)
    owner = np.repeat(np.arange(1, len(on_passes) + 1), [len(rows) for rows in on_passes])
    speed = programmed.speed_m_per_s[nearest][kept]
    columns = (step_m[kept], sprayed.dwell_s[kept], speed, smooth, _at_ends(sprayed)[kept])
    passes = tuple(
        _figures(number, *(column[owner == number] for column in columns))
        for number in range(1, len(on_passes) + 1)
    )
    way_m = np.cumsum(step_m[kept]) - 0.5 * step_m[kept]
    return DrivenSpeed(way_m, smooth, speed, owner, passes, _figures(0, *columns), on_programme)


def _places(path: SprayPath) -> np.ndarray:
    """(N, 6) places and headings, in metres."""
    headings = path.velocity_m_per_s / path.speed_m_per_s[:, None]
    return np.hstack([path.position_m, HEADING_M * headings])


def _over_window(step_m: np.ndarray, dwell_s: np.ndarray) -> np.ndarray:
    """(N,) way over time around each sub-step [m/s]."""
    way_m, time_s = (np.concatenate([[0.0], np.cumsum(column)]) for column in (step_m, dwell_s))
    middle_m = 0.5 * (way_m[1:] + way_m[:-1])
    ends_m = np.clip(middle_m + 0.5 * WINDOW_M * np.array([[-1.0], [1.0]]), 0.0, way_m[-1])
    return np.diff(ends_m, axis=0)[0] / np.diff(np.interp(ends_m, way_m, time_s), axis=0)[0]


def _at_ends(path: SprayPath) -> np.ndarray:
    """(N,) bool, within 100 mm of a turn or of where the gun is switched."""
    switch_s = np.minimum(path.since_on_s, path.until_off_s)
    to_end_m = np.minimum(path.from_turn_m, path.to_turn_m)
    return np.minimum(to_end_m, switch_s * path.speed_m_per_s) < TURN_M


def _figures(
    number: int, step_m: np.ndarray, dwell_s: np.ndarray, programmed: np.ndarray,
    driven: np.ndarray, ends: np.ndarray,
) -> PassSpeed:  # fmt: skip
    way_m, time_s, planned_s = step_m.sum(), dwell_s.sum(), np.sum(step_m / programmed)
    slower = driven < (1.0 - TOLERANCE) * programmed
    slow_m = step_m[slower].sum()
    at_ends = step_m[slower & ends].sum() / slow_m if slow_m else np.nan
    figures = (way_m, way_m / planned_s, way_m / time_s, driven.min(), slow_m / way_m, at_ends,
               time_s / planned_s)  # fmt: skip
    return PassSpeed(number, *map(float, figures))

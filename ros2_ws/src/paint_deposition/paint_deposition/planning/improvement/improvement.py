"""The result of `improve`: a programme timed anew, with its film before and after."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.motion.path import SprayPath
from paint_deposition.motion.path_builder import spray_path
from paint_deposition.motion.programmed import Move
from paint_deposition.motion.trajectory import Trajectory
from paint_deposition.part.surface import Surface
from paint_deposition.planning.improvement.changes import PassChange, changes
from paint_deposition.planning.improvement.improve import Retiming
from paint_deposition.planning.improvement.limits import Limits, Wish
from paint_deposition.planning.trade_off import Point

DEFAULT_TOLERANCE = 0.1
# Bag and robot program lay the same film to this share of the peak.
ALIKE = 2e-3


@dataclass(frozen=True)
class LaidFilm:
    """A film on the judged part, and what it took.

    Attributes:
        film_um: (V,) at the vertices of the surface.
        mean_um, sigma_n: mean, and standard deviation over it, weighted by area.
        min_um, max_um: least and greatest.
        within: share of the judged area within the tolerance of the target.
        paint_cm3: sprayed, as solids that a part which catches everything would get.
        on_part_cm3: of it on the whole part.
        spraying_s, cycle_s: time with the gun open, and from the first pose to the last.
    """

    film_um: np.ndarray
    mean_um: float
    sigma_n: float
    min_um: float
    max_um: float
    within: float
    paint_cm3: float
    on_part_cm3: float
    spraying_s: float
    cycle_s: float

    @staticmethod
    def of(
        film_um: np.ndarray,
        surface: Surface,
        judged: np.ndarray,
        band_um: tuple[float, float],
        emitted_cm3: float,
        path: SprayPath,
        cycle_s: float,
    ) -> 'LaidFilm':
        """Sum a film up; ``judged`` (V,) bool, ``band_um`` its least and greatest good film."""
        film, area = film_um[judged], surface.vertex_areas_m2[judged]
        weight = area / area.sum()
        mean = float(weight @ film)
        sigma = math.sqrt(float(weight @ (film - mean) ** 2)) / mean if mean > 0.0 else math.nan
        good = (film >= band_um[0]) & (film <= band_um[1])
        return LaidFilm(
            film_um, mean, sigma, float(film.min()), float(film.max()),
            float(weight[good].sum()), emitted_cm3,
            float(surface.vertex_areas_m2 @ film_um),
            float(path.dwell_s[path.flow > 0.0].sum()), cycle_s,
        )  # fmt: skip

    def figures(self) -> dict[str, float]:
        """All but the film itself by name."""
        return {name: value for name, value in vars(self).items() if name != 'film_um'}


@dataclass(frozen=True)
class Improvement:
    """A programme timed anew for a more even film.

    Attributes:
        surface: the part. judged: (V,) bool, the side whose film counts.
        model: what the gun sprays. limits, wish: as asked for.
        given: the motion as it was; trajectory: the improved one as its bag was read back.
        moves: the improved one as moves of a robot program.
        retiming: how it was found.
        before, after: films of both motions.
        program_difference: largest difference between the films of the robot program and of the
            bag, both read back, as a share of the greatest film.
        sigma_n_interval: 5 and 95 % quantiles of sigma_n before and after over models that the
            search did not see; None without an uncertain model.
        odd: what is odd in how the gun runs over the part, with its likely cause.
    """

    surface: Surface
    judged: np.ndarray
    model: DepositionModel
    limits: Limits
    wish: Wish
    given: Trajectory
    trajectory: Trajectory
    moves: Sequence[Move]
    retiming: Retiming
    before: LaidFilm
    after: LaidFilm
    program_difference: float
    sigma_n_interval: tuple[tuple[float, float], tuple[float, float]] | None = None
    odd: tuple[str, ...] = ()

    @property
    def target_um(self) -> float:
        """Mean film aimed at [um]."""
        return self.retiming.target_um

    @property
    def tolerance(self) -> float:
        """Relative difference from the target that counts as good."""
        return self.wish.tolerance or DEFAULT_TOLERANCE

    @cached_property
    def changes(self) -> tuple[PassChange, ...]:
        """What changes, pass by pass."""
        return changes(self.retiming.given, self.retiming.programme)

    @cached_property
    def paths(self) -> tuple[SprayPath, SprayPath]:
        """Both motions cut into sub-steps."""
        return spray_path(self.given)[0], spray_path(self.trajectory)[0]

    @property
    def warnings(self) -> tuple[str, ...]:
        """What may be wrong, a line each with its likely cause."""
        if self.program_difference <= ALIKE:
            return self.odd
        return (
            *self.odd,
            f'the film of the robot program differs from that of the bag by '
            f'{100 * self.program_difference:.2f} % of the peak: its moves are long against the '
            'changes of speed; allow shorter ones (move_min_m, settings_per_s) or more smoothness',
        )

    @property
    def sentence(self) -> str:
        """The improvement in a sentence."""
        a, b = self.before, self.after
        return (
            f'sigma_n {100 * a.sigma_n:.1f} to {100 * b.sigma_n:.1f} %, within '
            f'±{100 * self.tolerance:g} % of {self.target_um:.1f} µm {100 * a.within:.0f} to '
            f'{100 * b.within:.0f} % of the area, paint {a.paint_cm3:.1f} to {b.paint_cm3:.1f} '
            f'cm3, {a.cycle_s:.1f} to {b.cycle_s:.1f} s'
        )

    @property
    def points(self) -> tuple[Point, Point]:
        """The programme as given and as improved, in a trade-off."""
        passes = len(self.changes)
        before, after = (
            Point(
                self.wish.paint_weight, laid.sigma_n, laid.mean_um, laid.paint_cm3, laid.cycle_s,
                passes,
            )
            for laid in (self.before, self.after)
        )  # fmt: skip
        return before, after

    @property
    def limit_sentences(self) -> tuple[str, ...]:
        """Which limits hold the film back, a line each."""
        after = self.after.sigma_n
        found = [
            f'held back by {held.name}: sigma_n {100 * held.sigma_n:.1f} % without it'
            for held in self.retiming.held_back
        ]
        path = min(self.retiming.sigma_n_of_path, after)
        found.append(
            f'no speeds at all along this path come below sigma_n {100 * path:.1f} %: '
            'beyond that other passes are needed'
        )
        return tuple(found)

    def __repr__(self) -> str:
        return f'Improvement({self.sentence})'

    def to_dict(self) -> dict[str, Any]:
        """Figures, under the names of ``improvement.json``."""
        both = {
            name: {'before': value, 'after': self.after.figures()[name]}
            for name, value in self.before.figures().items()
        }
        interval = self.sigma_n_interval
        return {
            **both,
            'target_um': self.target_um,
            'tolerance': self.tolerance,
            'judged_area_m2': float(self.surface.vertex_areas_m2[self.judged].sum()),
            'area_m2': self.surface.area_m2,
            'sigma_n_interval': interval and {'before': interval[0], 'after': interval[1]},
            'sigma_n_of_path': min(self.retiming.sigma_n_of_path, self.after.sigma_n),
            'held_back': [asdict(held) for held in self.retiming.held_back],
            'program_difference': self.program_difference,
            'passes': [change.to_dict() for change in self.changes],
            'limits': asdict(self.limits),
            'wish': asdict(self.wish),
            'sentence': self.sentence,
            'warnings': list(self.warnings),
        }

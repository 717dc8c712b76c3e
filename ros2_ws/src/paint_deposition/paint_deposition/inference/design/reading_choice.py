"""Where to put the gauge on a painted part, so that missing effects are found soonest.

Readings are linear in the pattern's parameters and in the amplitudes of the effects. What an
effect changes at the chosen places beyond what the pattern can imitate is its noncentrality (D_s-
optimality: Atkinson and Donev, Optimum Experimental Designs, 1992). Places are added one by one,
each where it raises the probability most that an effect is detected, averaged over the effects
and over the sizes in which they occur: a sum of the squares would go on improving what is seen
anyway.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import ndtr, ndtri

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import ReadingsError
from paint_deposition.film.integrator import NO_PAINT_UM
from paint_deposition.inference.design.unmeasured_part import UnmeasuredPart
from paint_deposition.inference.diagnosis.explanations import sensitivity
from paint_deposition.inference.diagnosis.model_space import SIZES
from paint_deposition.inference.diagnosis.testability import LEVEL
from paint_deposition.inference.fitting.least_squares import on_one_thread
from paint_deposition.inference.readings.gauge_noise import ASSUMED_FREEDOM, ENOUGH_REPEATS
from paint_deposition.inference.readings.places import (
    FOOT_M,
    can_stand,
    from_edges_m,
    grid_places,
    spread_places,
)
from paint_deposition.motion.path import SprayPath
from paint_deposition.part.surface import Surface

# With fewer points than this the pattern's parameters alone take up all that is read.
LEAST_POINTS, MOST_POINTS = 12, 400


@dataclass(frozen=True)
class ChosenReadings:
    """Points for the gauge on a part, in the order of a walk over it.

    Attributes:
        surface: the part. path: of the gun. model: what it sprayed, as far as known.
        film_um: (V,) film expected at the vertices of the surface [um].
        vertices: (P,) where the points are.
        expected_um: (P,) what the gauge should show there [um].
        sigma_um: (P,) standard deviation of one reading, with the film's texture [um].
        repeats: how many points are to be read twice.
        speaks_for: (P,) effects of which each point shows most.
        power: by effect, probability that the diagnosis detects it at its typical size; the
            same for as many points on a grid in ``grid_power``.
        foot_m, apart_m: distance kept from edges, and between points [m].
    """

    surface: Surface
    path: SprayPath
    model: DepositionModel
    film_um: np.ndarray
    vertices: np.ndarray
    expected_um: np.ndarray
    sigma_um: np.ndarray
    repeats: int
    speaks_for: tuple[tuple[str, ...], ...]
    power: dict[str, float]
    grid_power: dict[str, float]
    foot_m: float
    apart_m: float

    def __len__(self) -> int:
        return len(self.vertices)

    def __repr__(self) -> str:
        return f'ChosenReadings({self.sentence})'

    @property
    def names(self) -> list[str]:
        """(P,) labels of the points."""
        digits = max(2, len(str(len(self))))
        return [f'P{k:0{digits}d}' for k in range(1, len(self) + 1)]

    @property
    def positions_m(self) -> np.ndarray:
        """(P, 3) in the mesh frame [m]."""
        return self.surface.vertices_m[self.vertices]

    @property
    def normals(self) -> np.ndarray:
        """(P, 3) outward unit normals."""
        return self.surface.normals[self.vertices]

    @property
    def from_edges_m(self) -> np.ndarray:
        """(P, 2) distance from the left edge and height over the lower edge [m]."""
        return from_edges_m(self.surface, self.positions_m)

    @property
    def read_twice(self) -> np.ndarray:
        """Rows of the points that are to be read again at the end, spread over the walk."""
        return np.linspace(0, len(self) - 1, self.repeats).round().astype(int)

    @property
    def sentence(self) -> str:
        """What the points are worth, in a sentence."""
        mean, grid = (float(np.mean([*p.values()])) for p in (self.power, self.grid_power))
        return (
            f'{len(self)} points: an effect of typical size is detected with a probability of '
            f'{100 * mean:.0f} % on average, on a grid of {len(self)} with {100 * grid:.0f} %'
        )

    def to_dict(self) -> dict[str, Any]:
        """Figures, as in ``measure.json``."""
        rows = zip(
            self.names, self.positions_m.tolist(), self.normals.tolist(),
            self.from_edges_m.tolist(), self.expected_um.tolist(), self.sigma_um.tolist(),
            self.speaks_for, strict=True,
        )  # fmt: skip
        return {
            'points': [
                {
                    'point': name, **dict(zip(('x_m', 'y_m', 'z_m'), position, strict=True)),
                    'normal': normal, 'from_left_m': face[0], 'height_m': face[1],
                    'expected_um': film, 'sigma_um': sigma, 'speaks_for': list(effects),
                }
                for name, position, normal, face, film, sigma, effects in rows
            ],
            'read_twice': [self.names[k] for k in self.read_twice],
            'power': [
                {'effect': name, 'chosen': power, 'grid': self.grid_power[name]}
                for name, power in self.power.items()
            ],
            'mean_power': {
                'chosen': float(np.mean([*self.power.values()])),
                'grid': float(np.mean([*self.grid_power.values()])),
            },
            'foot_m': self.foot_m,
            'apart_m': self.apart_m,
        }  # fmt: skip


@on_one_thread
def choose(
    part: UnmeasuredPart,
    count: int,
    repeats: int = 8,
    foot_m: float = FOOT_M,
    seed: int = 0,
    progress: Callable[[str], None] = lambda line: None,
) -> ChosenReadings:
    """Choose points for the gauge.

    Args:
        count: of points. repeats: of these to be read twice, for the noise of the gauge.
        foot_m: of the gauge, from its middle to its rim; the distance kept from edges [m].

    Raises:
        ReadingsError: the part has no room for so many points.
    """
    if not LEAST_POINTS <= count <= MOST_POINTS:
        raise ReadingsError(f'{count} points; ask for {LEAST_POINTS} to {MOST_POINTS}')
    if not 0 <= repeats <= count:
        raise ReadingsError(f'{repeats} of {count} points to be read twice; ask for 0 to {count}')
    progress('the film')
    surface = part.surface
    film_um = part.film_um
    if film_um.max() < NO_PAINT_UM:
        raise ReadingsError('no paint lands on the part; check the trajectory and --part-pose')
    usable = usable_places(surface, film_um, foot_m)
    # The points are chosen from so many places at least.
    places = spread_places(surface, usable, max(700, 4 * count), seed)
    if len(places) < count:
        raise _no_room(len(places), count, foot_m)
    # Least distance between points, as a share of the side of the square that each stands for.
    apart_m = 0.5 * float(np.sqrt(surface.vertex_areas_m2[usable].sum() / count))
    progress('what the effects change')
    design = design_at(part, places)
    progress('choosing points')
    rows = design.best(surface.vertices_m[places], count, apart_m)
    if len(rows) < count:
        raise _no_room(len(rows), count, foot_m)
    face = from_edges_m(surface, surface.vertices_m[places[rows]])
    # The walk goes in rows from the top, to and fro.
    row = ((face[:, 1].max() - face[:, 1]) / max(2.0 * apart_m, 1e-9)).astype(int)
    rows = rows[np.lexsort((np.where(row % 2 == 0, face[:, 0], -face[:, 0]), row))]
    speaks_for = design.speaks_for(rows)
    progress('how surely effects would be found')
    freedom = float(repeats) if repeats >= ENOUGH_REPEATS else ASSUMED_FREEDOM
    study = part.study(places[rows])
    grid = grid_places(surface, usable, count)
    found, on_grid = (part.power(at, freedom, seed) for at in (places[rows], grid))
    return ChosenReadings(
        surface, part.path, part.model, film_um, places[rows], study.measured_um,
        study.sigma_um, repeats,
        speaks_for, found, on_grid, foot_m, apart_m,
    )  # fmt: skip


def _no_room(found: int, count: int, foot_m: float) -> ReadingsError:
    return ReadingsError(
        f'there is room for {found} of {count} points, {foot_m * 1e3:g} mm off edges and on '
        'painted surface that is not strongly curved; ask for fewer, or give a smaller --foot-m'
    )


def usable_places(surface: Surface, film_um: np.ndarray, foot_m: float = FOOT_M) -> np.ndarray:
    """(V,) bool, vertices that are painted and where the gauge can stand."""
    # The mean over the paint, not over the part: a bare side does not count.
    volume = surface.vertex_areas_m2 * film_um
    # Less than this share of the mean is hardly painted.
    return can_stand(surface, foot_m) & (film_um > 0.2 * (volume @ film_um) / volume.sum())


@dataclass(frozen=True)
class CandidateDesign:
    """What readings at C places would show, over their noise."""

    # (C, k) change with each parameter of the model, in standard deviations of its prior.
    free: np.ndarray
    columns: np.ndarray  # (C, m) change with each amplitude of the effects at its typical size
    effects: np.ndarray  # (m,) id of the effect of each column

    def beyond_model(self, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What the model cannot imitate when it is refitted to readings at chosen places (n,).

        Returns:
            (C, m) of each column at every place; (C,) variance of what it predicts there, over
            that of the noise; (m,) noncentrality of each column at the chosen places.
        """
        free, columns = self.free[chosen], self.columns[chosen]
        covariance = np.linalg.inv(np.eye(free.shape[1]) + free.T @ free)
        products = free.T @ columns
        slopes = covariance @ products
        variance = np.einsum('ck,kl,cl->c', self.free, covariance, self.free)
        seen = np.maximum(np.sum(columns**2, axis=0) - np.sum(products * slopes, axis=0), 0.0)
        return self.columns - self.free @ slopes, variance, seen

    def gains(self, chosen: np.ndarray) -> np.ndarray:
        """(C,) by about how much one more reading at each place raises the mean probability."""
        names, owner, count = np.unique(self.effects, return_inverse=True, return_counts=True)
        left, variance, seen = self.beyond_model(chosen)
        step = 1e-3 * (1e-3 + seen)
        slope = (power(seen + step, len(names)) - power(seen, len(names))) / step
        return left**2 @ (slope / (len(names) * count[owner])) / (1.0 + variance)

    def best(self, positions_m: np.ndarray, count: int, apart_m: float) -> np.ndarray:
        """(n,) rows of the places that are taken one by one; fewer only where no more fit.

        Args:
            positions_m: (C, 3) of the places [m].
            count: how many are wanted.
            apart_m: least distance between two of them [m].
        """
        chosen: list[int] = []
        usable = np.ones(len(positions_m), dtype=bool)
        while len(chosen) < count and usable.any():
            gains = self.gains(np.array(chosen, dtype=int))
            best = int(np.argmax(np.where(usable, gains, -1.0)))
            chosen.append(best)
            usable &= np.linalg.norm(positions_m - positions_m[best], axis=1) >= apart_m
        return np.array(chosen, dtype=int)

    def speaks_for(self, chosen: np.ndarray) -> tuple[tuple[str, ...], ...]:
        """(n,) effects of which each chosen place shows most."""
        left, variance, seen = self.beyond_model(chosen)
        # Share of the noncentrality that would be lost without each place; what the places
        # together do not show, none of them speaks for.
        lost = left[chosen] ** 2 / (1.0 - variance[chosen, np.newaxis])
        shares = np.where(seen > 1.0, lost / np.maximum(seen, 1e-12), 0.0)
        names = np.array(sorted(set(self.effects)))
        by_effect = np.column_stack([shares[:, self.effects == n].mean(axis=1) for n in names])
        even = by_effect.mean(axis=0)
        over = by_effect / np.where(even > 0.0, even, np.inf)
        # A place speaks for an effect if it carries this many times its even share of what is
        # seen of it, for as many effects at the most.
        return tuple(
            tuple(str(names[k]) for k in np.argsort(-one)[:3] if one[k] > 1.5) for one in over
        )


def power(noncentrality: np.ndarray, tests: int) -> np.ndarray:
    """(m,) probability of detection, averaged over the sizes in which effects occur.

    Args:
        noncentrality: (m,) of effects of typical size.
        tests: how many effects share the level of the test.
    """
    limit = -ndtri(0.5 * LEVEL / tests)
    ratio = SIZES * np.sqrt(noncentrality)[:, np.newaxis]
    return np.mean(ndtr(ratio - limit) + ndtr(-ratio - limit), axis=1)


def design_at(part: UnmeasuredPart, vertices: np.ndarray) -> CandidateDesign:
    """What readings at these vertices (C,) would show."""
    study = part.study(vertices)
    fit = part.fit(study)
    every = [shape for shapes in part.candidates.values() for shape in shapes]
    return CandidateDesign(
        fit.jacobian @ fit.parameters.prior.factor,
        np.hstack([sensitivity(study.forward, fit, one, study.sigma_um) for one in every]),
        np.array([one.id for one in every for _ in one.amplitudes()]),
    )

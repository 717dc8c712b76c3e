"""What a diagnosis proposes to do next: places to measure, and sprays.

Among the sprays is one with the gun held still before one place of a part, which shows the
footprint by itself, as no pass does.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.film.common_film import ONE_FILM
from paint_deposition.inference.readings.campaign import Experiment
from paint_deposition.motion.path_builder import spray_path
from paint_deposition.motion.trajectory import Trajectory

KEY = 'standing'
# The gun stands closed for so long before and behind, and its pose is recorded so often [s].
CLOSED_S, CYCLE_S = 0.6, 0.02
# Effects of the order of passes, and fog of a whole job, say nothing of a single spot.
OF_WHOLE_JOBS = ('order', 'level')


@dataclass(frozen=True)
class StationarySpray:
    """A gun that sprays on one spot, square to the part."""

    position_m: np.ndarray  # (3,) of the spot
    normal: np.ndarray  # (3,) of the part there, outward
    across: np.ndarray  # (3,) unit vector of the tool's x axis
    standoff_m: float  # of the TCP
    dwell_s: float  # for which the gun is open
    flow: float  # relative to calibrated
    film_um: float  # measured there now
    peak_um: float  # thickest film to expect
    brush: int  # number of the brush, that which sprayed the part longest

    @staticmethod
    def before(
        experiment: Experiment, row: int, model: DepositionModel, most_um: float
    ) -> 'StationarySpray | None':
        """Before a measured point, with roll, standoff and flow of the passes over the part.

        Args:
            model: its pattern and projection give the film on a flat spot, which is the least
                favourable one: elsewhere the paint lands on more surface.
            most_um: film that must not be exceeded [um].

        Returns:
            None where the gun would have to close sooner than its trigger can, or has to wait.
        """
        path, points = experiment.path, experiment.measured_points
        spraying = path.flow > 0.0
        normal = points.normals[row] / np.linalg.norm(points.normals[row])
        away, _ = cKDTree(experiment.surface.vertices_m).query(path.position_m[spraying])
        standoff, flow = float(np.median(away)), float(np.median(path.flow[spraying]))
        across = path.rotation[spraying, :, 0].mean(axis=0)
        across -= (across @ normal) * normal
        if np.linalg.norm(across) < 1e-3:
            return None
        projection = model.projection
        away_m = standoff + projection.emission_offset_m
        numbers = np.unique(path.brush[spraying])
        times_s = [path.dwell_s[spraying & (path.brush == number)].sum() for number in numbers]
        brush = int(numbers[np.argmax(times_s)])
        peak = model.painting_with(brush).planar.peak_flux_um_per_s
        rate = flow * peak * (projection.model_plane_m / away_m) ** 2
        step_s = 0.1
        dwell = step_s * math.floor(most_um / rate / step_s + 1e-9)
        # A shorter opening of the gun is mostly its trigger's; a longer one no spot needs [s].
        if not 0.5 <= dwell <= 20.0:
            return None
        return StationarySpray(
            points.positions_m[row], normal, across / np.linalg.norm(across), standoff, dwell,
            flow, float(experiment.readings.mean_um[row]), rate * dwell, brush,
        )  # fmt: skip

    def sprayed(self, experiment: Experiment) -> Experiment:
        """The part painted that way only."""
        count = round((2.0 * CLOSED_S + self.dwell_s) / CYCLE_S) + 1
        stamps_ns = np.round(1e9 * CYCLE_S * np.arange(count)).astype(np.int64)
        axes = np.column_stack([self.across, np.cross(-self.normal, self.across), -self.normal])
        motion = Trajectory(
            stamps_ns,
            np.tile(self.position_m + self.standoff_m * self.normal, (count, 1)),
            np.tile(Rotation.from_matrix(axes).as_quat(), (count, 1)),
            trigger_stamps_ns=np.array(
                [round(1e9 * CLOSED_S), round(1e9 * (CLOSED_S + self.dwell_s))], dtype=np.int64
            ),
            trigger_flow=np.array([self.flow, 0.0]),
            trigger_brush=np.full(2, self.brush),
        )
        path, _ = spray_path(motion)
        return replace(experiment, path=path, films=ONE_FILM)

    @property
    def words(self) -> str:
        """The spray, and the film there now and then."""
        place = ', '.join(f'{value:.3f}' for value in self.position_m)
        return (
            f'one spot for {self.dwell_s:.1f} s with the gun still, square to the part, its TCP '
            f'{1e3 * self.standoff_m:.0f} mm from ({place}) m; film there now '
            f'{self.film_um:.0f} µm, peak afterwards {self.peak_um:.0f} µm'
        )

    def to_dict(self) -> dict[str, Any]:
        """The entry ``stand`` of a spray in ``diagnosis.json``."""
        place = dict(zip(('x_m', 'y_m', 'z_m'), self.position_m.tolist(), strict=True))
        normal = dict(zip(('nx', 'ny', 'nz'), self.normal.tolist(), strict=True))
        return {
            **place, **normal, 'standoff_m': self.standoff_m, 'dwell_s': self.dwell_s,
            'film_um': self.film_um, 'peak_um': self.peak_um,
        }  # fmt: skip


def spots(experiment: Experiment, count: int) -> list[int]:
    """Measured points to stand before: the middlemost, and others as far apart as they can be."""
    positions = experiment.measured_points.positions_m
    chosen = [int(np.argmin(np.linalg.norm(positions - positions.mean(axis=0), axis=1)))]
    while len(chosen) < min(count, len(positions)):
        away = np.linalg.norm(positions[:, np.newaxis] - positions[chosen], axis=2)
        chosen.append(int(np.argmax(away.min(axis=1))))
    return chosen


def suits(model: DepositionModel, families: set[str]) -> bool:
    """Whether a spot separates competing effects, by their families, beside a model."""
    return families.isdisjoint(OF_WHOLE_JOBS) and not any(
        effect.family in OF_WHOLE_JOBS for effect in model.effects
    )


@dataclass(frozen=True)
class Place:
    """A point to measure: position (3,) [m], the film predicted there [um], and why."""

    position_m: np.ndarray
    experiment: str
    why: str
    film_um: float = float('nan')

    def to_dict(self) -> dict[str, Any]:
        """An entry of ``next.measure`` in ``diagnosis.json``."""
        position = dict(zip(('x_m', 'y_m', 'z_m'), self.position_m.tolist(), strict=True))
        film = {'film_um': self.film_um} if np.isfinite(self.film_um) else {}
        return {'experiment': self.experiment, **position, **film, 'why': self.why}


@dataclass(frozen=True)
class Spray:
    """A proposed experiment."""

    what: str  # in words; names the part where there are several
    separates: tuple[str, ...]  # the explanations that it is to separate, effect ids or 'unknown'
    separation: float  # standard deviations from the leading effect to its nearest rival with it
    now: float  # the same without it
    readings: int = 0  # number of points to be measured on the new part
    experiment: str = ''  # the part that is painted anew
    changes: tuple[str, ...] = ()  # what is done otherwise, by key
    # Probability that the true effect is left alone, averaged over which it probably is.
    chance: float = float('nan')
    peak_um: float = float('nan')  # thickest film at these points
    peak_now_um: float = float('nan')  # as measured on that part
    stand: StationarySpray | None = None  # where the gun stands still, if it does
    cost: float = 0.0  # of what is done otherwise: 1 for an entry in the programme

    @property
    def worth(self) -> float:
        """The chance, less for what it costs."""
        # To spray on one spot costs one unit more, and so does a film that may sag.
        cost = self.cost + (self.stand is not None) + bool(self.film_words)
        # One unit of cost is worth this share of the chance of settling.
        return self.chance * (1.0 - 0.05 * cost)

    @property
    def film_words(self) -> str:
        """A remark on a film that is much thicker than those measured; else nothing."""
        # A film so many times as thick as any that was measured may sag.
        if not self.peak_um > 1.3 * self.peak_now_um:
            return ''
        return (
            f'the film will reach {self.peak_um:.0f} µm, now {self.peak_now_um:.0f}: see that it '
            'does not sag'
        )

    def to_dict(self) -> dict[str, Any]:
        """An entry of ``next.spray`` in ``diagnosis.json``."""
        return {
            'what': self.what,
            'separates': list(self.separates),
            'separation_sigma': self.separation,
            'separation_now_sigma': self.now,
            'chance': self.chance,
            'readings': self.readings,
            'experiment': self.experiment,
            'changes': list(self.changes),
            'peak_um': self.peak_um,
            'stand': self.stand and self.stand.to_dict(),
        }

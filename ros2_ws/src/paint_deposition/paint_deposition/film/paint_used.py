"""Paint that was sprayed, and what of its solids arrived."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.film.statistics import FilmStatistics
from paint_deposition.model.eq1_pattern import Brush
from paint_deposition.motion.path import SprayPath
from paint_deposition.motion.trajectory import ONLY_BRUSH


@dataclass(frozen=True)
class PaintUsed:
    """What left the gun; NaN where it is not known of a brush that sprayed."""

    # Time sprayed by number of the brush, weighted by the flow.
    spraying_s: Mapping[int, float] = field(default_factory=dict)
    emitted_cm3: float = 0.0  # solids that a part which catches everything would get
    # Paint as it is sprayed.
    wet_cm3: float = 0.0
    mass_g: float = 0.0
    solids_cm3: float = 0.0  # solids in it
    emitted_wet_cm3: float = 0.0  # the same paint as `emitted_cm3`, before anything evaporates

    @staticmethod
    def of(model: DepositionModel, path: SprayPath) -> 'PaintUsed':
        """Along a path that the effects on it have been applied to."""
        seconds = seconds_by_pattern(model, path).tolist()
        K1 = np.array([planar.K1_cm3_per_s for planar in model.patterns])
        numbers = [brush.number for brush in model.brushes] or [ONLY_BRUSH]

        def total(rate: Callable[[Brush], float]) -> float:
            """A rate [1/s] summed over the time sprayed."""
            if not model.brushes:
                return 0.0 if not sum(seconds) else math.nan
            sprayed = zip(model.brushes, seconds, strict=True)
            return sum(rate(brush) * time_s for brush, time_s in sprayed if time_s)

        return PaintUsed(
            {number: time_s for number, time_s in zip(numbers, seconds, strict=True) if time_s},
            float(K1 @ seconds),
            total(_flow_cm3_per_s),
            total(lambda brush: _flow_cm3_per_s(brush) * _known(brush.density_g_per_cm3)),
            total(lambda brush: _flow_cm3_per_s(brush) * _known(brush.solids)),
            total(lambda brush: brush.planar.K1_cm3_per_s / _known(brush.solids)),
        )

    def __add__(self, other: 'PaintUsed') -> 'PaintUsed':
        numbers = sorted({*self.spraying_s, *other.spraying_s})
        _, *amounts = vars(self).items()
        return PaintUsed(
            {n: self.spraying_s.get(n, 0.0) + other.spraying_s.get(n, 0.0) for n in numbers},
            *(amount + vars(other)[name] for name, amount in amounts),
        )

    @property
    def solids(self) -> float:
        """Share of solids in the volume of the film while it is wet."""
        return self.emitted_cm3 / self.emitted_wet_cm3 if self.emitted_wet_cm3 else math.nan

    def transfer_efficiency(self, on_part_cm3: float) -> float:
        """Solids on the part [cm3] over solids sprayed."""
        return on_part_cm3 / self.solids_cm3 if self.solids_cm3 else math.nan

    def figures(self, mean_um: float, on_part_cm3: float) -> dict[str, Any]:
        """By name, for a mean dry film [um] and the solids on the part; None is not known."""
        known = {
            'wet_cm3': self.wet_cm3,
            'mass_g': self.mass_g,
            'solids_cm3': self.solids_cm3,
            'transfer_efficiency': self.transfer_efficiency(on_part_cm3),
            'mean_wet_film_um': mean_um / self.solids if self.solids else math.nan,
        }
        return {k: None if math.isnan(v) else v for k, v in known.items()} | {
            'spraying_time_s_by_brush': {str(n): time_s for n, time_s in self.spraying_s.items()}
        }


NO_PAINT = PaintUsed()


class Painted(Protocol):
    """What has a film's statistics, the paint that it took and the model behind it."""

    @property
    def statistics(self) -> FilmStatistics: ...
    @property
    def paint(self) -> PaintUsed: ...
    @property
    def model(self) -> DepositionModel: ...


def paint_figures(result: Painted) -> dict[str, Any] | None:
    """Paint, transfer efficiency and wet film of a result; None where the model has no brushes."""
    film = result.statistics
    if not result.model.brushes:
        return None
    return result.paint.figures(film.mean_um, film.painted_volume_cm3)


def paint_sentence(result: Painted) -> str:
    """The paint used in a line, '' where nothing of it is known."""
    paint, film = result.paint, result.statistics
    said = []
    if not math.isnan(paint.wet_cm3):
        mass = '' if math.isnan(paint.mass_g) else f' ({paint.mass_g:.1f} g)'
        said.append(f'{paint.wet_cm3:.1f} cm3{mass} of paint sprayed')
    share = paint.transfer_efficiency(film.painted_volume_cm3)
    if not math.isnan(share):
        said.append(f'transfer efficiency {100 * share:.0f} %')
    if not math.isnan(paint.solids):
        said.append(f'mean wet film {film.mean_um / paint.solids:.1f} µm')
    return ', '.join(said)


def seconds_by_pattern(model: DepositionModel, path: SprayPath) -> np.ndarray:
    """(B,) time sprayed with each of the model's patterns, weighted by the flow [s]."""
    on = path.flow > 0.0
    rows, sprayed_s = model.pattern_rows(path.brush[on]), (path.dwell_s * path.flow)[on]
    return np.array([np.sum(sprayed_s[rows == row]) for row in range(len(model.patterns))])


def impossible_brushes(model: DepositionModel) -> tuple[str, ...]:
    """A line for each brush that lays more solids than it sprays."""
    found = []
    for brush in model.brushes:
        share = efficiency(brush)
        if share > 1.0:
            found.append(
                f'brush {brush.number} would lay {share:.2f} times the solids that it sprays: '
                'check its flow_cm3_per_min and solids, and the gauge'
            )
    return tuple(found)


def efficiency(brush: Brush) -> float:
    """Transfer efficiency on a part that catches everything; NaN is not known."""
    return brush.planar.K1_cm3_per_s / (_flow_cm3_per_s(brush) * _known(brush.solids))


def _flow_cm3_per_s(brush: Brush) -> float:
    return _known(brush.flow_cm3_per_min) / 60.0


def _known(value: float | None) -> float:
    return math.nan if value is None else value

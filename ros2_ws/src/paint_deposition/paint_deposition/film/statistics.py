"""A film in figures, weighted by surface area, and the paint that it took."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import PaintError
from paint_deposition.model.eq1_pattern import Brush
from paint_deposition.motion.path import SprayPath
from paint_deposition.motion.trajectory import ONLY_BRUSH
from paint_deposition.part.zones import Zones

# Thinner film counts as bare metal: overspray dust that no gauge shows.
DEFAULT_PAINTED_ABOVE_UM = 1.0
CPK_MEANS = (
    'Cpk: distance of the mean film from the nearer limit over three standard deviations, both '
    'weighted by the painted area of this part.'
)


# The attributes of ``FilmStatistics`` that are published while the film grows.
FIGURES = (
    'mean_um', 'std_dev_um', 'min_um', 'max_um', 'coverage', 'within_target',
    'painted_volume_cm3', 'capture_fraction',
)  # fmt: skip


@dataclass(frozen=True)
class FilmStatistics:
    """What the film on a part amounts to; mean to max are over the painted part of its area.

    With nothing painted they are 0.
    """

    mean_um: float  # mean film [um]
    std_dev_um: float  # standard deviation of the film [um]
    # Least and greatest film [um].
    min_um: float
    max_um: float
    coverage: float  # share of the part's area that is painted, 0 to 1
    # Shares of the painted area below, in and above the target band, that of its zone where there
    # are zones, 0 to 1; NaN without a target. Area in no zone counts if it has a target.
    below_target: float
    within_target: float
    above_target: float
    # Distance of the mean from the nearer limit of the band over three standard deviations; NaN
    # without a target or a standard deviation, and over zones with targets of their own.
    cpk: float
    painted_volume_cm3: float  # solids on the whole part, dust included [cm3]
    # Solids on the part over `emitted_volume_cm3`; NaN without any. It is no transfer efficiency:
    # K1 already holds that of a part which catches everything.
    capture_fraction: float
    emitted_volume_cm3: float  # solids that a part which catches everything would get [cm3]
    area_m2: float  # of the part [m2]
    painted_above_um: float  # film that counts as painted [um]
    # The band is target +- tolerance [um], outside of all zones; 0 is no target.
    target_um: float
    target_tolerance_um: float
    zones: Mapping[str, FilmStatistics] = field(default_factory=dict)  # each by its name

    @property
    def band_um(self) -> tuple[float, float]:
        """Lowest and highest film of the target band [um]."""
        off = self.target_tolerance_um
        return self.target_um - off, self.target_um + off

    def to_dict(self) -> dict[str, Any]:
        """All figures by name; None stands for NaN, which JSON does not know."""
        figures: dict[str, Any] = {
            k: None if math.isnan(v) else float(v) for k, v in vars(self).items() if k != 'zones'
        }
        if self.zones:
            figures['zones'] = [{'name': n} | zone.to_dict() for n, zone in self.zones.items()]
        return figures


def require_band(target_um: float, tolerance_um: float) -> None:
    """Refuse a tolerance about a target that would accept bare metal. Raises PaintError."""
    if 0.0 < target_um <= tolerance_um:
        raise PaintError(
            f'tolerance_um {tolerance_um:g} is not less than target_um {target_um:g}: bare metal '
            'would be within it; give a smaller one'
        )


def film_statistics(
    film_um: np.ndarray,
    area_m2: np.ndarray,
    emitted_cm3: float,
    *,
    painted_above_um: float = DEFAULT_PAINTED_ABOVE_UM,
    target_um: float = 0.0,
    target_tolerance_um: float = 0.0,
    zones: Zones | None = None,
) -> FilmStatistics:
    """Sum up a film (V,) [um] by the area (V,) that each vertex stands for; 1 um on 1 m2 is 1 cm3.

    ``emitted_cm3`` are the solids that a part which catches everything would get, K1 times the
    time sprayed. A target of 0 is none; in ``zones`` of the vertices their own target holds.
    Raises PaintError as ``require_band``.
    """
    require_band(target_um, target_tolerance_um)
    painted = film_um > painted_above_um
    film, area = film_um[painted], area_m2[painted]
    painted_area = float(area.sum())
    mean = variance = least = greatest = 0.0
    below = within = above = cpk = math.nan
    if painted_area > 0.0:
        mean = float(np.sum(film * area)) / painted_area
        variance = float(np.sum((film - mean) ** 2 * area)) / painted_area
        least, greatest = float(film.min()), float(film.max())
    if target_um > 0.0 or zones:
        target, tolerance = wanted_at(film_um, target_um, target_tolerance_um, zones)
        off, allowed = film - target[painted], tolerance[painted]
        wanted_area = float(area[~np.isnan(off)].sum())
        shares = [off < -allowed, np.abs(off) <= allowed, off > allowed]
        below, within, above = (
            float(area[share].sum()) / wanted_area if wanted_area > 0.0 else 0.0
            for share in shares
        )
        if variance > 0.0 and not zones:
            cpk = (target_tolerance_um - abs(mean - target_um)) / (3.0 * math.sqrt(variance))
    volume = float(np.sum(film_um * area_m2))
    return FilmStatistics(
        mean_um=mean,
        std_dev_um=math.sqrt(variance),
        min_um=least,
        max_um=greatest,
        coverage=painted_area / float(area_m2.sum()),
        below_target=below,
        within_target=within,
        above_target=above,
        cpk=cpk,
        painted_volume_cm3=volume,
        capture_fraction=volume / emitted_cm3 if emitted_cm3 > 0.0 else math.nan,
        emitted_volume_cm3=float(emitted_cm3),
        area_m2=float(area_m2.sum()),
        painted_above_um=float(painted_above_um),
        target_um=float(target_um),
        target_tolerance_um=float(target_tolerance_um),
        zones={
            zone.name: film_statistics(
                film_um[own], area_m2[own], emitted_cm3, painted_above_um=painted_above_um,
                target_um=zone.target_um, target_tolerance_um=zone.tolerance_um,
            )
            for zone, own in zones or ()
        },
    )  # fmt: skip


def wanted_at(
    film_um: np.ndarray, target_um: float, tolerance_um: float, zones: Zones | None
) -> tuple[np.ndarray, np.ndarray]:
    """Target and tolerance (V,) [um] for a film (V,); NaN where no film is wanted."""
    if zones:
        return zones.wanted_um(target_um, tolerance_um)
    shape = film_um.shape
    return np.full(shape, target_um or np.nan), np.full(shape, tolerance_um)


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
    def of(model: DepositionModel, path: SprayPath) -> PaintUsed:
        """Along a path that the effects on it have been applied to."""
        on = path.flow > 0.0
        rows, sprayed_s = model.pattern_rows(path.brush[on]), (path.dwell_s * path.flow)[on]
        seconds = [float(np.sum(sprayed_s[rows == k])) for k in range(len(model.patterns))]
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

    def __add__(self, other: PaintUsed) -> PaintUsed:
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

    def figures(self, mean_um: float, on_part_cm3: float) -> dict[str, Any]:
        """By name, for a mean dry film [um] and the solids on the part; None is not known.

        The transfer efficiency is solids on the part over solids sprayed.
        """
        known = {
            'wet_cm3': self.wet_cm3,
            'mass_g': self.mass_g,
            'solids_cm3': self.solids_cm3,
            'transfer_efficiency': on_part_cm3 / self.solids_cm3 if self.solids_cm3 else math.nan,
            'mean_wet_film_um': mean_um / self.solids if self.solids else math.nan,
        }
        return {k: None if math.isnan(v) else v for k, v in known.items()} | {
            'spraying_time_s_by_brush': {str(n): time_s for n, time_s in self.spraying_s.items()}
        }


def paint_figures(
    model: DepositionModel, paint: PaintUsed, film: FilmStatistics
) -> dict[str, Any] | None:
    """Paint, transfer efficiency and wet film by name; None where the model has no brushes."""
    return paint.figures(film.mean_um, film.painted_volume_cm3) if model.brushes else None


def paint_sentence(paint: PaintUsed, film: FilmStatistics) -> str:
    """The paint used in a line, '' where nothing of it is known."""
    said, known = [], paint.figures(film.mean_um, film.painted_volume_cm3)
    if known['wet_cm3'] is not None:
        mass = '' if known['mass_g'] is None else f' ({known["mass_g"]:.1f} g)'
        said.append(f'{known["wet_cm3"]:.1f} cm3{mass} of paint sprayed')
    if known['transfer_efficiency'] is not None:
        said.append(f'transfer efficiency {100 * known["transfer_efficiency"]:.0f} %')
    if known['mean_wet_film_um'] is not None:
        said.append(f'mean wet film {known["mean_wet_film_um"]:.1f} µm')
    return ', '.join(said)


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

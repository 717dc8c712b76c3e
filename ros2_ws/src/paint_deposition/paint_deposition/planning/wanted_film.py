"""The film that a plan aims at: the same everywhere, or that of the zones of the part."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from paint_deposition.errors import PlanError
from paint_deposition.film.statistics import FilmStatistics
from paint_deposition.part.surface import Surface
from paint_deposition.part.zones import PointZones


class Band(NamedTuple):
    """What film is accepted at some of V points."""

    points: np.ndarray  # (V,) bool
    target_um: float  # film wanted
    tolerance: float | None  # accepted share of it either way; None: any film


@dataclass(frozen=True)
class WantedFilm:
    """The film wanted on a region of a part; a film over ``share`` should be the mean target.

    Attributes:
        region: (V,) bool, vertices whose film counts.
        target_um: mean target there; None: it is that of the film as it is.
        elsewhere_um: target outside of the zones, None: none.
        share: (V,) target of each vertex over the mean target.
        zones: of the vertices, or None. free_m2: what is painted and has no target [m^2].
    """

    region: np.ndarray
    target_um: float | None
    elsewhere_um: float | None
    share: np.ndarray
    zones: PointZones | None = None
    free_m2: float = 0.0

    @staticmethod
    def of(
        surface: Surface, region: np.ndarray, target_um: float | None, zones: PointZones | None
    ) -> WantedFilm:
        """In zones their targets, and elsewhere ``target_um``, count on a region (V,) bool.

        Raises:
            PlanError: no vertex of the region has a target of its own.
        """
        if zones is None:
            return WantedFilm(region, target_um, target_um, np.ones(len(region)))
        targets, _ = zones.wanted_um(target_um)
        counted = region & ~np.isnan(targets)
        if not (counted & (zones.number >= 0)).any():
            raise PlanError(
                'no zone lies where paint is to land; give zones on the side that the gun faces'
            )
        # By zones, and not by vertices: of equal targets it is the very same.
        area = np.where(counted, surface.vertex_areas_m2, 0.0)
        kinds, of = np.unique(targets, return_inverse=True)
        areas = np.bincount(of, area)
        mean = float((areas / areas.sum())[areas > 0.0] @ kinds[areas > 0.0])
        return WantedFilm(
            counted, mean, target_um, np.where(counted, targets / mean, 1.0), zones,
            float(surface.vertex_areas_m2[region & ~counted].sum()),
        )  # fmt: skip

    def doubts(self, laid: FilmStatistics) -> Iterator[str]:
        """What of the film that is laid may not be as expected, a line each."""
        if self.free_m2:
            yield (
                f'{self.free_m2:.2g} m2 of what is painted are in no zone and have no target: any '
                'film is taken there; give --target-um, or a zone over them'
            )
        for one in self.zones.zones.zones if self.zones else ():
            if one.name not in laid.zones:
                yield (
                    f'zone {one.name} is left out: the passes do not paint it, or hardly; give '
                    'passes over it'
                )
        for name, zone in laid.zones.items():
            low, high = zone.band_um
            if not low <= zone.mean_um <= high:
                yield (
                    f'zone {name}: the mean film is {zone.mean_um:.1f} µm, outside of {low:g} to '
                    f'{high:g} µm: the passes over it reach its neighbours too; lay passes along '
                    'the border, or allow other speeds (--speed-min, --speed-max)'
                )

    def bands(self, rows: np.ndarray, target_um: float, tolerance: float | None) -> list[Band]:
        """Those of vertices (V,); outside of zones the mean target and tolerance given hold."""
        if self.zones is None:
            return [Band(np.ones(len(rows), dtype=bool), target_um, tolerance)]
        here = self.zones.select(rows)
        found = [Band(own, z.target_um, z.tolerance_um / z.target_um) for z, own in here]
        if self.elsewhere_um is not None:
            found.append(Band(here.number < 0, self.elsewhere_um, tolerance))
        return found

    def limits_um(self, target_um: float, tolerance: float) -> tuple[np.ndarray, np.ndarray]:
        """Least and greatest film (V,) accepted [um]; the rest as for ``bands``."""
        low, high = np.full((2, len(self.region)), np.nan)
        for band in self.bands(np.arange(len(low)), target_um, tolerance):
            low[band.points] = band.target_um * (1.0 - (band.tolerance or 0.0))
            high[band.points] = band.target_um * (1.0 + (band.tolerance or 0.0))
        return low, high

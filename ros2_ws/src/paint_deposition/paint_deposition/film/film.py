"""The film on a part, with all that it was computed from."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.film.spray_geometry import SprayGeometry
from paint_deposition.film.statistics import (
    FilmStatistics,
    PaintUsed,
    impossible_brushes,
    paint_figures,
)
from paint_deposition.motion.path import SprayPath
from paint_deposition.motion.trajectory import PoseCounts, Trajectory
from paint_deposition.part.surface import Surface
from paint_deposition.part.zones import PointZones

if TYPE_CHECKING:
    from paint_deposition.inference.readings.readings import Readings


@dataclass(frozen=True)
class GunFilm:
    """What one of the guns on a part did."""

    name: str  # of the gun, '' for the only one
    trajectory: Trajectory  # its motion as recorded
    path: SprayPath  # the same cut into sub-steps
    counts: PoseCounts  # its poses
    model: DepositionModel  # its deposition model
    geometry: SprayGeometry  # how it ran over the part
    painted_volume_cm3: float  # solids that it laid on the part, before effects on the film [cm3]
    emitted_volume_cm3: float  # solids that a part which catches everything would get of it [cm3]

    def to_dict(self) -> dict[str, Any]:
        """Figures by name."""
        return {
            'name': self.name,
            'trajectory': self.trajectory.source,
            'effects': [effect.id for effect in self.model.effects],
            'spraying_time_s': self.path.spraying_time_s,
            'painted_volume_cm3': self.painted_volume_cm3,
            'emitted_volume_cm3': self.emitted_volume_cm3,
            'poses': self.counts.to_dict(),
            'geometry': self.geometry.to_dict(),
        }


@dataclass(frozen=True)
class CoatFilm:
    """What one of the coats adds to the film on a part."""

    name: str
    guns: tuple[GunFilm, ...]  # what laid it
    film_um: np.ndarray  # (V,) film at the vertices of the surface [um]
    statistics: FilmStatistics  # of this film
    paint: PaintUsed  # that was sprayed

    @property
    def mean_wet_um(self) -> float:
        """Mean film before anything evaporates [um]; NaN where its solids are not known."""
        return self.statistics.mean_um / self.paint.solids

    def to_dict(self) -> dict[str, Any]:
        """Figures by name."""
        return {
            'name': self.name,
            'atomizers': [gun.name for gun in self.guns],
            **self.statistics.to_dict(),
            'paint': paint_figures(self.guns[0].model, self.paint, self.statistics),
        }


@dataclass(frozen=True)
class Film:
    """The film on a part, with all that it was computed from.

    Attributes:
        surface: the part, its outward side turned to the gun.
        guns: what laid the film, one as a rule.
        film_um: (V,) film at the vertices of the surface [um].
        statistics: of the film, weighted by area.
        readings: places where the gauge should be predicted, or None.
        predicted_um: (N,) what the gauge should show at each of them [um], or None.
        paint: that was sprayed.
        doubts: what is odd in the readings.
        coats: in the order of painting, where the film was laid in named coats.
        zones: of the vertices, each with a target, or None.
    """

    surface: Surface
    guns: tuple[GunFilm, ...]
    film_um: np.ndarray
    statistics: FilmStatistics
    readings: Readings | None = None
    predicted_um: np.ndarray | None = None
    paint: PaintUsed = field(default_factory=PaintUsed)
    doubts: tuple[str, ...] = ()
    coats: tuple[CoatFilm, ...] = ()
    zones: PointZones | None = None

    def __repr__(self) -> str:
        s = self.statistics
        return (
            f'Film({s.mean_um:.1f} ± {s.std_dev_um:.1f} µm at {len(self.film_um)} vertices, '
            f'{100 * s.coverage:.0f} % of {s.area_m2:.2f} m² painted)'
        )

    def columns(self) -> dict[str, np.ndarray]:
        """At the vertices, the columns of ``film.csv``."""
        columns = dict(zip(('x_m', 'y_m', 'z_m'), self.surface.vertices_m.T, strict=True))
        columns['thickness_um'] = self.film_um
        columns |= {f'{coat.name}_um': coat.film_um for coat in self.coats}
        return columns | ({'zone': self.zones.names} if self.zones else {})

    @property
    def trajectory(self) -> Trajectory:
        """The motion of the first gun, as recorded."""
        return self.guns[0].trajectory

    @property
    def model(self) -> DepositionModel:
        """The deposition model of the first gun."""
        return self.guns[0].model

    @property
    def path(self) -> SprayPath:
        """The motion of all guns, cut into sub-steps."""
        return SprayPath.of_guns([gun.path for gun in self.guns])

    @property
    def counts(self) -> PoseCounts:
        """What became of the poses of all guns."""
        return PoseCounts.of_guns([gun.counts for gun in self.guns])

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks on the mesh and the recordings for the user."""
        return (*self.surface.notes, *self._of_each(lambda gun: gun.trajectory.notes))

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is odd in recordings, geometry and readings, each with its likely cause."""
        spraying_s = sum(gun.path.spraying_time_s for gun in self.guns)
        bare = (
            f'the part stays bare, its thickest film is {self.film_um.max():.2g} µm: the gun '
            f'sprays {spraying_s:.3g} s only'
        )
        odd = self._of_each(lambda gun: gun.geometry.warnings)
        odd = odd or ((bare,) if self.statistics.coverage == 0.0 else ())
        recorded = self._of_each(lambda gun: gun.trajectory.warnings)
        brushes = self._of_each(lambda gun: impossible_brushes(gun.model))
        negative = []
        least_um = float(self.film_um.min())
        # A law on the film, of first order as sag, is stretched beyond where it holds.
        if least_um <= -1e-4 * float(self.film_um.max()):
            effects = (e for gun in self.guns for e in gun.model.effects if not e.is_neutral)
            causes = ', '.join(dict.fromkeys(e.id for e in effects if e.acts('on_film')))
            negative.append(
                f'the film is {least_um:.2g} µm at its least, and no film is below 0: the law of '
                f'{causes} does not hold at this size; make it smaller or leave it out'
            )
        return (*recorded, *odd, *brushes, *negative, *self.doubts)

    def _of_each(self, lines: Callable[[GunFilm], tuple[str, ...]]) -> tuple[str, ...]:
        return tuple(
            f'{gun.name}: {line}' if gun.name else line for gun in self.guns for line in lines(gun)
        )

    def to_dict(self) -> dict[str, Any]:
        """Figures of the film and of how it was painted, as in ``stats.json``.

        The geometry is that of the first gun; `atomizers` has each.
        """
        coats = {'coats': [coat.to_dict() for coat in self.coats]} if self.coats else {}
        return self.statistics.to_dict() | coats | {
            'frame_id': self.trajectory.frame_id,
            'down': self.surface.down.tolist(),
            'effects': list(dict.fromkeys(e.id for gun in self.guns for e in gun.model.effects)),
            'spraying_time_s': sum(gun.path.spraying_time_s for gun in self.guns),
            'paint': paint_figures(self.model, self.paint, self.statistics),
            'poses': self.counts.to_dict(),
            'geometry': self.guns[0].geometry.to_dict(),
            'atomizers': [gun.to_dict() for gun in self.guns],
            'notes': list(self.notes),
            'warnings': list(self.warnings),
        }  # fmt: skip

"""The film on a part, with all that it was computed from."""

from __future__ import annotations

import math
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
from paint_deposition.part.zones import Zones

if TYPE_CHECKING:
    from paint_deposition.inference.readings.readings import Readings


@dataclass(frozen=True)
class GunOnPart:
    """A part, its outward side turned to the gun, and the motion of the gun over it.

    Attributes:
        trajectory: the motion as recorded, with warnings.
        path: the same cut into sub-steps; counts: its poses.
        model: what it sprays.
        geometry: how the gun ran over the part, and what is odd.
        name: of the gun, '' for the only one.
        painted_volume_cm3: solids that it laid on the part, before effects on the film, and
        emitted_volume_cm3: those that a part which catches everything would get of it [cm3]; NaN
            where nothing was painted.
    """

    surface: Surface
    trajectory: Trajectory
    path: SprayPath
    counts: PoseCounts
    model: DepositionModel
    geometry: SprayGeometry
    name: str = ''
    painted_volume_cm3: float = math.nan
    emitted_volume_cm3: float = math.nan

    def __repr__(self) -> str:
        return f'GunOnPart({self.geometry.sentence})'

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks on the mesh and the recording for the user."""
        return (*self.surface.notes, *self.trajectory.notes)

    def to_dict(self) -> dict[str, Any]:
        """Figures by name."""
        return {
            'geometry': self.geometry.to_dict(),
            'frame_id': self.trajectory.frame_id,
            'down': self.surface.down.tolist(),
            'area_m2': self.surface.area_m2,
            'poses': self.counts.to_dict(),
            'notes': list(self.notes),
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
        coats: what each adds, in the order of painting, where the film was laid in named coats.
        zones: of the vertices, each with a target, or None.
        name: of the coat whose film it is, '' for that of all of them.
    """

    surface: Surface
    guns: tuple[GunOnPart, ...]
    film_um: np.ndarray
    statistics: FilmStatistics
    readings: Readings | None = None
    predicted_um: np.ndarray | None = None
    paint: PaintUsed = field(default_factory=PaintUsed)
    doubts: tuple[str, ...] = ()
    coats: tuple[Film, ...] = ()
    zones: Zones | None = None
    name: str = ''

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

    def _of_each(self, lines: Callable[[GunOnPart], tuple[str, ...]]) -> tuple[str, ...]:
        return tuple(
            f'{gun.name}: {line}' if gun.name else line for gun in self.guns for line in lines(gun)
        )

    def to_dict(self) -> dict[str, Any]:
        """Figures of the film and of how it was painted, as in ``stats.json``.

        The geometry is that of the first gun; `atomizers` has each.
        """
        coats = [
            {
                'name': coat.name,
                'atomizers': [gun.name for gun in coat.guns],
                **coat.statistics.to_dict(),
                'paint': paint_figures(coat.model, coat.paint, coat.statistics),
            }
            for coat in self.coats
        ]
        return self.statistics.to_dict() | ({'coats': coats} if coats else {}) | {
            'frame_id': self.trajectory.frame_id,
            'down': self.surface.down.tolist(),
            'effects': list(dict.fromkeys(e.id for gun in self.guns for e in gun.model.effects)),
            'spraying_time_s': sum(gun.path.spraying_time_s for gun in self.guns),
            'paint': paint_figures(self.model, self.paint, self.statistics),
            'poses': self.counts.to_dict(),
            'geometry': self.guns[0].geometry.to_dict(),
            'atomizers': [
                {
                    'name': gun.name,
                    'trajectory': gun.trajectory.source,
                    'effects': [effect.id for effect in gun.model.effects],
                    'spraying_time_s': gun.path.spraying_time_s,
                    'painted_volume_cm3': gun.painted_volume_cm3,
                    'emitted_volume_cm3': gun.emitted_volume_cm3,
                    'poses': gun.counts.to_dict(),
                    'geometry': gun.geometry.to_dict(),
                }
                for gun in self.guns
            ],
            'notes': list(self.notes),
            'warnings': list(self.warnings),
        }  # fmt: skip

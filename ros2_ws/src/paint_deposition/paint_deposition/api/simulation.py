"""The film that a recorded motion leaves on a part."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from paint_deposition.api.geometry import look_at
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import RecordingError
from paint_deposition.film.integrator import NO_PAINT_UM, FilmIntegrator
from paint_deposition.film.paint_used import NO_PAINT, PaintUsed, impossible_brushes, paint_figures
from paint_deposition.film.spray_geometry import SprayGeometry
from paint_deposition.film.statistics import FilmStatistics, film_statistics
from paint_deposition.fitting.forward import Forward
from paint_deposition.motion.path import SprayPath
from paint_deposition.motion.path_builder import DEFAULT_MAX_POSE_GAP_S
from paint_deposition.motion.trajectory import PoseCounts, Trajectory
from paint_deposition.part.surface import Surface
from paint_deposition.readings.campaign import Campaign, Experiment
from paint_deposition.readings.readings import Readings

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class Film:
    """The film on a part, with all that it was computed from.

    Attributes:
        surface: the part, its outward side turned to the gun.
        trajectory: the motion as recorded; path: the same cut into sub-steps; counts: its poses.
        model: the deposition model.
        film_um: (V,) film at the vertices of the surface [um].
        statistics: of the film, weighted by area.
        geometry: how the gun ran over the part.
        readings: places where the gauge should be predicted, or None.
        predicted_um: (N,) what the gauge should show at each of them [um], or None.
        paint: that was sprayed.
    """

    surface: Surface
    trajectory: Trajectory
    path: SprayPath
    counts: PoseCounts
    model: DepositionModel
    film_um: np.ndarray
    statistics: FilmStatistics
    geometry: SprayGeometry
    readings: Readings | None = None
    predicted_um: np.ndarray | None = None
    paint: PaintUsed = NO_PAINT

    def __repr__(self) -> str:
        s = self.statistics
        return (
            f'Film({s.mean_um:.1f} ± {s.std_dev_um:.1f} µm at {len(self.film_um)} vertices, '
            f'{100 * s.coverage:.0f} % of {s.area_m2:.2f} m² painted)'
        )

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks on the mesh and the recording for the user."""
        return (*self.surface.notes, *self.trajectory.notes)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is odd in the geometry, each with its likely cause."""
        bare = (
            f'the part stays bare, its thickest film is {self.film_um.max():.2g} µm: the gun '
            f'sprays {self.path.spraying_time_s:.3g} s only'
        )
        odd = self.geometry.warnings or ((bare,) if self.statistics.coverage == 0.0 else ())
        return (*odd, *impossible_brushes(self.model))

    def to_dict(self) -> dict[str, Any]:
        """Figures of the film and of how it was painted, as in ``stats.json``."""
        return self.statistics.to_dict() | {
            'frame_id': self.trajectory.frame_id,
            'down': self.surface.down.tolist(),
            'effects': [effect.id for effect in self.model.effects],
            'spraying_time_s': self.path.spraying_time_s,
            'paint': paint_figures(self),
            'poses': self.counts.to_dict(),
            'geometry': self.geometry.to_dict(),
            'notes': list(self.notes),
            'warnings': list(self.warnings),
        }


def simulate(
    surface: Surface,
    trajectory: Trajectory,
    model: DepositionModel | None = None,
    *,
    readings: Readings | None = None,
    max_pose_gap_s: float = DEFAULT_MAX_POSE_GAP_S,
    target_um: float = 0.0,
    tolerance_um: float = 0.0,
    progress: Progress = lambda what, share: None,
) -> Film:
    """Compute the film on a part from a recorded motion.

    Args:
        surface: the part; it is turned round, with a note, if the gun looks at its back.
        trajectory: poses and trigger in the frame of the mesh.
        model: what the gun sprays; default: a 50 mm bell.
        readings: places at which the gauge is to be predicted too, effects on it included.
        max_pose_gap_s: a longer time between two poses counts as gun off [s].
        target_um, tolerance_um: the film wanted and what it may differ, for the figures [um].
        progress: called with what is being done and the share of it that is done, 0 to 1.

    Raises:
        RecordingError: the poses make no motion, the gun never sprays, or no paint lands on the
            part; says why.
        ReadingsError: readings that are not on the part.
    """
    model = model or DepositionModel()
    seen = look_at(surface, trajectory, model, max_pose_gap_s=max_pose_gap_s)
    surface, path, geometry = seen.surface, seen.path, seen.geometry
    painted = FilmIntegrator(surface.points(), model, occluder=surface.occluder)
    painted.add(path, lambda done: progress('painting', done / len(path)))
    film_um = painted.film_um
    if film_um.max() < NO_PAINT_UM:
        cause = geometry.warnings[0] if geometry.warnings else geometry.sentence
        raise RecordingError(f'{trajectory.source}: no paint lands on the part: {cause}')
    statistics = film_statistics(
        film_um, surface.vertex_areas_m2, painted.emitted_cm3,
        target_um=target_um, target_tolerance_um=tolerance_um,
    )  # fmt: skip
    predicted_um = None
    if readings is not None:
        progress('predicting the readings', 0.0)
        # Each reading by itself, in double precision.
        each = replace(readings, point=np.arange(len(readings)).astype(str))
        campaign = Campaign((Experiment.of('part', surface, path, each),))
        predicted_um = Forward(campaign).predict_um(model)
    return Film(
        surface, trajectory, path, seen.counts, model, film_um, statistics, geometry, readings,
        predicted_um, painted.used,
    )  # fmt: skip

"""The film that a recorded motion leaves on a part."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from paint_deposition.api.geometry import GunOnPart, look_at_guns, require_brushes
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import ModelError, RecordingError
from paint_deposition.film.common_film import CommonFilm, require_one_finish
from paint_deposition.film.integrator import NO_PAINT_UM, FilmIntegrator, Precision
from paint_deposition.film.interpolated_brushes import with_interpolated_brushes
from paint_deposition.film.paint_used import NO_PAINT, PaintUsed, impossible_brushes, paint_figures
from paint_deposition.film.spray_geometry import SprayGeometry
from paint_deposition.film.statistics import FilmStatistics, film_statistics
from paint_deposition.inference.readings.campaign import Experiment
from paint_deposition.inference.readings.readings import Readings
from paint_deposition.motion.path import SprayPath
from paint_deposition.motion.path_builder import DEFAULT_MAX_POSE_GAP_S
from paint_deposition.motion.trajectory import PoseCounts, Trajectory
from paint_deposition.part.points import SurfacePoints
from paint_deposition.part.surface import Surface

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class GunFilm:
    """What one of the guns on a part did.

    Attributes:
        name: of the gun, '' for the only one.
        trajectory: its motion as recorded; path: the same cut into sub-steps; counts: its poses.
        model: its deposition model.
        geometry: how it ran over the part.
        painted_volume_cm3: solids that it laid on the part, before effects on the film [cm3].
        emitted_volume_cm3: solids that a part which catches everything would get of it [cm3].
    """

    name: str
    trajectory: Trajectory
    path: SprayPath
    counts: PoseCounts
    model: DepositionModel
    geometry: SprayGeometry
    painted_volume_cm3: float
    emitted_volume_cm3: float

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
    """

    surface: Surface
    guns: tuple[GunFilm, ...]
    film_um: np.ndarray
    statistics: FilmStatistics
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
        """What is odd in the geometry, each with its likely cause."""
        spraying_s = sum(gun.path.spraying_time_s for gun in self.guns)
        bare = (
            f'the part stays bare, its thickest film is {self.film_um.max():.2g} µm: the gun '
            f'sprays {spraying_s:.3g} s only'
        )
        odd = self._of_each(lambda gun: gun.geometry.warnings)
        odd = odd or ((bare,) if self.statistics.coverage == 0.0 else ())
        return (*odd, *self._of_each(lambda gun: impossible_brushes(gun.model)))

    def _of_each(self, lines: Callable[[GunFilm], tuple[str, ...]]) -> tuple[str, ...]:
        return tuple(
            f'{gun.name}: {line}' if gun.name else line for gun in self.guns for line in lines(gun)
        )

    def to_dict(self) -> dict[str, Any]:
        """Figures of the film and of how it was painted, as in ``stats.json``.

        The geometry is that of the first gun; `atomizers` has each.
        """
        return self.statistics.to_dict() | {
            'frame_id': self.trajectory.frame_id,
            'down': self.surface.down.tolist(),
            'effects': list(dict.fromkeys(e.id for gun in self.guns for e in gun.model.effects)),
            'spraying_time_s': sum(gun.path.spraying_time_s for gun in self.guns),
            'paint': paint_figures(self),
            'poses': self.counts.to_dict(),
            'geometry': self.guns[0].geometry.to_dict(),
            'atomizers': [gun.to_dict() for gun in self.guns],
            'notes': list(self.notes),
            'warnings': list(self.warnings),
        }


def simulate(
    surface: Surface,
    trajectory: Trajectory | Sequence[Trajectory],
    model: DepositionModel | Sequence[DepositionModel] | None = None,
    *,
    names: Sequence[str] = (),
    readings: Readings | None = None,
    max_pose_gap_s: float = DEFAULT_MAX_POSE_GAP_S,
    target_um: float = 0.0,
    tolerance_um: float = 0.0,
    progress: Progress = lambda what, share: None,
) -> Film:
    """Compute the film on a part from a recorded motion, or from those of several guns.

    Args:
        surface: the part; it is turned round, with a note, if the gun looks at its back. Of
            several guns the first whose axis meets the part decides.
        trajectory: poses and trigger in the frame of the mesh; one for each gun.
        model: what the gun sprays, one for all or one for each; default: a 50 mm bell.
        names: of the guns, where there are several; default: gun 1, gun 2 and so on.
        readings: places at which the gauge is to be predicted too, effects on it included.
        max_pose_gap_s: a longer time between two poses counts as gun off [s].
        target_um, tolerance_um: the film wanted and what it may differ, for the figures [um].
        progress: called with what is being done and the share of it that is done, 0 to 1.

    Raises:
        RecordingError: the poses make no motion, the gun never sprays, or no paint lands on the
            part; says why.
        ModelError: models of several guns that do not go together.
        ReadingsError: readings that are not on the part.
    """
    motions = [trajectory] if isinstance(trajectory, Trajectory) else list(trajectory)
    models = _one_for_each(model, len(motions))
    if len(motions) > 1:
        names = list(names) or [f'gun {number}' for number in range(1, len(motions) + 1)]
        require_one_finish(dict(zip(names, models, strict=True)))
    given, pairs = models, zip(motions, models, strict=True)
    known = [with_interpolated_brushes(motion, its) for motion, its in pairs]
    motions, models = [motion for motion, _ in known], [its for _, its in known]
    for motion, its_model in known:
        require_brushes(motion, its_model)
    seen = look_at_guns(surface, motions, models, max_pose_gap_s=max_pose_gap_s)
    surface = seen[0].surface
    common = _painted(surface.points(), seen, models, surface, 'single', progress)
    film_um = common.film_um
    if film_um.max() < NO_PAINT_UM:
        geometry = seen[0].geometry
        cause = geometry.warnings[0] if geometry.warnings else geometry.sentence
        raise RecordingError(f'{motions[0].source}: no paint lands on the part: {cause}')
    statistics = film_statistics(
        film_um, surface.vertex_areas_m2, common.emitted_cm3,
        target_um=target_um, target_tolerance_um=tolerance_um,
    )  # fmt: skip
    guns = tuple(
        GunFilm(
            name, gun.trajectory, gun.path, gun.counts, its_model, gun.geometry,
            laid_cm3, integrator.emitted_cm3,
        )
        for name, gun, its_model, laid_cm3, integrator in zip(
            names or [''], seen, given, common.laid_cm3(surface.vertex_areas_m2).tolist(),
            common.guns, strict=True,
        )
    )  # fmt: skip
    predicted_um = None
    if readings is not None:
        progress('predicting the readings', 0.0)
        # Each reading by itself, in double precision, and the slope of the film around it.
        each = replace(readings, point=np.arange(len(readings)).astype(str))
        part = Experiment.of('part', surface, seen[0].path, each)
        at_points = _painted(part.points, seen, models, surface, 'double', progress)
        predicted_um = at_points.gauge_um[: len(part)]
    return Film(surface, guns, film_um, statistics, readings, predicted_um, common.used)


def _one_for_each(
    model: DepositionModel | Sequence[DepositionModel] | None, guns: int
) -> list[DepositionModel]:
    if model is None or isinstance(model, DepositionModel):
        return [model or DepositionModel()] * guns
    if len(model) != guns:
        raise ModelError(
            f'{len(model)} models for {guns} guns: give one for all, or one for each of them'
        )
    return list(model)


def _painted(
    points: SurfacePoints,
    seen: Sequence[GunOnPart],
    models: Sequence[DepositionModel],
    surface: Surface,
    precision: Precision,
    progress: Progress,
) -> CommonFilm:
    """What the guns lay at these points."""
    integrators = []
    before, steps = 0, sum(len(gun.path) for gun in seen)
    for gun, model in zip(seen, models, strict=True):

        def tell(done: int, before: int = before) -> None:
            progress('painting', (before + done) / steps)

        integrators.append(FilmIntegrator(points, model, precision, surface.occluder))
        integrators[-1].add(gun.path, tell)
        before += len(gun.path)
    return CommonFilm(tuple(integrators))

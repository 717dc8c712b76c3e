"""A programme's speeds, flows and triggers, chosen for a more even film."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from paint_deposition.api.simulation import look_at
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import RecordingError
from paint_deposition.film.integrator import NO_PAINT_UM
from paint_deposition.inference.fitting.posterior import draw_models
from paint_deposition.inference.posterior import Posterior
from paint_deposition.motion.programmed import timed
from paint_deposition.motion.trajectory import Trajectory
from paint_deposition.part.surface import Surface
from paint_deposition.part.zones import Zones
from paint_deposition.planning.driving import RobotCell
from paint_deposition.planning.improvement import (
    DEFAULT_TOLERANCE,
    FilmSummary,
    Improvement,
)
from paint_deposition.planning.planned_film import WantedFilm, evenness, simulated
from paint_deposition.planning.programme import Programme, closed_beside, moves_of
from paint_deposition.planning.requests import ImproveRequest
from paint_deposition.planning.retiming import retime_for_evenness
from paint_deposition.planning.surface_map import painted_side
from paint_deposition.request import takes

Progress = Callable[[str, float], None]
# The film counts where the programme lays more than this share of its greatest film.
COUNTED_ABOVE = 0.1
# A gun whose mean direction is shorter paints more sides than one.
ONE_SIDE = 0.9
DRAWS = 8


@takes(ImproveRequest)
def improve(
    surface: Surface,
    trajectory: Trajectory,
    model: DepositionModel | None = None,
    *,
    posterior: Posterior | None = None,
    rivals: Sequence[DepositionModel] = (),
    target_region: np.ndarray | None = None,
    zones: Zones | None = None,
    robot: RobotCell | None = None,
    seed: int = 0,
    progress: Progress = lambda what, share: None,
    **wanted: Any,
) -> Improvement:
    """Keep the path of a programme and change its speeds, flows and triggers.

    Args:
        surface: the part; it is turned round, with a note, if the gun looks at its back.
        trajectory: the programme, in the frame of the mesh.
        model: what the gun sprays; default: a 50 mm bell.
        posterior: what is known of the model; the film is made even over draws from it.
        rivals: other models that explain the readings as well; each counts as much as the model.
        target_region: (V,) bool, vertices whose film counts; default: the side that the gun
            faces, where the programme lays more than a tenth of its greatest film.
        zones: regions with targets of their own, from ``read_zones``: the film over its own target
            is made even. Elsewhere it counts only where ``target_um`` is given.
        robot: that is to drive it, from ``read_robot``: its joints limit the speeds.
        seed: of the draws.
        progress: called with what is being done and the share of it that is done, 0 to 1.
        wanted: the fields of ``planning.requests.ImproveRequest``.

    Raises:
        RecordingError: the motion cannot be used. PlanError: the limits leave no motion.
        PaintError: a zone has no vertex of the part.
    """
    model = model or DepositionModel()
    request = ImproveRequest(**wanted)
    seen = look_at(surface, trajectory, model)
    surface, original = seen.surface, Programme.of(trajectory)
    if not request.spray_turns:
        original = closed_beside(original, surface)
    begin = None
    point_zones = zones.on(surface) if zones else None
    if robot:
        allowed, begin = robot.allowed_speeds(trajectory)
        original = replace(original, allowed=allowed)
    progress('the film as it is', 0.0)
    film_um, paint = simulated(surface, model, trajectory)
    if film_um.max() < NO_PAINT_UM:
        raise RecordingError(f'{trajectory.source}: no paint lands on the part')
    if target_region is None:
        tool_z = seen.path.rotation[seen.path.flow > 0.0][:, :, 2]
        target_region = _target_region(surface, film_um, tool_z)
    sought = WantedFilm.of(surface, target_region, request.target_um, point_zones)
    if sought.target_um is None:
        mean_um, _ = evenness(film_um[target_region], surface.vertex_areas_m2[target_region])
        sought = replace(sought, target_um=mean_um)
    models = [model, *rivals]
    if posterior is not None:
        models += draw_models(model, posterior, DRAWS, seed)
    retiming = retime_for_evenness(surface, sought, original, models, request, progress)
    programme, drive = retiming.programme, None
    if robot:
        drive = robot.drive(programme.trajectory(), free_roll=False, begin=begin)
        programme = Programme.of(drive.trajectory)
    moves = moves_of(programme, request)
    progress('the film as it will be', 0.0)
    improved = programme.trajectory()
    new_um, new_paint = simulated(surface, model, improved)
    program_um, _ = simulated(surface, model, timed(moves, gun_known=True))
    tolerance = request.tolerance or DEFAULT_TOLERANCE
    band = surface, sought, retiming.target_um, tolerance
    before = FilmSummary.of(film_um, *band, paint.emitted_cm3, trajectory)
    after = FilmSummary.of(new_um, *band, new_paint.emitted_cm3, improved)
    return Improvement(
        surface, sought, model, request, trajectory, improved, moves, retiming, before,
        after, float(np.abs(program_um - new_um).max() / new_um.max()),
        (*seen.trajectory.warnings, *seen.geometry.warnings), drive,
    )  # fmt: skip


def _target_region(surface: Surface, film_um: np.ndarray, tool_z: np.ndarray) -> np.ndarray:
    reached = film_um > COUNTED_ABOVE * film_um.max()
    towards = -tool_z.mean(axis=0)
    length = np.linalg.norm(towards)
    return reached & painted_side(surface, towards / length) if length >= ONE_SIDE else reached

"""Where to measure a part."""

from collections.abc import Callable, Iterable
from typing import Any

from paint_deposition.api.simulation import look_at, require_brushes
from paint_deposition.effects.base import Effect
from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.inference.design.reading_choice import ChosenReadings, choose
from paint_deposition.inference.design.reading_exchange import UnmeasuredPart
from paint_deposition.inference.posterior import Posterior
from paint_deposition.motion.path_builder import DEFAULT_MAX_POSE_GAP_S
from paint_deposition.motion.trajectory import Trajectory
from paint_deposition.part.surface import Surface
from paint_deposition.planning.requests import MeasureRequest
from paint_deposition.request import takes


@takes(MeasureRequest)
def choose_readings(
    surface: Surface,
    trajectory: Trajectory,
    model: DepositionModel | None = None,
    *,
    posterior: Posterior | None = None,
    own_effects: Iterable[type[Effect]] = (),
    max_pose_gap_s: float = DEFAULT_MAX_POSE_GAP_S,
    progress: Callable[[str], None] = lambda line: None,
    **wanted: Any,
) -> ChosenReadings:
    """Choose where to put the gauge on a part, so that missing effects are found soonest.

    Args:
        surface: the part; it is turned round, with a note, if the gun looks at its back.
        trajectory: the motion that paints it, in the frame of the mesh.
        model: what the gun sprays, as far as it is known; default: a 50 mm bell.
        posterior: what earlier readings say of the model; default: little is known of it.
        own_effects: to look for beside the catalogue's.
        max_pose_gap_s: a longer time between two poses counts as gun off [s].
        progress: called with a line for each step.
        wanted: the fields of ``planning.requests.MeasureRequest``.

    Raises:
        RecordingError: the poses make no motion, or the gun never sprays.
        ReadingsError: the part has no room for so many points.
    """
    request, model = MeasureRequest(**wanted), model or DepositionModel()
    require_brushes(trajectory, model)
    model = model.of_numbers(trajectory.brushes).single('a choice of points')
    seen = look_at(surface, trajectory, model, max_pose_gap_s=max_pose_gap_s)
    library = dict(EFFECTS) | {effect.id: effect for effect in own_effects}
    part = UnmeasuredPart(seen.surface, seen.path, model, library, posterior)
    return choose(part, request.points, request.repeats, request.foot_m, request.seed, progress)

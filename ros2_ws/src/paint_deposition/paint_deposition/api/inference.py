"""What readings say of a model, and where to take them: calibrate, compare, diagnose, measure."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any

from paint_deposition.api.simulation import look_at
from paint_deposition.effects.base import Effect
from paint_deposition.effects.catalogue import EFFECTS, effect_class
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import PaintError
from paint_deposition.files.effect_file import load_unnamed_effect_file
from paint_deposition.files.model_file import read_model, read_model_file, require_file
from paint_deposition.film.live_film import without_refused_states
from paint_deposition.inference.comparison.comparison import Comparison, SideBySide
from paint_deposition.inference.comparison.comparison import compare as compared
from paint_deposition.inference.design.next_experiment import with_proposals
from paint_deposition.inference.design.reading_choice import ChosenReadings, choose
from paint_deposition.inference.design.unmeasured_part import UnmeasuredPart
from paint_deposition.inference.diagnosis.model_space import space_around
from paint_deposition.inference.diagnosis.procedure import diagnose as diagnosed
from paint_deposition.inference.diagnosis.refit import refit as refitted
from paint_deposition.inference.diagnosis.verdict import Diagnosis
from paint_deposition.inference.fitting.calibration import Calibration
from paint_deposition.inference.fitting.calibration import calibrate as calibrated
from paint_deposition.inference.fitting.cleaning import STARTS, clean_and_fit
from paint_deposition.inference.fitting.panel import short_reaches
from paint_deposition.inference.fitting.parameters import Posterior
from paint_deposition.inference.fitting.posterior import of_brushes, with_brushes_of
from paint_deposition.inference.readings.campaign import Campaign
from paint_deposition.inference.readings.plausibility import require_paint
from paint_deposition.motion.trajectory import DEFAULT_MAX_POSE_GAP_S, Trajectory
from paint_deposition.part.surface import Surface
from paint_deposition.planning.requests import MeasureRequest
from paint_deposition.request import takes

Progress = Callable[[str], None]


def calibrate(
    campaign: Campaign,
    model: DepositionModel | None = None,
    *,
    seed: int = 0,
    progress: Progress = lambda line: None,
) -> Calibration:
    """Fit the pattern, and the amplitudes of the model's effects, to all readings.

    Args:
        model: to start from; default: the campaign's, else a 50 mm bell.
        seed: of the starts of the fit.

    Raises:
        ReadingsError: the readings are not plausible, or determine nothing.
    """
    model = model or _model_of(campaign)
    doubts = require_paint(campaign, with_brushes_of(campaign, model or DepositionModel()))
    found = calibrated(campaign, model, seed, progress)
    found = replace(found, warnings=(*found.study.warnings, *doubts, *found.warnings))
    return replace(found, discrepancy=space_around(found.study, found.fit).figures)


def compare(
    campaign: Campaign,
    model: DepositionModel | None = None,
    *,
    progress: Progress = lambda line: None,
) -> Comparison:
    """Set a model beside the readings and say where it is off.

    Args:
        model: taken as it is; default: the campaign's, else one fitted to the campaign.
    """
    model = model or _model_of(campaign)
    start = model or with_brushes_of(campaign, DepositionModel())
    start.require_brushes(campaign.brushes)
    doubts = require_paint(campaign, start)
    progress('fitting the pattern')
    study, fit = clean_and_fit(campaign, start, start.effects, STARTS if model else 10)
    progress('comparing')
    short = {} if model else short_reaches(study.campaign, fit.model)
    found = compared(study, model or fit.model)
    warnings = (*study.warnings, *doubts, *short.values())
    # From job to job K1 differs by half as much.
    ratio = fit.model.planar.K1_cm3_per_s / found.model.planar.K1_cm3_per_s
    is_off = abs(ratio - 1.0) > 0.2
    if not warnings and is_off and not short_reaches(study.campaign, fit.model):
        another = 'the model may be for another flow, or of another gun: calibrate it'
        warnings = (f'the readings say {ratio:.2g} times the K1 of the model; {another}',)
    if not warnings:
        warnings = tuple(filter(None, [study.level_doubt(fit)[1]]))
    return replace(found, warnings=warnings)


def compare_models(
    campaign: Campaign,
    models: Mapping[str, DepositionModel],
    *,
    progress: Progress = lambda line: None,
) -> SideBySide:
    """Set several models beside the same readings.

    Args:
        campaign: painted parts with readings. Slips among them are found with the first model and
            left out for all.
        models: by name, taken as they are.

    Raises:
        PaintError: there are fewer than two, or more than a picture can show.
    """
    if not 2 <= len(models) <= 6:
        raise PaintError(f'{len(models)} models to compare; give 2 to 6')
    progress('fitting the pattern')
    for model in models.values():
        model.require_brushes(campaign.brushes)
    first = next(iter(models.values()))
    doubts = require_paint(campaign, first)
    study, _ = clean_and_fit(campaign, first, first.effects)
    found = {}
    for name, model in models.items():
        progress(f'comparing {name}')
        found[name] = replace(compared(study, model), warnings=(*study.warnings, *doubts))
    return SideBySide(found)


def diagnose(
    campaign: Campaign,
    model: DepositionModel | None = None,
    *,
    posterior: Posterior | None = None,
    own_effects: Iterable[type[Effect]] = (),
    seed: int = 0,
    progress: Progress = lambda line: None,
) -> Diagnosis:
    """Find which physical effect a model lacks, if any, and add it.

    Args:
        model: to start from; default: the campaign's, else a 50 mm bell.
        posterior: what another job found of the model, as its file or its calibration has it:
            the prior of the fit. Default: that of the campaign's model, if it is that.
        own_effects: to consider beside the catalogue's.
        seed: of the starts of the fits and of the simulated deviations.
    """
    own = {effect.id: effect for effect in own_effects}
    for effect in own.values():
        require_file(effect)
    library = dict(EFFECTS) | own
    start, known, doubts = _start(campaign, model, posterior)
    found = diagnosed(campaign, start, library, seed, progress, known)
    short = {} if known else short_reaches(found.study.campaign, found.model)
    found = replace(found, remarks=(*_about(found), *doubts, *found.remarks, *short.values()))
    progress('looking for what to measure and spray next')
    return with_proposals(found, library)


def refit(
    campaign: Campaign,
    added: str | type[Effect] | None,
    model: DepositionModel | None = None,
    *,
    posterior: Posterior | None = None,
    seed: int = 0,
    progress: Progress = lambda line: None,
) -> Diagnosis:
    """Add an effect to a model, fit both to the readings and weigh them.

    Args:
        added: an effect or its id; None fits the model as it is.
        model: to start from; default: the campaign's, else a 50 mm bell.
        posterior, seed: as for ``diagnose``.

    Raises:
        ModelError: the effect is not known, or the model has it already.
    """
    if isinstance(added, str):
        added = effect_class(added)
    start, known, doubts = _start(campaign, model, posterior)
    found = refitted(campaign, start, added, EFFECTS, seed, progress, known)
    return replace(found, remarks=(*_about(found), *doubts, *found.remarks))


def _about(found: Diagnosis) -> tuple[str, ...]:
    """What is simply wrong with the data and does not stop the diagnosis, which would say it."""
    return tuple(sentence for sentence, stops in found.study.mistakes if not stops)


def _start(
    campaign: Campaign, model: DepositionModel | None, posterior: Posterior | None
) -> tuple[DepositionModel, Posterior | None, tuple[str, ...]]:
    """The model to start from, by which all parts get paint, what is known of it, warnings."""
    if model is None and campaign.model_file:
        file = read_model_file(campaign.model_file, load_unnamed_effect_file)
        model, posterior = file.model, posterior or file.posterior
    given = model or DepositionModel()
    start = with_brushes_of(campaign, given)
    doubts = require_paint(campaign, start)
    return start, of_brushes(posterior, given, start), doubts


def _model_of(campaign: Campaign) -> DepositionModel | None:
    if not campaign.model_file:
        return None
    return read_model(campaign.model_file, load_unnamed_effect_file)


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
    without_refused_states(trajectory, model, strict=True)
    model = model.of_numbers(trajectory.brushes).single('a choice of points')
    seen = look_at(surface, trajectory, model, max_pose_gap_s=max_pose_gap_s)
    library = dict(EFFECTS) | {effect.id: effect for effect in own_effects}
    part = UnmeasuredPart(seen.surface, seen.path, model, library, posterior)
    return choose(part, request.points, request.repeats, request.foot_m, request.seed, progress)

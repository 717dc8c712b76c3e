"""What readings say of a model on disk: figures, residuals, models, effect files, the report."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from paint_deposition.effects.base import Effect
from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.effects.closed_forms import (
    ClosedForm,
    Parameter,
    at_knots,
    variable,
)
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.effects.learned_curves import LearnedCurve
from paint_deposition.effects.learned_laws import LEAST_FACTOR, LearnedLaw
from paint_deposition.files.atomic import filled, write_json, write_text
from paint_deposition.files.gauge_readings import write_table
from paint_deposition.files.model_file import ModelFile, write_model
from paint_deposition.files.provenance import origin
from paint_deposition.inference.comparison.comparison import Comparison, SideBySide
from paint_deposition.inference.diagnosis.verdict import Diagnosis, Step
from paint_deposition.inference.fitting.calibration import Calibration
from paint_deposition.inference.fitting.estimates import Estimate, estimates
from paint_deposition.inference.fitting.least_squares import Fit
from paint_deposition.inference.fitting.parameters import Posterior
from paint_deposition.inference.fitting.pattern_vector import PATTERN_NAMES
from paint_deposition.inference.fitting.posterior import with_mean_level
from paint_deposition.inference.fitting.study import Study
from paint_deposition.report.data import ReportData, history_as_list
from paint_deposition.report.drawing import save_picture
from paint_deposition.report.page import report_html
from paint_deposition.report.readings_pictures import comparison_figure, write_calibration_pictures
from paint_deposition.report.write import written

# What a law is over, in the words of an effect's code, and the family of such effects.
VARIABLES = {
    'incidence_deg': ('ray.cos_incidence', 'incidence'),
    'standoff_ratio': ('ray.standoff_ratio', 'standoff'),
    'time_s': ('path.time_s', 'time'),
    'spray_pass': ('np.where(np.isnan(path.time_s), np.nan, path.passes_before + 1.0)', 'order'),
    'stroke_end_m': ('np.minimum(path.from_turn_m, path.to_turn_m)', 'boundary'),
    'since_trigger_s': ('path.since_on_s', 'boundary'),
    'speed_m_per_s': ('path.speed_m_per_s', 'time'),
    'curvature_per_m': ('points.curvature_per_m', 'curvature'),
    'edge_distance_m': ('points.edge_distance_m', 'boundary'),
    'sky_view_factor': ('points.sky_view_factor', 'visibility'),
    'height_fraction': ('points.height_fraction', 'order'),
    'across_m': ('places_m(points)[:, 0]', 'lateral shift'),
    'film_um': ('film_um', 'level'),
}
# An amplitude may become so many times as far from neutral, a shape so many times as long.
ROOM = 10.0


@written.register
def _write_calibration(
    result: Calibration, folder: Path, start: ModelFile | None = None, pictures: str = 'png'
) -> list[Path]:
    model_file, figures = folder / 'model.yaml', folder / 'calibration.json'
    study = result.study
    names = ', '.join(experiment.name for experiment in study.campaign.experiments)
    header = [
        f'Calibrated on {len(study)} points ({names}).',
        *(f'Warning: {warning}.' for warning in result.warnings),
    ]
    step = Step.of(study, '', result.fit)
    known = result.posterior, result.parameters
    write_fitted(model_file, study, [step], *known, start, '\n'.join(header))
    write_json(figures, result.to_dict() | _provenance(study, result.model))
    return [model_file, figures, *write_calibration_pictures(folder, result, pictures)]


@written.register(Comparison)
@written.register(SideBySide)
def _write_comparison(
    result: Comparison | SideBySide, folder: Path, pictures: str = 'png'
) -> list[Path]:
    figures = result.to_dict()
    return _write_results(folder, 'comparison.json', figures, ReportData(result), pictures)


@written.register
def _write_diagnosis(
    result: Diagnosis, folder: Path, start: ModelFile | None = None, pictures: str = 'png'
) -> list[Path]:
    start = start or ModelFile(result.history[0].model)
    models = [folder / 'model_before.yaml', folder / 'model.yaml']
    for file, steps in zip(models, (result.history[:1], result.history), strict=True):
        fit = steps[-1].fit
        off = with_mean_level(fit, result.study.campaign)
        known = result.posterior_at(steps[-1]), estimates(fit, off)
        write_fitted(file, result.study, steps, *known, start)
    data = ReportData(result, start.history)
    return models + _write_results(folder, 'diagnosis.json', result.to_dict(), data, pictures)


def _provenance(
    study: Study, model: DepositionModel | Mapping[str, DepositionModel]
) -> dict[str, Any]:
    campaign = study.campaign
    files = {'start model': campaign.model_file or ''}
    for experiment in campaign.experiments:
        files |= {f'{experiment.name}: {kind}': file for kind, file in experiment.files.items()}
    name = campaign.name if Path(campaign.name).is_file() else ''
    return {'provenance': origin(model, files, name)}


def _write_results(
    folder: Path, name: str, figures: dict[str, Any], data: ReportData, pictures: str
) -> list[Path]:
    """Figures, picture, report, and residuals: of the last model, or of each side by side."""
    beside = data.beside.by_name if data.beside else {}
    models = {name: comparison.model for name, comparison in beside.items()}
    residuals = {f'residuals_{file_name(name)}.csv': one for name, one in beside.items()}
    residuals = residuals or {'residuals.csv': data.comparisons[-1]}
    write_json(folder / name, figures | _provenance(data.study, models or data.model))
    for file, comparison in residuals.items():
        columns = comparison.columns()
        rows = [[*columns]]
        # A row a reading; those that were left out are without a prediction.
        for row in zip(*columns.values(), strict=True):
            told = dict(zip(columns, row, strict=True))
            for column in ('x_m', 'y_m', 'z_m'):
                told[column] = f'{told[column]:.5f}'
            for column in ('thickness_um', 'predicted_um', 'residual_um', 'sigma_um'):
                told[column] = '' if np.isnan(told[column]) else f'{told[column]:.3f}'
            rows.append([*map(str, (told | {'used': int(told['used'])}).values())])
        write_table(folder / file, rows)
    picture = save_picture(comparison_figure(data), folder / f'comparison.{pictures}')
    write_text(folder / 'report.html', report_html(data))
    return [*(folder / file for file in (name, *residuals)), picture, folder / 'report.html']


def file_name(name: str) -> str:
    """An experiment's name without what file systems do not like."""
    return re.sub(r'[^\w.-]+', '_', name).strip('._') or 'experiment'


def write_fitted(
    path: str | Path,
    study: Study,
    steps: Sequence[Step],
    posterior: Posterior,
    values: Sequence[Estimate],
    start: ModelFile | None = None,
    header_comment: str = '',
) -> None:
    """Write the last step's model; an older file is replaced at once.

    Fitted numbers are rounded to ``DIGITS`` significant digits, all others stay as given.

    Args:
        path: YAML.
        study: the readings that it was fitted to.
        steps: the models, the start model, refitted, first.
        posterior: of the last one.
        values: its parameters with their uncertainties.
        start: what was started from: the name stays, the history goes on, and uncertainties
            stay where the fit has no newer ones.
        header_comment: lines to put at the top.
    """
    start = start or ModelFile(steps[0].model)
    fit = steps[-1].fit
    history = history_as_list(study, steps, start.history)
    # Standard deviations, in the sections of the model.
    uncertainty = {
        key: dict(value) for key, value in start.uncertainty.items() if isinstance(value, Mapping)
    }
    for value in values:
        section, _, name = value.name.rpartition('.')
        section = 'planar' if value.name in PATTERN_NAMES else section
        uncertainty.setdefault(section, {})[name] = float(f'{value.sigma:.3g}')
    fitted = _rounded(fit, steps[0].model.effects)
    few = {name: _short(getattr(posterior, name)) for name in ('mean', 'covariance')}
    fitted_numbers = {brush.number for brush in fitted.brushes}
    others = [brush for brush in start.model.brushes if brush.number not in fitted_numbers]
    whole = fitted
    if others:
        whole = DepositionModel(
            brushes=(*fitted.brushes, *others), projection=fitted.projection,
            effects=fitted.effects,
        )  # fmt: skip
    # A posterior of some brushes only would be taken for that of all.
    known = None if others else posterior.model_copy(update=few)
    write_model(path, whole, header_comment, history, uncertainty, start.name, known)


def _rounded(fit: Fit, given: Sequence[Effect]) -> DepositionModel:
    """The fitted model with what was fitted at few digits, within its bounds.

    Learned laws among the ``given`` effects were not learned here and stay as they are.
    """
    model = fit.model.with_patterns(
        p.model_copy(update={name: _short(getattr(p, name)) for name in PATTERN_NAMES})
        for p in fit.model.patterns
    )
    for effect in model.effects:
        if isinstance(effect, LearnedLaw) and effect not in given:
            # The numbers of a learned law.
            values = {
                n: _short(v) for n, v in effect if isinstance(v, float) or n in ('learned', 'sd')
            }
        else:
            values = {
                name: min(max(_short(getattr(effect, name)), info['low']), info['high'])
                for name, info in effect.parameters().items()
                if (effect.id, name) in fit.parameters.varied
            }
        model = model.with_effect(effect.model_copy(update=values))
    return model


def _short(value: Any) -> Any:
    """A value, list or mapping with few digits in all its numbers."""
    if isinstance(value, float):
        # Eight digits leave the film within 1e-6 of its peak; the uncertainty is far larger.
        return float(f'{value:.8g}')
    if isinstance(value, dict):
        return {name: _short(one) for name, one in value.items()}
    return type(value)(map(_short, value))


def effect_entry(form: ClosedForm, file: str | Path) -> str:
    """What stands in a model file for the effect of a form: its file and its values."""
    return f'file: {file}, ' + ', '.join(f'{n}: {p.value:.6g}' for n, p in form.parameters.items())


def write_effect_file(path: Path, law: LearnedCurve, form: ClosedForm) -> Path:
    """Write a form of a learned law as an effect; absent at its defaults.

    Args:
        path: the file, named for the effect.
        law: what was learned.
        form: one of those that fit it.
    """
    value, family = VARIABLES[law.covariate]
    effect_id = re.sub(r'\W+', '_', path.stem.lower()).strip('_') or 'learned'
    if effect_id in EFFECTS or not effect_id[0].isalpha():
        effect_id = f'learned_{effect_id}'
    acts_on = 'path' if type(law).on_path is not LearnedCurve.on_path else 'film'
    (name, unit), knots = variable(type(law)), at_knots(law)
    template = Path(__file__).parent / 'templates' / 'effect.py.j2'
    text = filled(
        template, law=law, form=form, id=effect_id, family=family, value=value, file=path.name,
        entry=effect_entry(form, path.name).partition(', ')[2],
        acts_on='ray' if law.flux_factor is not None else acts_on,
        functions=', '.join(one for one in ('exp', 'log') if f'{one}(' in form.code),
        variable=name if unit == '1' else f'{name} [{unit}]', lowest=LEAST_FACTOR,
        low=f'{float(knots.min()):.6}', high=f'{float(knots.max()):.6}', bounds=_bounds,
        literal=repr,
    )  # fmt: skip
    write_text(path, text)
    return path


def _bounds(found: Parameter) -> str:
    """Default and bounds of a parameter of the effect, wide about what was learned."""
    value, neutral = float(f'{found.value:.6g}'), float(f'{found.neutral:.6g}')
    if found.role == 'shape':
        role, low, high = "role='shape'", value / ROOM, value * ROOM
    else:
        least = 0.1 if neutral else 1e-3
        away = ROOM * max(abs(value - neutral), least)
        typical = value if value != neutral else neutral + least
        role, low, high = f'typical={typical}', neutral - away, neutral + away
        low = max(low, 0.0) if found.role == 'level' else low
    return f'{neutral}, low={low:.4g}, high={high:.4g}, {role}'

"""Commands that set the model against readings: `calibrate`, `compare`, `diagnose`, `refit`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import click

import paint_deposition as pd
from paint_deposition.cli.model_choice import campaign_model_words
from paint_deposition.cli.options import (
    CAMPAIGN,
    FILE,
    JSON,
    PART_POSE,
    PICTURES,
    file_lines,
    geometry_lines,
    model_option,
    output_option,
    read_inputs,
    say_all,
    say_geometry,
    say_results,
    seed_option,
    write_results,
)
from paint_deposition.cli.progress import Progress
from paint_deposition.errors import PaintError

OUTPUT = output_option('the results')
MODEL = model_option("Model to start from; default: the campaign's, else that of a 50 mm bell.")
SEED = seed_option(
    'the starts of the fits and of the simulated deviations behind the p-value; other draws are '
    'always the same'
)


@click.command('calibrate')
@CAMPAIGN
@MODEL
@output_option('model.yaml, calibration.json and pictures')
@seed_option('the starts of the fit')
@PART_POSE
@PICTURES
@JSON
def calibrate_command(
    campaign: Path,
    model_file: Path | None,
    output: Path,
    seed: int,
    part_pose: list[float] | None,
    pictures: str,
    as_json: bool,
) -> None:
    """Fit the bell's pattern to the gauge readings of CAMPAIGN.

    Any number of panels and parts may be in it; a flat panel painted by a few passes is best. The
    effects of the model to start from are fitted as well; its projection is kept.
    """
    with Progress('calibrate') as show:
        data, start = read_inputs(campaign, model_file, show, part_pose)
        result = pd.calibrate(data, start.model if start else None, seed=seed, progress=show)
        show('writing')
        files = write_results(result, output, start=start, pictures=pictures)
    say_geometry(result)
    if not as_json:
        say_all('note', data.understood)
        say_all('warning', result.warnings)
    lines = [*_calibration_lines(result), *file_lines(files)]
    words = campaign_model_words(data, model_file, start, 'fitted to the campaign, from')
    say_results(files, as_json, lines, model=words)


def _calibration_lines(result: pd.Calibration) -> Iterator[str]:
    yield from geometry_lines(result)
    for value in result.parameters:
        mark = '' if value.determined else '   not determined'
        yield f'{value.name:>14} = {value.value:.4g}  ({value.low:.4g} to {value.high:.4g}){mark}'
    for experiment, found in zip(result.study.campaign.experiments, result.residuals, strict=True):
        yield (
            f'{experiment.name}: {len(found)} points, mean {found.measured_um.mean():.2f} µm '
            f'measured, {found.predicted_um.mean():.2f} predicted, residual SD '
            f'{found.sd_um:.2f} µm'
        )
    noise = result.study.noise
    yield (
        f'chi2 per degree of freedom {result.chi_square_per_freedom:.2f}, gauge noise '
        f'{noise.typical_um:.2f} µm ({noise.source})'
    )


@click.command('compare')
@CAMPAIGN
@click.option(
    '--model', 'model_files', type=FILE, multiple=True,
    help="Model to judge as it is; default: the campaign's, else one fitted to it. Repeated, the "
    'models are set side by side.',
)  # fmt: skip
@OUTPUT
@PART_POSE
@PICTURES
@JSON
def compare_command(
    campaign: Path,
    model_files: tuple[Path, ...],
    output: Path,
    part_pose: list[float] | None,
    pictures: str,
    as_json: bool,
) -> None:
    """Set the model beside the gauge readings of CAMPAIGN and say where it is off.

    Writes comparison.json, residuals.csv, the residual as coloured meshes, comparison.png and
    report.html. With several models there is a table of residuals for each, and no meshes.
    """
    several = len(model_files) > 1
    model_file = model_files[0] if len(model_files) == 1 else None
    with Progress('compare') as show:
        data, start = read_inputs(campaign, model_file, show, part_pose)
        result: pd.Comparison | pd.SideBySide
        if several:
            models = dict(zip(_names(model_files), map(pd.read_model, model_files), strict=True))
            result = pd.compare_models(data, models, progress=show)
        else:
            result = pd.compare(data, start.model if start else None, progress=show)
        show('writing the report')
        files = write_results(result, output, pictures=pictures)
    say_all('note', data.understood)
    if isinstance(result, pd.SideBySide):
        lines, words = _side_by_side_lines(result, output), ', '.join(map(str, model_files))
    else:
        say_geometry(result)
        say_all('warning', result.warnings)
        lines = _comparison_lines(result, output)
        words = campaign_model_words(data, model_file, start, fitted='')
    say_results(files, as_json, lines, model=words)


def _names(files: tuple[Path, ...]) -> list[str]:
    """What models are called: their files without the suffix, or the paths if two are alike."""
    names = [file.stem for file in files]
    names = names if len(set(names)) == len(names) else [str(file) for file in files]
    for name in names:
        if names.count(name) > 1:
            raise click.UsageError(f'--model {name} is given twice; give each model once')
    return names


def _side_by_side_lines(beside: pd.SideBySide, output: Path) -> Iterator[str]:
    width = max(len(name) for name in beside.by_name)
    parts = [e.name for e in next(iter(beside.by_name.values())).study.campaign.experiments]
    yield f'{"RMSE [µm]":{width}}  {"all":>10}' + ''.join(f'  {part:>10}' for part in parts)
    for name, comparison in beside.by_name.items():
        errors = [m.residuals.rmse_um for m in comparison.misfits if m.kind == 'experiment']
        cells = [comparison.points.rmse_um, *errors]
        yield f'{name:{width}}' + ''.join(f'  {value:10.2f}' for value in cells)
    yield f'nearest to the readings: {beside.best}'
    yield f'report: {output / "report.html"}'


def _comparison_lines(comparison: pd.Comparison, output: Path) -> Iterator[str]:
    yield from geometry_lines(comparison)
    for misfit in comparison.misfits:
        found, indent = misfit.residuals, '' if misfit.kind == 'experiment' else '  '
        yield (
            f'{indent}{misfit.label}: {len(found)} readings, bias {found.bias_um:+.2f} µm, '
            f'RMSE {found.rmse_um:.2f} µm, chi2 per reading {found.chi_square_per_reading:.2f}'
        )
    noise = comparison.study.noise
    yield f'gauge noise {noise.typical_um:.2f} µm ({noise.source})'
    for region in comparison.regions:
        yield f'misfit: {region.experiment}: {region.description}'
    if not comparison.regions:
        yield 'no region of significant misfit'
    for note in comparison.study.notes:
        yield f'note: {note}'
    yield f'report: {output / "report.html"}'


@click.command('diagnose')
@CAMPAIGN
@MODEL
@OUTPUT
@click.option(
    '--effect-file', 'effect_files', multiple=True, type=FILE,
    help='Python file with an effect of your own to consider as well; may be repeated.',
)  # fmt: skip
@SEED
@PART_POSE
@PICTURES
@JSON
def diagnose_command(effect_files: tuple[Path, ...], **given: Any) -> None:
    """Find out which physical effect the model of CAMPAIGN lacks, if any, and add it.

    Writes diagnosis.json, model.yaml with what was accepted, model_before.yaml without it,
    residuals.csv, the residual as coloured meshes, comparison.png and report.html.
    """
    from paint_deposition.effects.user_effects import load_effect_file

    own = [load_effect_file(file) for file in effect_files]

    def diagnosed(data: pd.Campaign, *start: Any, **options: Any) -> pd.Diagnosis:
        return pd.diagnose(data, *start, own_effects=own, **options)

    _diagnose(Progress('diagnose'), diagnosed, **given)


@click.command('refit')
@CAMPAIGN
@click.option(
    '--add', 'effect', required=True,
    help="Effect to add: an id, a Python file with one of your own, or a law to learn over a "
    "covariate, as learned:time_s; 'none' refits only.",
)  # fmt: skip
@click.option(
    '--as-effect', 'effect_file', type=click.Path(path_type=Path, dir_okay=False),
    metavar='FILE.py',
    help='Python file to make: the law learned, in the most probable closed form that fits '
    'within its band, as an effect of your own.',
)  # fmt: skip
@MODEL
@OUTPUT
@SEED
@PART_POSE
@PICTURES
@JSON
def refit_command(effect: str, effect_file: Path | None, **given: Any) -> None:
    """Add an effect to the model, fit it to CAMPAIGN anew and show the error before and after.

    Writes model.yaml with its history, report.html and the other files that diagnose writes. To go
    on from there, give that model.yaml as --model.
    """
    from paint_deposition.effects.catalogue import effect_class
    from paint_deposition.effects.user_effects import load_effect_file

    if effect == 'none':
        added = None
    else:
        added = load_effect_file(Path(effect)) if effect.endswith('.py') else effect_class(effect)
    _require_place_for(effect_file, effect, added)

    def refitted(data: pd.Campaign, *start: Any, **options: Any) -> pd.Diagnosis:
        return pd.refit(data, added, *start, **options)

    _diagnose(Progress('refit'), refitted, effect_file=effect_file, **given)


def _require_place_for(effect_file: Path | None, effect: str, added: Any) -> None:
    """Refuse what cannot become an effect file, before anything is computed."""
    from paint_deposition.effects.learned.curves import LearnedCurve

    if effect_file is None:
        return
    if not (isinstance(added, type) and issubclass(added, LearnedCurve)):
        raise click.UsageError(
            f'--as-effect is for a law learned over one covariate, and --add is {effect}; give '
            '--add learned:COVARIATE, as learned:time_s'
        )
    if effect_file.suffix != '.py':
        raise click.UsageError(f'--as-effect {effect_file}: give a name that ends in .py')
    if effect_file.exists():
        raise click.UsageError(f'--as-effect {effect_file} is there already; give another name')


def _write_as_effect(diagnosis: pd.Diagnosis, effect_file: Path) -> str:
    """Write the law learned last as an effect, and say how to use it."""
    from paint_deposition.effects.learned.curves import LearnedCurve
    from paint_deposition.inference.diagnosis.closed_forms import forms_of
    from paint_deposition.report.writers.effect_file import effect_entry, write_effect_file

    law = next(iter(diagnosis.model.effects[::-1]), None)
    forms = forms_of(law)
    if not forms or not isinstance(law, LearnedCurve):
        raise PaintError(
            f'--as-effect {effect_file}: no closed form of few parameters fits the law within '
            'its band; use the curve itself, which stands in model.yaml if the fit was sound'
        )
    write_effect_file(effect_file, law, forms[0])
    return f'effect file: {forms[0].formula}; in a model {{{effect_entry(forms[0], effect_file)}}}'


def _diagnose(
    progress: Progress,
    diagnosed: Callable[..., pd.Diagnosis],
    campaign: Path,
    model_file: Path | None,
    output: Path,
    seed: int,
    part_pose: list[float] | None,
    pictures: str,
    as_json: bool,
    effect_file: Path | None = None,
) -> None:
    with progress as show:
        data, start = read_inputs(campaign, model_file, show, part_pose)
        model, posterior = (start.model, start.posterior) if start else (None, None)
        diagnosis = diagnosed(data, model, posterior=posterior, seed=seed, progress=show)
        show('comparing before and after')
        _ = diagnosis.comparisons
        show('writing the report')
        files = write_results(diagnosis, output, start=start, pictures=pictures)
    say_all('note', data.understood)
    say_geometry(diagnosis)
    say_all('warning', diagnosis.warnings)
    words = campaign_model_words(data, model_file, start, 'fitted to the campaign, from')
    lines = [*_diagnosis_lines(diagnosis, output)]
    if effect_file:
        lines.append(_write_as_effect(diagnosis, effect_file))
    say_results(files, as_json, lines, model=words)


def _diagnosis_lines(diagnosis: pd.Diagnosis, output: Path) -> Iterator[str]:
    from paint_deposition.effects.learned.curves import LearnedCurve
    from paint_deposition.effects.learned.law import LearnedLaw
    from paint_deposition.report.words import (
        effect_name,
        form_words,
        learned_words,
        probability_words,
        separation_words,
    )

    yield f'{diagnosis.verdict.replace("_", " ")}: {diagnosis.reason}'
    if diagnosis.p_value < 1.0:
        yield f'p-value of nothing missing: {diagnosis.p_value:.4f}'
    for effects in diagnosis.classes:
        label = 'added ' if effects.best in diagnosis.accepted else ''
        others = f' (or {", ".join(effects.members[1:])})' if len(effects.members) > 1 else ''
        yield f'  {label}{effects.best}: {probability_words(effects)}{others}'
        law = diagnosis.model.effect(effects.best)
        if isinstance(law, LearnedLaw):
            shape = ', '.join(' '.join(words).rstrip() for words in learned_words(law))
            yield f'    {effect_name(law.id)}: {shape}'
            if isinstance(law, LearnedCurve) and law.sd:
                yield f'    {form_words(law)}'
        for name, value in effects.parameters.items():
            yield f'    {name} = {value.value:.4g} ({value.low:.4g} to {value.high:.4g})'
    before, after = diagnosis.history[0], diagnosis.history[-1]
    yield (
        f'RMSE {before.holdout_rmse_um:.2f} -> {after.holdout_rmse_um:.2f} µm on '
        f'{diagnosis.left_out} left out, {before.rmse_um:.2f} -> {after.rmse_um:.2f} µm on the '
        f'fitted points; gauge and texture {diagnosis.noise_floor_um:.2f} µm'
    )
    yield from (f'worse than before: {one}' for one in diagnosis.worse)
    if diagnosis.pattern_shift:
        yield f'pattern moved {diagnosis.pattern_shift}'
    for amount in diagnosis.random_effects:
        if amount.is_notable:
            yield f'{amount}'
    for region in diagnosis.comparisons[0].regions:
        yield f'misfit before: {region.experiment}: {region.description}'
    for spray in diagnosis.proposals[1][:2]:
        todo = f'spray {spray.what}, and measure {spray.readings} points'
        yield f'next: {todo}: {separation_words(spray)}'
    if diagnosis.not_testable:
        yield f'not testable with these readings: {", ".join(diagnosis.not_testable)}'
    for note in (*diagnosis.study.notes, *diagnosis.left_over):
        yield f'note: {note}'
    yield from geometry_lines(diagnosis)
    yield f'model: {output / "model.yaml"}'
    yield f'report: {output / "report.html"}'

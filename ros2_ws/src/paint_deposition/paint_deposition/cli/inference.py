"""Commands that set the model against readings: `compare`, `diagnose` and `refit`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click

import paint_deposition as pd
from paint_deposition.cli.model_choice import campaign_model_words
from paint_deposition.cli.options import (
    CAMPAIGN,
    FILE,
    JSON,
    PART_POSE,
    PICTURES,
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
from paint_deposition.report.drawing import DrawingProcess

if TYPE_CHECKING:
    from paint_deposition.files.model_file import ModelFile

OUTPUT = output_option('the results')
MODEL = model_option("Model to start from; default: the campaign's, else that of a 50 mm bell.")
SEED = seed_option(
    'the starts of the fits and of the simulated deviations behind the p-value; other draws are '
    'always the same'
)
OWN_EFFECTS = click.option(
    '--effect-file', 'effect_files', multiple=True, type=FILE,
    help='Python file with an effect of your own to consider as well; may be repeated.',
)  # fmt: skip


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
    with Progress('compare') as tell, DrawingProcess('profiles') as drawing:
        if len(model_files) > 1:
            data, _ = read_inputs(campaign, None, tell, part_pose)
            models = dict(zip(_names(model_files), map(pd.read_model, model_files), strict=True))
            beside = pd.compare_models(data, models, progress=tell)
            tell('writing the report')
            files = write_results(beside, output, pictures=pictures, drawing=drawing)
            words = ', '.join(map(str, model_files))
            say_results(files, as_json, _side_by_side_lines(beside, output), model=words)
            return
        model_file = model_files[0] if model_files else None
        data, start = read_inputs(campaign, model_file, tell, part_pose)
        comparison = pd.compare(data, start.model if start else None, progress=tell)
        tell('writing the report')
        files = write_results(comparison, output, pictures=pictures, drawing=drawing)
    say_all('note', data.understood)
    say_geometry(comparison)
    say_all('warning', comparison.warnings)
    words = campaign_model_words(data, model_file, start, fitted='')
    say_results(files, as_json, _comparison_lines(comparison, output), model=words)


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
@OWN_EFFECTS
@SEED
@PART_POSE
@PICTURES
@JSON
def diagnose_command(
    campaign: Path,
    model_file: Path | None,
    output: Path,
    effect_files: tuple[Path, ...],
    seed: int,
    part_pose: list[float] | None,
    pictures: str,
    as_json: bool,
) -> None:
    """Find out which physical effect the model of CAMPAIGN lacks, if any, and add it.

    Writes diagnosis.json, model.yaml with what was accepted, model_before.yaml without it,
    residuals.csv, the residual as coloured meshes, comparison.png and report.html.
    """
    from paint_deposition.effects.user_effects import load_effect_file

    own = [load_effect_file(file) for file in effect_files]
    with Progress('diagnose') as tell, DrawingProcess('profiles') as drawing:
        data, start = read_inputs(campaign, model_file, tell, part_pose)
        diagnosis = pd.diagnose(
            data, start.model if start else None, posterior=start.posterior if start else None,
            own_effects=own, seed=seed, progress=tell,
        )  # fmt: skip
        files = _write(diagnosis, output, start, tell, pictures, drawing)
    say_all('note', data.understood)
    say_geometry(diagnosis)
    say_all('warning', diagnosis.warnings)
    words = campaign_model_words(data, model_file, start, 'fitted to the campaign, from')
    say_results(files, as_json, _diagnosis_lines(diagnosis, output), model=words)


@click.command('refit')
@CAMPAIGN
@click.option(
    '--add', 'effect', required=True,
    help="Effect to add: an id, a Python file with one of your own, or a law to learn over a "
    "covariate, as learned:time_s; 'none' refits only.",
)  # fmt: skip
@MODEL
@OUTPUT
@SEED
@PART_POSE
@PICTURES
@JSON
def refit_command(
    campaign: Path,
    effect: str,
    model_file: Path | None,
    output: Path,
    seed: int,
    part_pose: list[float] | None,
    pictures: str,
    as_json: bool,
) -> None:
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
    with Progress('refit') as tell, DrawingProcess('profiles') as drawing:
        data, start = read_inputs(campaign, model_file, tell, part_pose)
        diagnosis = pd.refit(
            data, added, start.model if start else None,
            posterior=start.posterior if start else None, seed=seed, progress=tell,
        )  # fmt: skip
        files = _write(diagnosis, output, start, tell, pictures, drawing)
    say_all('note', data.understood)
    say_geometry(diagnosis)
    say_all('warning', diagnosis.warnings)
    words = campaign_model_words(data, model_file, start, 'fitted to the campaign, from')
    say_results(files, as_json, _diagnosis_lines(diagnosis, output), model=words)


def _write(
    diagnosis: pd.Diagnosis,
    output: Path,
    start: ModelFile | None,
    tell: Progress,
    pictures: str,
    drawing: DrawingProcess,
) -> list[Path]:
    tell('comparing before and after')
    _ = diagnosis.comparisons
    tell('writing the report')
    return write_results(diagnosis, output, start=start, pictures=pictures, drawing=drawing)


def _diagnosis_lines(diagnosis: pd.Diagnosis, output: Path) -> Iterator[str]:
    from paint_deposition.effects.learned.law import LearnedLaw
    from paint_deposition.report.words import apart_words, effect_name, learned_words, sureness

    yield f'{diagnosis.verdict.replace("_", " ")}: {diagnosis.reason}'
    if diagnosis.p_value < 1.0:
        yield f'p-value of nothing missing: {diagnosis.p_value:.4f}'
    for effects in diagnosis.classes:
        label = 'added ' if effects.best in diagnosis.accepted else ''
        others = f' (or {", ".join(effects.members[1:])})' if len(effects.members) > 1 else ''
        yield f'  {label}{effects.best}: {sureness(effects)}{others}'
        law = diagnosis.model.effect(effects.best)
        if isinstance(law, LearnedLaw):
            shape = ', '.join(' '.join(words).rstrip() for words in learned_words(law))
            yield f'    {effect_name(law.id)}: {shape}'
        for name, value in effects.parameters.items():
            yield f'    {name} = {value.value:.4g} ({value.low:.4g} to {value.high:.4g})'
    before, after = diagnosis.history[0], diagnosis.history[-1]
    yield (
        f'RMSE {before.rmse_um:.2f} -> {after.rmse_um:.2f} µm on the fitted points, '
        f'{before.holdout_rmse_um:.2f} -> {after.holdout_rmse_um:.2f} µm on points left out; '
        f'gauge and texture {diagnosis.noise_floor_um:.2f} µm'
    )
    if diagnosis.pattern_shift:
        yield f'pattern moved {diagnosis.pattern_shift}'
    for amount in diagnosis.random_effects:
        if amount.is_notable:
            yield f'{amount}'
    for region in diagnosis.comparisons[0].regions:
        yield f'misfit before: {region.experiment}: {region.description}'
    for spray in diagnosis.proposals[1][:2]:
        todo = f'spray {spray.what}, and measure {spray.readings} points'
        yield f'next: {todo}: {apart_words(spray)}'
    if diagnosis.not_testable:
        yield f'not testable with these readings: {", ".join(diagnosis.not_testable)}'
    for note in diagnosis.study.notes:
        yield f'note: {note}'
    yield from geometry_lines(diagnosis)
    yield f'model: {output / "model.yaml"}'
    yield f'report: {output / "report.html"}'

"""Commands that set the model against readings: `compare`, `diagnose` and `refit`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from paint_deposition.cli.campaigns import Steps, read_noted
from paint_deposition.cli.options import CAMPAIGN, FILE, JSON, model_option, output_option

if TYPE_CHECKING:
    from paint_deposition.comparison.comparison import Comparison
    from paint_deposition.diagnosis.verdict import Diagnosis
    from paint_deposition.effects.base import Effect
    from paint_deposition.effects.deposition_model import DepositionModel
    from paint_deposition.files.model_file import ModelFile
    from paint_deposition.fitting.study import Study
    from paint_deposition.readings.campaign import Campaign

OUTPUT = output_option(
    'Folder for the results; made if it is not there, results in it are replaced.', required=True
)
MODEL = model_option("Model to start from; default: the campaign's, else a 50 mm bell.")
SEED = click.option('--seed', default=0, show_default=True, help='Of all random draws.')
OWN_EFFECTS = click.option(
    '--effect-file', 'effect_files', multiple=True, type=FILE,
    help='Python file with an effect of your own to consider as well; may be repeated.',
)  # fmt: skip


@click.command('compare')
@CAMPAIGN
@model_option("Model to judge, as it is; default: the campaign's, else one fitted to it.")
@OUTPUT
@JSON
def compare_command(campaign: Path, model_file: Path | None, output: Path, as_json: bool) -> None:
    """Set the model beside the gauge readings of CAMPAIGN and say where it is off.

    Writes comparison.json, residuals.csv, the residual as coloured meshes, comparison.png and
    report.html.
    """
    from paint_deposition.comparison.comparison import compare
    from paint_deposition.effects.deposition_model import DepositionModel
    from paint_deposition.files.json_files import json_text, write_json
    from paint_deposition.fitting.parameters import FreeParameters
    from paint_deposition.fitting.study import Study
    from paint_deposition.report.page.report import write_report
    from paint_deposition.results.inference import comparison_as_dict, write_residuals

    with Steps('compare') as tell:
        data = read_noted(campaign, tell)
        start = _start(data, model_file)
        study = Study.of(data, start.model.effects if start else ())
        if start:
            model = start.model
        else:
            tell('fitting the pattern')
            model = study.fit(FreeParameters.of(DepositionModel()), starts=10).model
        tell('comparing')
        comparison = compare(study, model)
        content = comparison_as_dict(comparison)
        tell('writing the report')
        write_json(output / 'comparison.json', content)
        write_residuals(output / 'residuals.csv', study, comparison)
        _write_pictures(output, study, [(model, comparison)])
        write_report(output / 'report.html', study, [(model, comparison)])
    if as_json:
        click.echo(json_text(content))
    else:
        _say_comparison(comparison, output)


def _say_comparison(comparison: Comparison, output: Path) -> None:
    for misfit in comparison.misfits:
        found, indent = misfit.residuals, '' if misfit.kind == 'experiment' else '  '
        click.echo(
            f'{indent}{misfit.label}: {len(found)} readings, bias {found.bias_um:+.2f} um, '
            f'RMSE {found.rmse_um:.2f} um, chi2 per reading {found.chi_square_per_reading:.2f}'
        )
    noise = comparison.study.noise
    click.echo(f'gauge noise {noise.typical_um:.2f} um ({noise.source})')
    for region in comparison.regions:
        click.echo(f'misfit: {region.experiment}: {region.description}')
    if not comparison.regions:
        click.echo('no region of significant misfit')
    for note in comparison.study.notes:
        click.echo(f'note: {note}')
    click.echo(f'report: {output / "report.html"}')


@click.command('diagnose')
@CAMPAIGN
@MODEL
@OUTPUT
@OWN_EFFECTS
@SEED
@JSON
def diagnose_command(
    campaign: Path,
    model_file: Path | None,
    output: Path,
    effect_files: tuple[Path, ...],
    seed: int,
    as_json: bool,
) -> None:
    """Find out which physical effect the model of CAMPAIGN lacks, if any, and add it.

    Writes diagnosis.json, model.yaml with what was accepted, model_before.yaml without it,
    residuals.csv, the residual as coloured meshes and report.html.
    """
    from paint_deposition.diagnosis.procedure import diagnose
    from paint_deposition.effects.catalogue import EFFECTS

    library = dict(EFFECTS) | {e.id: e for e in _own(effect_files)}
    with Steps('diagnose') as tell:
        data = read_noted(campaign, tell)
        start = _start_or_default(data, model_file)
        diagnosis = diagnose(data, start.model, library, seed, tell)
        content = _write_diagnosis(output, diagnosis, library, start, tell)
    _say(diagnosis, content, output, as_json)


@click.command('refit')
@CAMPAIGN
@click.option(
    '--add', 'effect', required=True,
    help="Effect to add: an id, or a Python file with one of your own; 'none' refits only.",
)  # fmt: skip
@MODEL
@OUTPUT
@SEED
@JSON
def refit_command(
    campaign: Path, effect: str, model_file: Path | None, output: Path, seed: int, as_json: bool
) -> None:
    """Add an effect to the model, fit it to CAMPAIGN anew and show the error before and after.

    Writes model.yaml with its history, residuals.csv, the residual as coloured meshes,
    comparison.png and report.html. To go on from there, give that model.yaml as --model.
    """
    from paint_deposition.diagnosis.refit import refit
    from paint_deposition.effects.catalogue import EFFECTS, effect_class

    if effect == 'none':
        added = None
    elif effect.endswith('.py'):
        (added,) = _own((Path(effect),))
    else:
        added = effect_class(effect)
    with Steps('refit') as tell:
        data = read_noted(campaign, tell)
        start = _start_or_default(data, model_file)
        diagnosis = refit(data, start.model, added, EFFECTS, seed, tell)
        content = _write_diagnosis(output, diagnosis, {}, start, tell)
    _say(diagnosis, content, output, as_json)


def _start(campaign: Campaign, model_file: Path | None) -> ModelFile | None:
    """The model named with --model, else the campaign's, if it names one."""
    from paint_deposition.files.model_file import read_model_file

    chosen = model_file or campaign.model_file
    return read_model_file(chosen) if chosen else None


def _start_or_default(campaign: Campaign, model_file: Path | None) -> ModelFile:
    from paint_deposition.effects.deposition_model import DepositionModel
    from paint_deposition.files.model_file import ModelFile

    return _start(campaign, model_file) or ModelFile(DepositionModel())


def _own(files: tuple[Path, ...]) -> list[type[Effect]]:
    from paint_deposition.effects.user_effects import load_effect_file

    return [load_effect_file(file) for file in files]


def _write_pictures(
    output: Path, study: Study, models: list[tuple[DepositionModel, Comparison]]
) -> None:
    from paint_deposition.report.pictures.profiles import write_comparison_picture
    from paint_deposition.results.residual_mesh import write_residual_meshes

    write_residual_meshes(output, study, models[-1][1])
    write_comparison_picture(output / 'comparison.png', study, models)


def _write_diagnosis(
    output: Path,
    diagnosis: Diagnosis,
    library: dict[str, type[Effect]],
    start: ModelFile,
    tell: Callable[[str], None],
) -> dict[str, Any]:
    from paint_deposition.comparison.comparison import compare
    from paint_deposition.diagnosis.next_experiment import propose_for
    from paint_deposition.files.json_files import write_json
    from paint_deposition.report.page.report import write_report
    from paint_deposition.results.fitted_model import write_fitted
    from paint_deposition.results.inference import diagnosis_as_dict, write_residuals

    tell('comparing before and after')
    study = diagnosis.study
    comparisons = [(step.model, compare(study, step.model)) for step in diagnosis.history]
    tell('looking for what to measure and spray next')
    places, sprays = propose_for(diagnosis, library)
    content = diagnosis_as_dict(diagnosis, comparisons[0][1].regions, places, sprays)
    tell('writing the report')
    write_json(output / 'diagnosis.json', content)
    write_fitted(output / 'model_before.yaml', study, diagnosis.history[:1], start)
    write_fitted(output / 'model.yaml', study, diagnosis.history, start)
    write_residuals(output / 'residuals.csv', study, comparisons[-1][1])
    _write_pictures(output, study, comparisons)
    write_report(output / 'report.html', study, comparisons, diagnosis, places, sprays,
                 start.history, library)  # fmt: skip
    return content


def _say(diagnosis: Diagnosis, content: dict[str, Any], output: Path, as_json: bool) -> None:
    from paint_deposition.files.json_files import json_text

    if as_json:
        click.echo(json_text(content))
        return
    click.echo(f'{diagnosis.verdict.replace("_", " ")}: {diagnosis.reason}')
    if diagnosis.p_value < 1.0:
        click.echo(f'p-value of nothing missing: {diagnosis.p_value:.4f}')
    for effects in diagnosis.classes:
        mark = 'added ' if effects.best in diagnosis.accepted else ''
        click.echo(
            f'  {mark}{effects.best}: {100 * effects.probability:.0f} %'
            + (f' (or {", ".join(effects.members[1:])})' if len(effects.members) > 1 else '')
        )
        for name, value in effects.parameters.items():
            click.echo(f'    {name} = {value.value:.4g} ({value.low:.4g} to {value.high:.4g})')
    errors = content['rmse_um']
    click.echo(
        f'RMSE {errors["before"]:.2f} -> {errors["after"]:.2f} um on the fitted points, '
        f'{errors["holdout_before"]:.2f} -> {errors["holdout_after"]:.2f} um on points left out; '
        f'gauge noise {errors["noise_floor"]:.2f} um'
    )
    for region in content['regions']:
        click.echo(f'misfit before: {region["experiment"]}: {region["description"]}')
    for spray in content['next']['spray'][:2]:
        click.echo(
            f'next: {spray["what"]}: {" and ".join(spray["separates"])} then differ by '
            f'{spray["separation_sigma"]:.1f} standard deviations, now '
            f'{spray["separation_now_sigma"]:.1f}'
        )
    if diagnosis.not_testable:
        click.echo(f'not testable with these readings: {", ".join(diagnosis.not_testable)}')
    for note in diagnosis.notes:
        click.echo(f'note: {note}')
    click.echo(f'model: {output / "model.yaml"}\nreport: {output / "report.html"}')

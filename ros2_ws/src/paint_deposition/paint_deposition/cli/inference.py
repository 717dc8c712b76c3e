"""Commands that set the model against readings: `compare`, `diagnose` and `refit`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from paint_deposition.cli.options import (
    CAMPAIGN,
    FILE,
    JSON,
    model_option,
    output_option,
    read_noted,
    read_start,
    say_all,
    seed_option,
)
from paint_deposition.cli.progress import Progress
from paint_deposition.cli.results_folder import results_in

if TYPE_CHECKING:
    from paint_deposition.comparison.comparison import Comparison
    from paint_deposition.diagnosis.verdict import Diagnosis
    from paint_deposition.files.model_file import ModelFile

OUTPUT = output_option('the results', required=True)
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
@model_option("Model to judge as it is; default: the campaign's, else one fitted to it.")
@OUTPUT
@JSON
def compare_command(campaign: Path, model_file: Path | None, output: Path, as_json: bool) -> None:
    """Set the model beside the gauge readings of CAMPAIGN and say where it is off.

    Writes comparison.json, residuals.csv, the residual as coloured meshes, comparison.png and
    report.html.
    """
    from paint_deposition.api.inference import compare
    from paint_deposition.api.writing import write
    from paint_deposition.files.json_files import json_text

    with Progress('compare') as tell:
        data = read_noted(campaign, tell)
        start = read_start(data, model_file)
        comparison = compare(data, start.model if start else None, progress=tell)
        tell('writing the report')
        with results_in(output) as folder:
            write(comparison, folder)
    if as_json:
        click.echo(json_text(comparison.to_dict()))
    else:
        _say_comparison(comparison, output)


def _say_comparison(comparison: Comparison, output: Path) -> None:
    for misfit in comparison.misfits:
        found, indent = misfit.residuals, '' if misfit.kind == 'experiment' else '  '
        click.echo(
            f'{indent}{misfit.label}: {len(found)} readings, bias {found.bias_um:+.2f} µm, '
            f'RMSE {found.rmse_um:.2f} µm, chi2 per reading {found.chi_square_per_reading:.2f}'
        )
    noise = comparison.study.noise
    click.echo(f'gauge noise {noise.typical_um:.2f} µm ({noise.source})')
    say_all(
        'misfit', (f'{region.experiment}: {region.description}' for region in comparison.regions)
    )
    if not comparison.regions:
        click.echo('no region of significant misfit')
    say_all('note', comparison.study.notes)
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
    residuals.csv, the residual as coloured meshes, comparison.png and report.html.
    """
    from paint_deposition.api.inference import diagnose
    from paint_deposition.effects.user_effects import load_effect_file

    own = [load_effect_file(file) for file in effect_files]
    with Progress('diagnose') as tell:
        data = read_noted(campaign, tell)
        start = read_start(data, model_file)
        diagnosis = diagnose(
            data, start.model if start else None, own_effects=own, seed=seed, progress=tell
        )
        _write(diagnosis, output, start, tell)
    _say(diagnosis, output, as_json)


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

    Writes model.yaml with its history, report.html and the other files that diagnose writes. To go
    on from there, give that model.yaml as --model.
    """
    from paint_deposition.api.inference import refit
    from paint_deposition.effects.catalogue import effect_class
    from paint_deposition.effects.user_effects import load_effect_file

    if effect == 'none':
        added = None
    else:
        added = load_effect_file(Path(effect)) if effect.endswith('.py') else effect_class(effect)
    with Progress('refit') as tell:
        data = read_noted(campaign, tell)
        start = read_start(data, model_file)
        diagnosis = refit(data, added, start.model if start else None, seed=seed, progress=tell)
        _write(diagnosis, output, start, tell)
    _say(diagnosis, output, as_json)


def _write(diagnosis: Diagnosis, output: Path, start: ModelFile | None, tell: Progress) -> None:
    from paint_deposition.api.writing import write

    tell('comparing before and after')
    _ = diagnosis.comparisons
    tell('looking for what to measure and spray next')
    _ = diagnosis.proposals
    tell('writing the report')
    with results_in(output) as folder:
        write(diagnosis, folder, start=start)


def _say(diagnosis: Diagnosis, output: Path, as_json: bool) -> None:
    from paint_deposition.diagnosis.verdict import percent
    from paint_deposition.files.json_files import json_text

    content = diagnosis.to_dict()
    if as_json:
        click.echo(json_text(content))
        return
    click.echo(f'{diagnosis.verdict.replace("_", " ")}: {diagnosis.reason}')
    if diagnosis.p_value < 1.0:
        click.echo(f'p-value of nothing missing: {diagnosis.p_value:.4f}')
    for effects in diagnosis.classes:
        label = 'added ' if effects.best in diagnosis.accepted else ''
        others = f' (or {", ".join(effects.members[1:])})' if len(effects.members) > 1 else ''
        click.echo(f'  {label}{effects.best}: {percent(effects.probability)}{others}')
        for name, value in effects.parameters.items():
            click.echo(f'    {name} = {value.value:.4g} ({value.low:.4g} to {value.high:.4g})')
    errors = content['rmse_um']
    click.echo(
        f'RMSE {errors["before"]:.2f} -> {errors["after"]:.2f} µm on the fitted points, '
        f'{errors["holdout_before"]:.2f} -> {errors["holdout_after"]:.2f} µm on points left out; '
        f'gauge noise {errors["noise_floor"]:.2f} µm'
    )
    say_all(
        'misfit before', (f'{r["experiment"]}: {r["description"]}' for r in content['regions'])
    )
    for spray in diagnosis.proposals[1][:2]:
        click.echo(
            f'next: {spray.what}: {" and ".join(spray.separates)} then differ by '
            f'{spray.separation:.1f} standard deviations, now {spray.now:.1f}'
        )
    if diagnosis.not_testable:
        click.echo(f'not testable with these readings: {", ".join(diagnosis.not_testable)}')
    say_all('note', diagnosis.notes)
    click.echo(f'model: {output / "model.yaml"}\nreport: {output / "report.html"}')

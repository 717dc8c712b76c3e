"""Commands that set the model against readings: `calibrate`, `compare`, `diagnose`, `refit`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import click

import paint_deposition as pd
from paint_deposition.cli import options
from paint_deposition.cli.models import chosen_model
from paint_deposition.cli.results import Results, print_all, progress, results_options
from paint_deposition.errors import PaintError

RESULTS = results_options('the results')
MODEL = options.model_option(
    "Model to start from; default: the campaign's, else that of a 50 mm bell."
)
SEED = options.seed_option(
    'the starts of the fits and of the simulated deviations behind the p-value; other draws are '
    'always the same'
)

# The strongest that `diagnose` prints.
MISFITS = 5


def _run(
    command: str,
    verb: Callable[..., Any],
    lines: Callable[[Any], Iterable[str]],
    campaign: Path,
    model_file: Path | None,
    part_pose: list[float] | None,
    results: Results,
    zones_file: Path | None = None,
    begins_with: Iterable[str] = ('model', 'posterior'),
    fitted: bool = True,
    words: str = '',
) -> Any:
    """Read a campaign and a model, compute, write, and say what came out.

    The ``verb`` takes of the model's file what it ``begins_with``, and ``lines`` put its result
    into words; it is returned. The line on the model says whether it was ``fitted``, or is
    ``words``.
    """
    with progress(command) as show:
        data = pd.read_campaign(
            campaign, show, part_pose,
            lambda kind, name, line: print_all(kind, [f'{name}: {line}']), zones_file,
        )  # fmt: skip
        named = model_file or data.model_file
        file, of_model = chosen_model(Path(named) if named else None, named=bool(model_file))
        start = file if named else None
        known = {name: getattr(start, name, None) for name in begins_with}
        result = verb(data, progress=show, **known)
        show('writing')
        more = {'start': start} if isinstance(result, pd.Calibration | pd.Diagnosis) else {}
        results.write(result, **more)
    # Of several models the parts, and so how the gun ran over them, are the same.
    first = next(iter(result.by_name.values())) if isinstance(result, pd.SideBySide) else result
    warnings, said = [*first.warnings], [*lines(result)]
    for name, found in first.geometry.items() if first is result else ():
        said.append(f'{name}: {found.sentence}')
        warnings += (f'{name}: {line}' for line in found.warnings)
    source = of_model if start else 'a 50 mm bell'
    begin = 'fitted to the campaign, from ' if fitted or start is None else ''
    results.print(said, words or begin + source, data.understood, warnings)
    return result


@click.command('calibrate')
@options.CAMPAIGN
@MODEL
@options.seed_option('the starts of the fit')
@options.PART_POSE
@options.ALLOW_EFFECTS
@results_options('model.yaml, calibration.json and pictures')
def calibrate_command(seed: int, **given: Any) -> None:
    """Fit the bell's pattern to the gauge readings of CAMPAIGN.

    Any number of panels and parts may be in it; a flat panel painted by a few passes is best. The
    effects of the model to start from are fitted as well; its projection is kept.
    """
    given |= {'begins_with': ['model']}
    _run('calibrate', partial(pd.calibrate, seed=seed), _calibration_lines, **given)


def _calibration_lines(result: pd.Calibration) -> Iterator[str]:
    from paint_deposition.model.eq3_collapse import sb50_m

    for value in result.parameters:
        mark = '' if value.determined else '   not determined'
        yield f'{value.name:>14} = {value.value:.4g}  ({value.low:.4g} to {value.high:.4g}){mark}'
    for planar in result.model.patterns:
        yield f'SB50 of one pass, along tool x: {1e3 * sb50_m(planar):.0f} mm'
    for experiment, own in zip(result.study.campaign.experiments, result.residuals, strict=True):
        yield (
            f'{experiment.name}: {len(own)} points, mean {own.measured_um.mean():.2f} µm '
            f'measured, {own.predicted_um.mean():.2f} predicted, residual SD {own.sd_um:.2f} µm'
        )
    noise = result.study.noise
    yield (
        f'chi2 per degree of freedom {result.chi_square_per_freedom:.2f}, gauge noise '
        f'{noise.typical_um:.2f} µm ({noise.source})'
    )
    found = result.discrepancy
    if found and found.footprint_of_peak and not result.is_incomplete:
        yield (
            'the footprint differs from eq. (1) by '
            f'{100.0 * found.footprint_of_peak:.0f} % of its peak; '
            'paint refit CAMPAIGN --add learned:footprint learns it'
        )


@click.command('compare')
@options.CAMPAIGN
@click.option(
    '--model', 'model_files', type=options.FILE, multiple=True,
    help="Model to compare, taken as it is; default: the campaign's, else one fitted to it. "
    'Repeated, the models are compared with each other.',
)  # fmt: skip
@click.option(
    '--zones', 'zones_file', type=options.FILE,
    help="Regions of the parts with a target and a tolerance of their own, YAML; default: the "
    "campaign's.",
)  # fmt: skip
@options.PART_POSE
@options.ALLOW_EFFECTS
@RESULTS
def compare_command(model_files: tuple[Path, ...], **given: Any) -> pd.Comparison | pd.SideBySide:
    """Compare the model with the gauge readings of CAMPAIGN and show where it is off.

    Writes comparison.json, residuals.csv, comparison.png and report.html. With several models
    there is a table of residuals for each.
    """
    if len(model_files) < 2:
        given |= {'model_file': next(iter(model_files), None), 'begins_with': ['model']}
        return _run('compare', pd.compare, _comparison_lines, fitted=False, **given)
    names = [file.stem for file in model_files]
    names = names if len(set(names)) == len(names) else [*map(str, model_files)]
    if twice := next((name for name in names if names.count(name) > 1), ''):
        raise click.UsageError(f'--model {twice} is given twice; give each model once')
    models = dict(zip(names, map(pd.read_model, model_files), strict=True))
    words, verb = ', '.join(map(str, model_files)), partial(pd.compare_models, models=models)
    given |= {'model_file': None, 'begins_with': [], 'words': words}
    return _run('compare', verb, _side_by_side_lines, **given)


def _side_by_side_lines(beside: pd.SideBySide) -> Iterator[str]:
    width = max(len(name) for name in beside.by_name)
    parts = [e.name for e in next(iter(beside.by_name.values())).study.campaign.experiments]
    yield f'{"RMSE [µm]":{width}}  {"all":>10}' + ''.join(f'  {part:>10}' for part in parts)
    for name, comparison in beside.by_name.items():
        misfits = comparison.misfits.items()
        errors = [found.rmse_um for (_, kind, _), found in misfits if kind == 'experiment']
        errors.insert(0, comparison.readings.rmse_um)
        yield f'{name:{width}}' + ''.join(f'  {value:10.2f}' for value in errors)
    yield f'smallest error: {beside.best}'


def _comparison_lines(comparison: pd.Comparison) -> Iterator[str]:
    for (_, kind, label), found in comparison.misfits.items():
        indent = '' if kind == 'experiment' else '  '
        yield (
            f'{indent}{label}: {len(found)} readings, bias {found.bias_um:+.2f} µm, '
            f'RMSE {found.rmse_um:.2f} µm, chi2 per reading {found.chi_square_per_reading:.2f}'
        )
    yield from (zone.sentence for zone in comparison.zones)
    noise = comparison.study.noise
    yield f'gauge noise {noise.typical_um:.2f} µm ({noise.source})'
    regions = [f'misfit: {one.experiment}: {one.description}' for one in comparison.regions]
    yield from regions or ['no region of significant misfit']
    yield from (f'note: {note}' for note in comparison.study.notes)


@click.command('diagnose')
@options.CAMPAIGN
@MODEL
@click.option(
    '--effect-file', 'effect_files', multiple=True, type=options.FILE,
    help='Python file with an effect of your own to consider as well; may be repeated.',
)  # fmt: skip
@SEED
@options.PART_POSE
@options.ALLOW_EFFECTS
@RESULTS
def diagnose_command(effect_files: tuple[Path, ...], seed: int, **given: Any) -> pd.Diagnosis:
    """Find out which physical effect the model of CAMPAIGN lacks, if any, and add it.

    Writes diagnosis.json, model.yaml with what was accepted, model_before.yaml without it,
    residuals.csv, comparison.png and report.html.
    """
    from paint_deposition.files.effect_file import load_effect_file

    own = [load_effect_file(file) for file in effect_files]
    verb = partial(pd.diagnose, own_effects=own, seed=seed)
    return _run('diagnose', verb, _diagnosis_lines, **given)


@click.command('refit')
@options.CAMPAIGN
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
@SEED
@options.PART_POSE
@options.ALLOW_EFFECTS
@RESULTS
def refit_command(effect: str, effect_file: Path | None, seed: int, **given: Any) -> None:
    """Add an effect to the model, refit it to CAMPAIGN and show the error before and after.

    Writes model.yaml with its history, report.html and the other files that diagnose writes. To go
    on from there, give that model.yaml as --model.
    """
    from paint_deposition.effects.catalogue import effect_class
    from paint_deposition.effects.closed_forms import forms_of
    from paint_deposition.effects.learned_curves import LearnedCurve
    from paint_deposition.files.effect_file import load_effect_file
    from paint_deposition.report.write_inference import effect_entry, write_effect_file

    added = None
    if effect != 'none':
        added = load_effect_file(Path(effect)) if effect.endswith('.py') else effect_class(effect)
    if effect_file is not None:
        # What cannot become an effect file is refused before anything is computed.
        if not (isinstance(added, type) and issubclass(added, LearnedCurve)):
            raise click.UsageError(
                f'--as-effect is for a law learned over one covariate, and --add is {effect}; '
                'give --add learned:COVARIATE, as learned:time_s'
            )
        if effect_file.suffix != '.py':
            raise click.UsageError(f'--as-effect {effect_file}: give a name that ends in .py')
        if effect_file.exists():
            raise click.UsageError(
                f'--as-effect {effect_file} is there already; give another name'
            )

    def lines(diagnosis: pd.Diagnosis) -> Iterator[str]:
        yield from _diagnosis_lines(diagnosis, 'added as asked: ')
        if effect_file is None:
            return
        law = diagnosis.model.effects[-1]
        form = next(iter(forms_of(law)), None)
        if form is None or not isinstance(law, LearnedCurve):
            raise PaintError(
                f'--as-effect {effect_file}: no closed form of few parameters fits the law within '
                'its band; use the curve itself, which stands in model.yaml if the fit was sound'
            )
        write_effect_file(effect_file, law, form)
        yield f'effect file: {form.formula}; in a model {{{effect_entry(form, effect_file)}}}'

    _run('refit', partial(pd.refit, added=added, seed=seed), lines, **given)


def _diagnosis_lines(diagnosis: pd.Diagnosis, how: str = 'added ') -> Iterator[str]:
    from paint_deposition.effects.learned_curves import LearnedCurve
    from paint_deposition.report import words

    yield f'{diagnosis.verdict.replace("_", " ")}: {diagnosis.reason}'
    if diagnosis.p_value < 1.0:
        yield f'p-value, nothing missing: {diagnosis.p_value:.4f}'
    for effects in diagnosis.classes:
        label = how if effects.best in diagnosis.accepted else ''
        others = f' (or {", ".join(effects.members[1:])})' if len(effects.members) > 1 else ''
        yield f'  {label}{effects.best}: {words.probability_words(effects)}{others}'
        law = diagnosis.model.effect(effects.best)
        if rows := words.learned_rows(law):
            shape = ', '.join(' '.join(row.values()).rstrip() for row in rows)
            yield f'    {words.effect_name(effects.best)}: {shape}'
        if isinstance(law, LearnedCurve) and law.sd:
            yield f'    {words.form_words(law)}'
        for name, value in effects.parameters.items():
            ends = f'({value.low:.4g} to {value.high:.4g})'
            why = f'; {value.reason}' if value.reason else ''
            yield f'    {name} = {value.value:.4g} {ends}{why}'
    before, after = diagnosis.history[0], diagnosis.history[-1]
    nested = f' ({after.nested_rmse_um:.2f} where what is missing is sought anew without each)'
    yield (
        f'RMSE {before.holdout_rmse_um:.2f} -> {after.holdout_rmse_um:.2f} µm on '
        f'{diagnosis.left_out} held out{nested if after.needs_all else ""}, '
        f'{before.rmse_um:.2f} -> {after.rmse_um:.2f} µm on the fitted points; gauge and texture '
        f'{diagnosis.study.noise_floor_um:.2f} µm'
    )
    yield from (zone.sentence for zone in diagnosis.comparisons[-1].zones)
    yield from (f'worse than before: {one}' for one in diagnosis.worse)
    if diagnosis.pattern_shift:
        yield f'pattern moved {diagnosis.pattern_shift}'
    yield from (f'{amount}' for amount in diagnosis.random_effects if amount.is_notable)
    regions, when = diagnosis.comparisons[0].regions, ' before' if diagnosis.accepted else ''
    for region in regions[:MISFITS]:
        yield f'misfit{when}: {region.experiment}: {region.description}'
    if len(regions) > MISFITS:
        yield f'{len(regions) - MISFITS} weaker misfits{when} are in diagnosis.json'
    if diagnosis.calibrate_first:
        yield (
            'next: calibrate on a flat panel, then diagnose with that model: a known pattern '
            'cannot mimic an effect'
        )
    for spray in diagnosis.proposals[1][:2]:
        todo = f'next: spray {spray.what}, and measure {spray.readings} points'
        yield f'{todo}: {words.separation_words(spray)}'
    if diagnosis.not_testable:
        yield f'not testable with these readings: {", ".join(diagnosis.not_testable)}'
    for note in (*diagnosis.study.notes, *diagnosis.discrepancy_note):
        yield f'note: {note}'

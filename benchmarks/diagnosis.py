"""How often the diagnosis is right, on campaigns of two worlds with hidden causes.

The droplet shop and the world of measured sprays share no law with the package or with each
other. Each campaign is painted once and kept; each diagnosis is a line of the results, so that a
run can be cut off and taken up again. After a change of the diagnosis give another file of
results.
"""

import ast
import importlib
import os
import pickle
import sys
import tempfile
import time
import warnings
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import click
import numpy as np

# One thread a process: several campaigns are in work at once, and would wait for each other.
for threads in ('OPENBLAS_NUM_THREADS', 'OMP_NUM_THREADS', 'NUMBA_NUM_THREADS'):
    os.environ.setdefault(threads, '1')

ROOT = Path(__file__).resolve().parents[1]

from benchmarks.records import add, kept  # noqa: E402
from benchmarks.scores import failures, reliability_diagram, table  # noqa: E402
from benchmarks.worlds.measured import available  # noqa: E402
from benchmarks.worlds.record import KINDS, Painted  # noqa: E402

import paint_deposition as paint  # noqa: E402
from paint_deposition.inference.diagnosis.discrepancy import PRIOR  # noqa: E402
from paint_deposition.inference.fitting.forward import Forward  # noqa: E402
from paint_deposition.inference.readings.campaign import Campaign  # noqa: E402

WORLDS = {
    'droplets': 'benchmarks.worlds.droplets',
    'semi_real': 'benchmarks.worlds.semi_real',
}
PAINTED = ROOT / 'runs' / 'bench-diagnosis'
# A reading this many times as far off as usual has a typing error; eight standard deviations.
TYPING_ERROR = 12.0
# Shares of the kinds of campaigns.
SHARES = {'clean': 0.25, 'effect': 0.4, 'pair': 0.15, 'unknown': 0.1, 'footprint': 0.1}

Task = tuple[str, int, str]


def tasks(count: int, worlds: Sequence[str], kinds: Sequence[str], seed: int) -> list[Task]:
    """World, seed and kind of each campaign, worlds in turn and kinds in their shares.

    The first of a longer list are those of a shorter one: a run cut off is a fair sample.
    """
    shares = np.array([SHARES[kind] for kind in kinds])
    shares /= shares.sum()
    listed, drawn = [], np.zeros(len(kinds))
    for number in range(-(-count // len(worlds))):
        kind = int(np.argmax(shares * (number + 1) - drawn))
        drawn[kind] += 1
        listed += [(world, 100_000 * seed + number, kinds[kind]) for world in worlds]
    return listed[:count]


def painted(task: Task) -> Painted:
    """The campaign of a task, painted now or by an earlier run."""
    world, seed, kind = task
    file = PAINTED / f'{world}-{kind}-{seed}.pickle'
    if file.exists():
        return pickle.loads(file.read_bytes())
    made = importlib.import_module(WORLDS[world]).paint(seed, kind)
    PAINTED.mkdir(parents=True, exist_ok=True)
    own = file.with_suffix(f'.{os.getpid()}')
    own.write_bytes(pickle.dumps(made))
    own.rename(file)
    return made


def set_constants(settings: Sequence[str]) -> None:
    """Give constants of the inference other values, as in 'SURE=0.9' or 'PRIOR.sides=0.04'."""
    importlib.import_module('paint_deposition.inference.diagnosis.procedure')
    for setting in settings:
        name, _, value = setting.partition('=')
        if name in (f'PRIOR.{one}' for one in vars(PRIOR)):
            setattr(PRIOR, name.removeprefix('PRIOR.'), ast.literal_eval(value))
            continue
        owners = [
            module
            for key, module in sys.modules.items()
            if key.startswith('paint_deposition.inference.') and hasattr(module, name)
        ]
        if not owners:
            raise click.BadParameter(f"the diagnosis has no constant '{name}'")
        for module in owners:
            setattr(module, name, ast.literal_eval(value))


def run(constants: Sequence[str], task: Task) -> list[dict]:
    """Diagnose a campaign, with other constants; a failure is a result too."""
    warnings.simplefilter('ignore')
    set_constants(constants)
    world, seed, kind = task
    try:
        campaign = painted(task)
        facts = {
            'hidden': list(campaign.hidden),
            'strength': campaign.strength,
            'strengths': list(campaign.strengths),
            'parts': len(campaign.parts),
            'facts': campaign.facts,
        }
        found = facts | judged(campaign)
    except Exception as error:
        found = {'error': f'{type(error).__name__}: {error}'}
    return [{'case': f'{world}-{kind}-{seed}', 'world': world, 'kind': kind} | found]


def judged(painted: Painted) -> dict:
    """What the diagnosis says of a campaign, and how far it predicts what it has not seen."""
    with tempfile.TemporaryDirectory() as folder:
        file = painted.write(Path(folder) / 'campaign')
        campaign, unseen = (
            paint.read_campaign(file),
            paint.read_campaign(file.with_name('unseen.yaml')),
        )
    started = time.process_time()
    diagnosis = paint.diagnose(campaign)
    seconds = time.process_time() - started
    unknown = diagnosis.unknown
    return {
        'readings': len(campaign.readings),
        'seconds': seconds,
        'verdict': diagnosis.verdict,
        'p_value': diagnosis.p_value,
        'accepted': list(diagnosis.accepted),
        'classes': [[list(c.members), c.probability, c.best] for c in diagnosis.classes],
        'unknown': unknown.covariate if unknown else None,
        'unseen': [
            unseen_error(painted, campaign, unseen, step.model)
            for step in (diagnosis.history[0], diagnosis.history[-1])
        ],
        'amounts': amounts(painted, diagnosis),
    }


def unseen_error(painted: Painted, campaign: Campaign, unseen: Campaign, model) -> float:
    """Error of fresh readings at unseen points over their noise; 1 where only noise is left.

    The level of each part and the zero of its gauge are those that its readings show, but for
    typing errors.
    """
    read_um, there_um = (Forward(c).predict_um(model) for c in (campaign, unseen))
    squares, noise = [], []
    for k, part in enumerate(painted.parts):
        own, other = campaign.experiment_of == k, unseen.experiment_of == k
        predicted, there = read_um[own], there_um[other]
        sigma = float(np.median(part.unseen_sigma_um))
        columns = np.column_stack([painted.level * predicted, np.full(own.sum(), painted.zero_um)])
        rest = campaign.readings.mean_um[own] - predicted
        away = np.abs(rest - np.median(rest))
        sound = away <= TYPING_ERROR * np.median(away)
        rest, columns = rest[sound], columns[sound]
        inner = sigma**2 * np.eye(2) + columns.T @ columns
        level, zero = np.linalg.solve(inner, columns.T @ rest)
        shown = there * (1.0 + painted.level * level) + painted.zero_um * zero
        squares.append((unseen.readings.mean_um[other] - shown) ** 2)
        noise.append(part.unseen_sigma_um**2)
    return float(np.sqrt(1.0 + np.mean(np.concatenate(squares)) / np.mean(np.concatenate(noise))))


def amounts(painted: Painted, diagnosis) -> list[dict]:
    """True amounts beside the intervals found, where both mean the same quantity."""
    found = {c.best: c.parameters for c in diagnosis.classes if c.best in diagnosis.accepted}
    listed = []
    for name, true in painted.amounts.items():
        effect, _, parameter = name.partition('.')
        if interval := found.get(effect, {}).get(parameter):
            listed.append({'name': name, 'true': true, 'low': interval.low, 'high': interval.high})
    return listed


@click.command()
@click.option('--campaigns', default=600, show_default=True, help='Campaigns in all.')
@click.option('--generators', default=','.join(WORLDS), show_default=True, help='Worlds.')
@click.option('--kinds', default=','.join(KINDS), show_default=True, help='Kinds of campaigns.')
@click.option('--seed', default=1, show_default=True, help='Another seed draws other campaigns.')
@click.option(
    '--results', default=ROOT / 'runs' / 'bench-diagnosis.jsonl', type=click.Path(path_type=Path)
)
@click.option('--constant', 'constants', multiple=True, help='NAME=VALUE in place of its own.')
@click.option('--report-only', is_flag=True, help='Print the table of what is there.')
@click.option('--failures', 'failed', is_flag=True, help='List what went wrong, too.')
@click.option('--draw', is_flag=True, help='Draw the reliability diagram into the docs.')
def main(
    campaigns: int,
    generators: str,
    kinds: str,
    seed: int,
    results: Path,
    constants: tuple[str, ...],
    report_only: bool,
    failed: bool,
    draw: bool,
) -> None:
    """Score the diagnosis on campaigns with hidden causes.

    Worlds: droplets (traced droplets) and semi_real (measured footprints and noise; needs the
    tables beside the repository). Results of an earlier run in the same file count as done: give
    another file after a change of the diagnosis.
    """
    chosen = {'generator': (generators.split(','), WORLDS), 'kind': (kinds.split(','), SHARES)}
    for what, (names, known) in chosen.items():
        if strange := set(names) - set(known):
            raise click.BadParameter(f"no {what} '{strange.pop()}'; there are: {', '.join(known)}")
    worlds = [world for world in generators.split(',') if _is_there(world)]
    if not worlds:
        raise click.UsageError('the measured tables of semi_real are not beside the repository')
    set_constants(constants)
    records = kept(results)
    if not report_only:
        done = {record['case'] for record in records}
        todo = [
            task
            for task in tasks(campaigns, worlds, kinds.split(','), seed)
            if f'{task[0]}-{task[2]}-{task[1]}' not in done
        ]
        records = add(results, partial(run, constants), todo)
    click.echo(table(records))
    if failed:
        click.echo('\n' + failures(records))
    if draw:
        reliability_diagram(records, ROOT / 'docs' / 'images' / 'calibration.png')


def _is_there(world: str) -> bool:
    there = world != 'semi_real' or available()
    if not there:
        click.echo('semi_real is left out: no measured tables beside the repository', err=True)
    return there


if __name__ == '__main__':
    main()

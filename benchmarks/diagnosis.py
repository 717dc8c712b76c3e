"""How often the diagnosis is right, on campaigns of the virtual paint shop with hidden causes.

The shop shares no code with the model, and its laws differ from the library's in form. Films are
painted once and kept; the noise in the readings is drawn again and again. An oracle and stepwise
selection by BIC get the same draws. Results are kept line by line, so that a run can be cut off
and taken up again; `--report-only` prints the table of what is there.
"""

import os
import sys
import time
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

import click
import numpy as np

# One thread a process: several campaigns are in work at once, and would wait for each other.
for threads in ('OPENBLAS_NUM_THREADS', 'OMP_NUM_THREADS', 'NUMBA_NUM_THREADS'):
    os.environ.setdefault(threads, '1')

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks.amounts import true_amounts  # noqa: E402
from benchmarks.campaigns import PaintedCase, name_of  # noqa: E402
from benchmarks.records import add, kept  # noqa: E402
from benchmarks.rivals import Oracle, Points, stepwise_bic, visible_strength  # noqa: E402
from benchmarks.scores import failures, table  # noqa: E402
from benchmarks.unseen import oracle_unseen_error, unseen_error  # noqa: E402
from tests.virtual_paint_shop.cases import KINDS, PARCELS, Case, draw_case  # noqa: E402
from tests.virtual_paint_shop.truths import library  # noqa: E402

from paint_deposition.effects.catalogue import EFFECTS  # noqa: E402
from paint_deposition.effects.deposition_model import DepositionModel  # noqa: E402
from paint_deposition.inference.diagnosis.procedure import diagnose  # noqa: E402
from paint_deposition.inference.diagnosis.verdict import Diagnosis  # noqa: E402

FILMS = ROOT / 'runs' / 'bench-diagnosis'
# Shares of the kinds of campaigns.
SHARES = {'clean': 0.2, 'effect': 0.42, 'pair': 0.14, 'unknown': 0.14, 'footprint': 0.1}
# Redraws of one case that a process does in one go.
BLOCK = 4
QUICK = {'cases': 10, 'redraws': 2, 'parcels': 4_000_000}

Task = tuple[Case, int, tuple[int, ...]]


def cases(count: int, kinds: Sequence[str], seed: int) -> list[Case]:
    """Campaigns of these kinds in their usual shares, mixed evenly."""
    shares = np.array([SHARES[kind] for kind in kinds])
    shares /= shares.sum()
    drawn = np.zeros(len(kinds))
    found = []
    for n in range(count):
        next_one = int(np.argmax(shares * (n + 1) - drawn))
        drawn[next_one] += 1
        found.append(draw_case(10_000 * seed + n, kinds[next_one]))
    return found


def every_cause(seed: int) -> list[Case]:
    """Every cause of the shop alone, in every form of its law."""
    names = sorted(library())
    np.random.default_rng(seed).shuffle(names)
    return [draw_case(10_000 * seed + n, _kind(name), (name,)) for n, name in enumerate(names)]


def _kind(name: str) -> str:
    kind, colon, _ = name.partition(':')
    return kind if colon else 'effect'


def tasks(found: list[Case], parcels: int, redraws: int, done: set[tuple[str, int]]) -> list[Task]:
    """What is not done, the first draws of all cases first: a run cut off is a fair sample."""
    listed = []
    for first in range(0, redraws, BLOCK):
        for case in found:
            block = range(first, min(first + BLOCK, redraws))
            left = tuple(n for n in block if (name_of(case), n) not in done)
            if left:
                listed.append((case, parcels, left))
    return listed


@lru_cache(maxsize=1)
def painted_case(case: Case, parcels: int) -> PaintedCase:
    """The case, kept for the other draws of one task."""
    return PaintedCase.of(case, FILMS, parcels)


@lru_cache(maxsize=1)
def strengths(case: Case, parcels: int) -> dict:
    """How visible each hidden effect is, and all together, in standard deviations."""
    painted = painted_case(case, parcels)
    points = Points.of(painted, painted.draw(0))
    together = visible_strength(painted, points, points.expected_um - points.clean_um)
    marks = points.marks_um.T
    each = [visible_strength(painted, points, mark) for mark in marks] if len(marks) > 1 else None
    return {'strength': together, 'strengths': [together] * len(marks) if each is None else each}


def run(task: Task) -> list[dict]:
    """Diagnose some draws of a case."""
    import warnings

    warnings.simplefilter('ignore')
    case, parcels, numbers = task
    records = []
    for number in numbers:
        try:
            found = judged(painted_case(case, parcels), number) | strengths(case, parcels)
        except Exception as error:  # a crash is a result too
            found = {'error': f'{type(error).__name__}: {error}'}
        records.append({'case': name_of(case), 'redraw': number, **facts(case)} | found)
    return records


def facts(case: Case) -> dict:
    """The case as the table needs it."""
    return {
        'seed': case.seed,
        'kind': case.kind,
        'hidden': [name.partition('~')[0] for name in case.truths],
        'truths': list(case.truths),
        'amplitudes': list(case.amplitudes),
        'layout': '+'.join(case.layout),
        'mesh_edge_m': case.mesh_edge_m,
        'noise_from': 'stated' if case.stated else 'repeats',
        'heavy_tails': case.noise.heavy_tails,
        'slips': case.noise.slip_fraction > 0.0,
    }


def judged(painted: PaintedCase, number: int) -> dict:
    """What the diagnosis says of a draw, and what there was to be said."""
    draw = painted.draw(number)
    started = time.process_time()
    diagnosis = diagnose(draw.campaign, DepositionModel(), EFFECTS)
    seconds = time.process_time() - started
    points = Points.of(painted, draw)
    rows = points.kept
    oracle = Oracle.of(points.sigma_um[rows], points.level_um[rows], painted.pattern_um[rows])
    mark = (points.expected_um - points.clean_um)[rows]
    return {
        'readings': len(draw.campaign.readings),
        'seconds': seconds,
        **said(diagnosis),
        'oracle_p': oracle.p_value((points.mean_um - points.clean_um)[rows], mark),
        'bic': stepwise_bic(diagnosis),
        'unseen': [
            unseen_error(painted, draw, points, step.model)
            for step in (diagnosis.history[0], diagnosis.history[-1])
        ],
        'unseen_oracle': oracle_unseen_error(painted, points),
        'amounts': amounts(painted, diagnosis),
    }


def said(diagnosis: Diagnosis) -> dict:
    """The diagnosis as it is kept."""
    return {
        'verdict': diagnosis.verdict,
        'reason': diagnosis.reason,
        'p_value': diagnosis.p_value,
        'accepted': list(diagnosis.accepted),
        'classes': [[list(c.members), c.probability] for c in diagnosis.classes],
        'unknown': diagnosis.unknown.kind if diagnosis.unknown else None,
    }


def amounts(painted: PaintedCase, diagnosis: Diagnosis) -> list[dict]:
    """True amounts beside the intervals found, where both mean the same quantity."""
    if len(painted.case.truths) != 1:
        return []
    (hidden,) = painted.truth['hidden']
    found = next((c for c in diagnosis.classes if c.best == hidden['id']), None)
    if found is None or found.best not in diagnosis.accepted:
        return []
    return [
        {
            'name': f'{found.best}.{name}',
            'true': float(value),
            'low': float(found.parameters[name].low),
            'high': float(found.parameters[name].high),
        }
        for name, value in true_amounts(hidden, painted.passes).items()
    ]


@click.command()
@click.option('--cases', 'count', default=80, show_default=True, help='Campaigns to paint.')
@click.option('--redraws', default=4, show_default=True, help='Draws of the noise in each.')
@click.option('--kinds', default=','.join(KINDS), show_default=True, help='Kinds of campaigns.')
@click.option('--every', is_flag=True, help='Every cause alone, in every form, instead of a draw.')
@click.option('--seed', default=1, show_default=True, help='Another seed draws other campaigns.')
@click.option('--jobs', default=2, show_default=True, help='Processes.')
@click.option('--scheduler', help='Address of a Dask scheduler, instead of processes here.')
@click.option('--quick', is_flag=True, help='Ten campaigns of coarse films: five minutes.')
@click.option(
    '--results', default=ROOT / 'runs' / 'bench-diagnosis.jsonl', type=click.Path(path_type=Path)
)
@click.option('--report-only', is_flag=True, help='Print the table of what is there.')
@click.option('--failures', 'failed', is_flag=True, help='List what went wrong, too.')
def main(
    count: int,
    redraws: int,
    kinds: str,
    every: bool,
    seed: int,
    jobs: int,
    scheduler: str | None,
    quick: bool,
    results: Path,
    report_only: bool,
    failed: bool,
) -> None:
    """Score the diagnosis on campaigns with hidden causes.

    The default takes about 70 minutes on two cores. Results of an earlier run in the same file
    count as done: give another file after a change of the diagnosis.
    """
    chosen = kinds.split(',')
    if strange := set(chosen) - set(KINDS):
        raise click.BadParameter(f"no kind '{strange.pop()}'; there are: {', '.join(KINDS)}")
    parcels = PARCELS
    if quick:
        count, redraws, parcels = QUICK['cases'], QUICK['redraws'], QUICK['parcels']
    FILMS.mkdir(parents=True, exist_ok=True)
    records = kept(results)
    if not report_only:
        found = every_cause(seed) if every else cases(count, chosen, seed)
        done = {(r['case'], r['redraw']) for r in records}
        todo = tasks(found, parcels, redraws, done)
        records = add(results, run, todo, jobs, scheduler)
    click.echo(table(records))
    if failed:
        click.echo('\n' + failures(records))


if __name__ == '__main__':
    main()

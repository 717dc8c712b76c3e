"""How often the first proposed spray settles between effects that look alike.

Parts are painted in the virtual paint shop with a hidden effect that others resemble. Where the
diagnosis leaves several explanations open, the spray that it proposes first is done in the same
hidden world, and both are diagnosed together. Results are kept line by line, so that a run can be
cut off and taken up again; `--summary` prints what is there.
"""

import json
import multiprocessing
import os
import sys
import tempfile
import warnings
from pathlib import Path

import click
from scipy.stats import binomtest
from tqdm import tqdm

# One thread a process: several campaigns are at work at once, and would wait for each other.
for threads in ('OPENBLAS_NUM_THREADS', 'OMP_NUM_THREADS', 'NUMBA_NUM_THREADS'):
    os.environ.setdefault(threads, '1')

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

# Effects that are easily taken for another one.
TRUTHS = (
    'air_drift', 'gauge_curvature_bias', 'fog_gradient', 'tcp_offset', 'faraday_shielding',
    'flow_drift', 'tcp_tilt', 'convex_attraction', 'sag', 'corner_slowdown', 'trigger_lag',
    'edge_build',
)  # fmt: skip
PARCELS = 3_000_000
READINGS, REPEATS = 80, 20
# Times the usual size of an effect.
SCALES = (3.0, 2.0)
# From this probability of one effect on, it counts as named.
SURE = 0.8
# Predicted chances of settling and predicted separations, in bins.
CHANCES = ((0.0, 0.3), (0.3, 0.6), (0.6, 0.8), (0.8, 1.0))
SEPARATIONS = ((0.0, 2.0), (2.0, 3.0), (3.0, 4.0), (4.0, 6.0), (6.0, float('inf')))


def run_one(job: tuple[int, str, float]) -> dict:
    """Paint and diagnose; where that leaves it open, spray what is proposed and diagnose both."""
    warnings.simplefilter('ignore')
    from tests.virtual_paint_shop.draw import stream
    from tests.virtual_paint_shop.respray import sprayed_again
    from tests.virtual_paint_shop.shop import generate
    from tests.virtual_paint_shop.truths import choose

    import paint_deposition as pd

    seed, truth, scale = job
    with tempfile.TemporaryDirectory() as name:
        painted = generate(seed, truth, readings=READINGS, repeats=REPEATS, heldout=1,
                           scale=scale, parcels=PARCELS)  # fmt: skip
        first = pd.diagnose(read(painted, Path(name) / 'first'))
        record = {'seed': seed, 'truth': truth, 'scale': scale, 'first': said(first)}
        _, sprays = first.proposals
        if sprays:
            truths = choose(truth, stream(seed, 1), None, scale)
            both = sprayed_again(painted, truths, sprays[0].experiment, sprays[0].changes, seed,
                                 stand=sprays[0].to_dict()['stand'], parcels=PARCELS)  # fmt: skip
            second = pd.diagnose(read(both, Path(name) / 'both'))
            record |= {'spray': sprays[0].to_dict(), 'second': said(second)}
        return record


def read(painted, folder: Path):
    """The campaign as a user would read it from its files."""
    from tests.virtual_paint_shop.files import write

    from paint_deposition.files.campaign_file import read_campaign

    return read_campaign(write(painted, folder))


def said(diagnosis) -> dict:
    """What a diagnosis says, as far as it counts here."""
    return {
        'verdict': diagnosis.verdict,
        'accepted': list(diagnosis.accepted),
        'classes': [[list(c.members), c.probability] for c in diagnosis.classes],
        'unknown': diagnosis.unknown.covariate if diagnosis.unknown else None,
    }


def table(records: list[dict]) -> str:
    """The scores as lines, each with its 95 % interval."""
    seen = [r for r in records if not _is_none(r['first'])]
    opened = [r for r in seen if 'second' in r and r['truth'] in r['spray']['separates']]
    away = [r for r in seen if 'second' in r and r['truth'] not in r['spray']['separates']]
    named = [_named(r['second']) for r in opened]
    rows = [
        ('narrowed to one effect', [n is not None for n in named], '>= 80'),
        ('  the true one', [n == r['truth'] for n, r in zip(named, opened, strict=True)], ''),
        ('true one still among what is said', [_kept(r) for r in opened], ''),
        ('  nothing missing, said then', [_is_none(r['second']) for r in opened], ''),
        ('true one not among what competed', [r in away for r in (*opened, *away)], ''),
        ('  named then all the same', [_named(r['second']) == r['truth'] for r in away], ''),
    ]  # fmt: skip
    rows += [_binned('chance', 'chance predicted', limits, opened) for limits in CHANCES]
    rows += [_binned('separation_sigma', 'standard deviations apart', b, opened)
             for b in SEPARATIONS]  # fmt: skip
    lines = [
        f'{len(records)} campaigns; in {len(seen)} something was found missing, '
        f'in {len(opened) + len(away)} several explanations competed'
    ]
    return '\n'.join([*lines, *(f'{w:<47}{_share(h):<38}{t}' for w, h, t in rows)])


def _binned(
    key: str, words: str, limits: tuple[float, float], opened: list[dict]
) -> tuple[str, list[bool], str]:
    """How many were narrowed to one, of those whose spray promised so much."""
    inside = [r for r in opened if limits[0] <= r['spray'][key] < limits[1] + 1e-9]
    hits = [_named(r['second']) is not None for r in inside]
    mean = sum(r['spray']['chance'] for r in inside) / max(len(inside), 1)
    return (
        f'narrowed, {limits[0]:g} to {limits[1]:g} {words}',
        hits,
        f'predicted {100 * mean:.0f} %',
    )


def _share(hits: list[bool]) -> str:
    """A share with its 95 % Clopper-Pearson interval."""
    if not hits:
        return 'none'
    found = binomtest(sum(hits), len(hits))
    low, high = found.proportion_ci()
    share = f'{100.0 * found.statistic:5.1f} %'
    return f'{share}  [{100 * low:.1f}, {100 * high:.1f}]  {found.k}/{found.n}'


def _named(said: dict) -> str | None:
    """The one effect that a diagnosis names, alone in its group; None if it does not."""
    from paint_deposition.effects.catalogue import EFFECTS

    named = [
        members for members, probability in said['classes']
        if set(members) & set(said['accepted']) & set(EFFECTS) and probability > SURE
    ]  # fmt: skip
    return named[0][0] if len(named) == 1 and len(named[0]) == 1 else None


def _is_none(said: dict) -> bool:
    return said['verdict'] == 'none_missing'


def _kept(record: dict) -> bool:
    return any(record['truth'] in members for members, _ in record['second']['classes'])


@click.command()
@click.option('--truths', default=','.join(TRUTHS), help='Hidden effects, by comma.')
@click.option('--each', default=10, show_default=True, help='Campaigns of each hidden effect.')
@click.option('--first-seed', default=930_000, show_default=True, help='For other campaigns.')
@click.option('--processes', default=2, show_default=True)
@click.option(
    '--results', default=ROOT / 'runs' / 'bench-next.jsonl', type=click.Path(path_type=Path)
)
@click.option('--summary', 'only_summary', is_flag=True, help='Print what is there.')
def main(
    truths: str, each: int, first_seed: int, processes: int, results: Path, only_summary: bool
) -> None:
    """Score the first proposed spray on parts with hidden effects."""
    results.parent.mkdir(parents=True, exist_ok=True)
    lines = results.read_text().splitlines() if results.exists() else []
    records = [json.loads(line) for line in lines]
    if not only_summary:
        known = {(r['seed'], r['truth']) for r in records}
        todo = [
            (first_seed + 100 * TRUTHS.index(truth) + k, truth, SCALES[k % len(SCALES)])
            for k in range(each)
            for truth in truths.split(',')
        ]
        todo = [job for job in todo if job[:2] not in known]
        pool = multiprocessing.get_context('spawn').Pool(processes)
        with results.open('a') as file, pool:
            for record in tqdm(
                pool.imap_unordered(run_one, todo), total=len(todo), mininterval=20
            ):
                records.append(record)
                file.write(json.dumps(record, default=float) + '\n')
                file.flush()
    click.echo(table(records))


if __name__ == '__main__':
    main()

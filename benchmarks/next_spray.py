"""How often the first proposed spray settles between effects that look alike.

Parts are painted in the virtual paint shop with a hidden effect that others resemble. Where the
diagnosis leaves several explanations open, the spray that it proposes first is done in the same
hidden world, and both are diagnosed together. Results are kept line by line, so that a run can be
cut off and taken up again; `--summary` prints what is there.
"""

import tempfile
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import click
from benchmarks.records import add, kept, results_option

# Effects that are easily taken for another one.
TRUTHS = (
    'air_drift', 'gauge_curvature_bias', 'fog_gradient', 'tcp_offset', 'faraday_shielding',
    'flow_drift', 'tcp_tilt', 'convex_attraction', 'sag', 'corner_slowdown', 'trigger_lag',
    'edge_build',
)  # fmt: skip
PARCELS = 3_000_000
READINGS, REPEATS, DRAWS = 80, 20, 3
# Between the seeds of the further part in two draws.
ANOTHER = 1_000_003
# Times the usual size of an effect.
SCALES = (3.0, 2.0)
# From this probability of one effect on, it counts as named.
SURE = 0.8
# Predicted chances of settling and predicted separations, in bins.
CHANCES = ((0.0, 0.3), (0.3, 0.6), (0.6, 0.8), (0.8, 1.001))
SEPARATIONS = ((0.0, 2.0), (2.0, 3.0), (3.0, 4.0), (4.0, 6.0), (6.0, float('inf')))


def run_one(job: tuple[int, str, float]) -> list[dict]:
    """Paint and diagnose; where that leaves it open, spray what is proposed and diagnose both.

    Campaigns that leave it open are measured again, with other noise, as often as ``DRAWS`` says.
    """
    warnings.simplefilter('ignore')
    from tests.virtual_paint_shop.shop import generate

    seed, truth, scale = job
    painted = generate(seed, truth, readings=READINGS, repeats=REPEATS, heldout=1, scale=scale,
                       parcels=PARCELS)  # fmt: skip
    records = [settled(painted, job, 0)]
    while 'second' in records[0] and len(records) < DRAWS:
        draw = len(records)
        records.append(settled(measured_again(painted, seed, draw), job, draw))
    return records


def settled(painted, job: tuple[int, str, float], draw: int) -> dict:
    """What a diagnosis says before and after the spray that it proposes first."""
    from tests.virtual_paint_shop.draw import stream
    from tests.virtual_paint_shop.respray import sprayed_again
    from tests.virtual_paint_shop.truths import choose

    import paint_deposition as paint

    seed, truth, scale = job
    with tempfile.TemporaryDirectory() as name:
        first = paint.diagnose(read(painted, Path(name) / 'first'))
        record = {'seed': seed, 'truth': truth, 'scale': scale, 'first': said(first)}
        _, sprays = first.proposals
        if sprays:
            spray = sprays[0].to_dict()
            truths = choose(truth, stream(seed, 1), None, scale)
            done = spray['experiment'], spray['changes'], seed + ANOTHER * draw
            both = sprayed_again(painted, truths, *done, stand=spray['stand'], parcels=PARCELS)
            second = paint.diagnose(read(both, Path(name) / 'both'))
            record |= {'spray': spray, 'second': said(second)}
        return record


def measured_again(painted, seed: int, draw: int):
    """The same parts with another draw of the gauge's noise."""
    import numpy as np
    from tests.virtual_paint_shop.shop import USUAL_NOISE

    rng = np.random.default_rng([71, seed, draw])
    parts = [
        replace(part, readings=replace(
            part.readings, thickness_um=USUAL_NOISE.read(part.readings.expected_um, rng, 0.0)))
        for part in painted.experiments
    ]  # fmt: skip
    return replace(painted, experiments=tuple(parts))


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
    """The scores as lines, each with its 95 % interval, clustered by campaign."""
    from benchmarks.scores import Row

    seen = [r for r in records if not _is_none(r['first'])]
    sprayed = [r for r in seen if 'second' in r]
    groups = [r for r in sprayed if len(_effects(r)) > 1]
    opened = [r for r in groups if r['truth'] in _effects(r)]
    away = [r for r in groups if r['truth'] not in _effects(r)]
    single = [r for r in sprayed if len(_effects(r)) == 1]

    def row(label: str, chosen: list[dict], hit: Callable[[dict], bool], aim: str = '') -> Row:
        return Row(label, [(str(r['seed']), float(hit(r))) for r in chosen], aim)

    def right(record: dict) -> bool:
        return _named(record['second']) == record['truth']

    rows = [
        row('narrowed to one effect', opened, _narrowed, '>= 80'),
        row('  the true one', opened, right),
        row('  the true one, of those narrowed', [r for r in opened if _narrowed(r)], right),
        row('true one still among what is said', opened, _kept),
        row('  nothing missing, said then', opened, lambda r: _is_none(r['second'])),
        row('true one not in the group', groups, lambda r: r in away),
        row('  named then all the same', away, right),
        row('one effect, not sure: named then', single, right),
    ]
    for key, words, bins in (
        ('chance', 'chance', CHANCES), ('separation_sigma', 'sd apart', SEPARATIONS),
    ):  # fmt: skip
        for low, high in bins:
            inside = [r for r in opened if low <= r['spray'][key] < high]
            mean = sum(r['spray']['chance'] for r in inside) / max(len(inside), 1)
            told = f'predicted {100.0 * mean:.0f} %' if inside else ''
            rows.append(row(f'narrowed, {low:g} to {high:g} {words}', inside, _narrowed, told))
    campaigns = len({r['seed'] for r in records})
    head = (
        f'{len(records)} diagnoses of {campaigns} campaigns; in {len(seen)} something was found '
        f'missing, in {len(groups)} several effects competed'
    )
    return '\n'.join([head, *map(str, rows)])


def _effects(record: dict) -> list[str]:
    """The effects that competed."""
    return [name for name in record['spray']['separates'] if name not in ('unknown', 'footprint')]


def _narrowed(record: dict) -> bool:
    return _named(record['second']) is not None


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
@results_option('bench-next.jsonl')
@click.option('--summary', 'only_summary', is_flag=True, help='Print what is there.')
def main(truths: str, each: int, first_seed: int, results: Path, only_summary: bool) -> None:
    """Score the first proposed spray on parts with hidden effects."""
    records = kept(results)
    if not only_summary:
        known = {(r['seed'], r['truth']) for r in records}
        jobs = [
            (first_seed + 100 * TRUTHS.index(truth) + k, truth, SCALES[k % len(SCALES)])
            for k in range(each)
            for truth in truths.split(',')
        ]
        todo = [job for job in jobs if job[:2] not in known]
        records = add(results, run_one, todo)
    click.echo(table(records))


if __name__ == '__main__':
    main()

"""What a diagnosis says of real sprays of two nozzles, whose missing physics is known.

The width of both grows as the height to a power of about 0.65 to 0.8 instead of 1, and the volume
stays within 10 %: `pattern_spread` of about -0.2 to -0.35, and nothing else. One height alone
tells of the footprint only. A wrongly taught standoff shows as one, or as a pattern that spreads
otherwise: three heights do not tell the two apart. The table of the sprays is not part of the
project.
"""

import tempfile
from collections.abc import Iterator
from itertools import combinations, product
from pathlib import Path
from typing import Any, NamedTuple

import click

import paint_deposition as paint
from nature.sprays import HEIGHTS_IN, NOZZLES, SCALE_M_PER_IN, spray_campaign

ROOT = Path(__file__).resolve().parents[1]
TABLE = ROOT.parent / 'shared' / 'data' / 'patternator_two_nozzles.csv'
SPREAD = frozenset({'pattern_spread'})
STANDOFF = SPREAD | {'tcp_standoff'}


class Case(NamedTuple):
    """A campaign, by the options of its builder, and the effects of which one is right."""

    nozzle: str
    options: dict[str, Any]
    right: frozenset[str]


def cases() -> Iterator[Case]:
    """Heights together, in pairs and alone, and heights that were told wrongly."""
    for nozzle, as_repeats in product(NOZZLES, (False, True)):
        for hanging in ('column', 'row', 'lying'):
            yield Case(nozzle, {'as_repeats': as_repeats, 'hanging': hanging}, SPREAD)
        for heights in combinations(HEIGHTS_IN, 2):
            yield Case(nozzle, {'as_repeats': as_repeats, 'heights_in': heights}, SPREAD)
        for height in HEIGHTS_IN:
            options = {'as_repeats': as_repeats, 'heights_in': (height,)}
            yield Case(nozzle, options, frozenset())
        for factor in (0.8, 1.2):  # moves the model plane with it
            yield Case(nozzle, {'as_repeats': as_repeats, 'told_times': factor}, SPREAD)
        for share in (-0.2, 0.2):
            off_m = share * HEIGHTS_IN[1] * SCALE_M_PER_IN
            yield Case(nozzle, {'as_repeats': as_repeats, 'told_off_m': off_m}, STANDOFF)


def judged(case: Case, table: Path) -> tuple[str, str]:
    """'right', 'wrong' or 'cannot tell', and the groups that were named."""
    with tempfile.TemporaryDirectory() as folder:
        path = spray_campaign(table, case.nozzle, Path(folder) / 'campaign', **case.options)
        found = paint.diagnose(paint.read_campaign(path))
    named = [c for c in found.classes if c.best in found.accepted and ':' not in c.best]
    words = ' and '.join('{' + ', '.join(c.members) + '}' for c in named) or 'none'
    if not case.right:
        return ('wrong' if named else 'right'), words
    if not named:
        return 'cannot tell', words
    return ('right' if len(named) == 1 and case.right & {*named[0].members} else 'wrong'), words


@click.command()
@click.option('--table', default=TABLE, type=click.Path(path_type=Path), help='Of the sprays.')
def main(table: Path) -> None:
    """Diagnose all campaigns that can be made of the sprays; minutes."""
    if not table.exists():
        raise click.UsageError(f'{table} is not there; give the table of the sprays by --table')
    count = dict.fromkeys(('right', 'wrong', 'cannot tell'), 0)
    for case in cases():
        verdict, named = judged(case, table)
        count[verdict] += 1
        click.echo(f'{case.nozzle} {case.options}: {verdict}, named {named}')
    click.echo(', '.join(f'{number} {verdict}' for verdict, number in count.items()))


if __name__ == '__main__':
    main()

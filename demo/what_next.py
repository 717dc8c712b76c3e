"""A diagnosis that leaves several effects open, settled by the spray that it proposes.

The parts are painted in the virtual paint shop of the tests, which shares no code with the model:
only it knows what is hidden.
"""

import json
import sys
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from tests.virtual_paint_shop.draw import stream
from tests.virtual_paint_shop.files import write
from tests.virtual_paint_shop.respray import sprayed_again
from tests.virtual_paint_shop.shop import generate
from tests.virtual_paint_shop.truths import choose

from paint_deposition.inference.diagnosis.verdict import percent

SEED, HIDDEN, SCALE = 930101, 'gauge_curvature_bias', 2.0
PARCELS = 4_000_000

Paint = Callable[..., str]


def settle(folder: Path, paint: Paint, say: Callable[[str], None]) -> Path:
    """Diagnose a door, spray what is proposed first, diagnose both; returns the last results.

    Args:
        folder: for campaigns and results.
        paint: runs a command of the package.
        say: prints a heading.
    """
    say('Painting a door in the virtual paint shop, with something hidden')
    painted = generate(SEED, HIDDEN, readings=80, repeats=20, heldout=1, scale=SCALE,
                       parcels=PARCELS)  # fmt: skip
    campaign = write(painted, folder / 'one_door')
    print(f'{len(painted.experiments[0].readings.point)} readings: {campaign}')

    say('Diagnosing it: what is missing, and what next?')
    first = folder / 'one_door_diagnosis'
    paint('diagnose', campaign, '-o', first, show=True)
    sprays = json.loads((first / 'diagnosis.json').read_text())['next']['spray']
    if not sprays:
        print('Nothing is left open.')
        return first

    say('Spraying the first proposal in the same virtual shop')
    print(f'{sprays[0]["what"]}; the level of the part and the zero of the gauge are drawn anew')
    truths = choose(HIDDEN, stream(SEED, 1), None, SCALE)
    both = sprayed_again(painted, truths, sprays[0]['experiment'], sprays[0]['changes'], SEED,
                         stand=sprays[0]['stand'], parcels=PARCELS)  # fmt: skip

    say('Diagnosing both doors together')
    last = folder / 'two_doors_diagnosis'
    paint('diagnose', write(both, folder / 'two_doors'), '-o', last, show=True)

    say('For the sceptic: what the virtual shop had hidden')
    before, after = (_leading(json.loads((f / 'diagnosis.json').read_text()))
                     for f in (first, last))  # fmt: skip
    hidden = painted.truth['hidden'][0]
    print(f'hidden          {hidden["id"]}, amplitude {hidden["amplitude"]:.3f} {hidden["unit"]}, '
          'by another law than that of the library')  # fmt: skip
    print(f'one door        {before}')
    print(f'after the spray {after}')
    return last


def _leading(diagnosis: dict) -> str:
    """The leading group and its probability."""
    if not diagnosis['classes']:
        return diagnosis['verdict'].replace('_', ' ')
    group = diagnosis['classes'][0]
    return f'{" or ".join(group["members"])} ({percent(group["probability"])})'

"""How a diagnosis does on parts that two brushes painted: false alarms and effects found.

    python benchmarks/brushes.py [DRAWS] [EFFECTS]

Doors and panels of the virtual paint shop, whose passes take a brush and a narrower one in turn.
DRAWS times nothing is missing, each with noise of its own; then each of some effects is hidden in
as many parts as EFFECTS says. Half of the models are calibrated before, half are fitted anew.
"""

import os
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')

import numpy as np  # noqa: E402
from tests.virtual_paint_shop.files import write  # noqa: E402
from tests.virtual_paint_shop.shop import generate  # noqa: E402

from paint_deposition.api.inference import calibrate, diagnose  # noqa: E402
from paint_deposition.diagnosis.verdict import Diagnosis  # noqa: E402
from paint_deposition.files.campaign_file import read_campaign  # noqa: E402
from paint_deposition.readings.campaign import Campaign  # noqa: E402

HIDDEN = (
    'edge_build', 'faraday_shielding', 'convex_attraction', 'corner_slowdown', 'flow_drift',
    'incidence_attraction',
)  # fmt: skip
PARCELS, READINGS, REPEATS, WIDTH = 2_000_000, 100, 30, 0.75


def painted(seed: int, truth: str | None, part: str) -> Campaign:
    """A part that brush 1 and the narrower brush 2 painted in turn."""
    made = generate(
        seed, truth, experiments=(part,), readings=READINGS, repeats=REPEATS,
        second_brush=WIDTH, parcels=PARCELS, heldout=10,
    )  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        return read_campaign(write(made, Path(folder) / 'campaign'))


def diagnosed(seed: int, truth: str | None) -> Diagnosis:
    """A diagnosis of a door; every other one begins with the model of a panel."""
    door = painted(seed, truth, 'door')
    if seed % 2:
        return diagnose(door)
    known = calibrate(painted(seed, None, 'panel'))
    return diagnose(door, known.model, posterior=known.posterior)


def main() -> None:
    draws = int(sys.argv[1]) if len(sys.argv) > 1 else 50
    each = int(sys.argv[2]) if len(sys.argv) > 2 else 6
    began = time.perf_counter()
    seeds = iter(range(880_000, 990_000))
    print(f'{"hidden":24}{"parts":>6}{"named":>7}{"other":>7}{"open":>6}{"none":>6}{"error":>8}')
    for truth, count in ((None, draws), *((name, each) for name in HIDDEN)):
        found: Counter[str] = Counter()
        errors = []
        for _ in range(count):
            result = diagnosed(next(seeds), truth)
            kind = {'none_missing': 'none', 'effect_missing': 'other'}.get(result.verdict, 'open')
            if truth is not None and truth in result.accepted:
                kind = 'named'
            found[kind] += 1
            rmse = result.to_dict()['rmse_um']
            errors.append(rmse['holdout_after'] / rmse['holdout_before'])
        figures = ''.join(f'{found[key]:{w}}' for key, w in
                          (('named', 7), ('other', 7), ('open', 6), ('none', 6)))  # fmt: skip
        print(f'{truth or "nothing":24}{count:6}{figures}{np.median(errors):8.2f}', flush=True)
    print(f'{time.perf_counter() - began:.0f} s')


if __name__ == '__main__':
    main()

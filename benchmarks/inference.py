"""How long a diagnosis takes, stage by stage, and what one film of the fit costs.

    python -m benchmarks.inference [CAMPAIGN.yaml] [ROUNDS] [--json FILE]

Without a campaign: four recordings of the virtual paint shop with a hidden effect, 316 readings.
Every stage counts with its best round after a warm-up; times of the processor add up all threads.
"""

import argparse
import json
import math
import os
import resource
import tempfile
import time
import warnings
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

# One for all of linear algebra: its matrices are small.
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')

from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.files.campaign_file import read_campaign
from paint_deposition.inference.diagnosis.procedure import diagnose
from paint_deposition.inference.diagnosis.search import Search
from paint_deposition.inference.diagnosis.state import DiagnosisState
from paint_deposition.inference.fitting.forward import Forward, derivatives_by_pattern
from paint_deposition.inference.readings.campaign import Campaign
from paint_deposition.kernel.blocks import THREADS

READINGS_A_PART, REPEATS = 79, 12
MODEL = DepositionModel()


@dataclass
class SearchStage:
    """The best times of a piece of work."""

    wall_s: float = math.inf
    processor_s: float = math.inf

    def of(self, work: Callable[[], Any]) -> Any:
        """Do the work once more."""
        wall, processor = time.perf_counter(), time.process_time()
        result = work()
        self.wall_s = min(self.wall_s, time.perf_counter() - wall)
        self.processor_s = min(self.processor_s, time.process_time() - processor)
        return result


def drawn() -> Campaign:
    """A panel painted twice and a door painted along and across, with more paint at the edges."""
    from tests.virtual_paint_shop.files import write
    from tests.virtual_paint_shop.shop import generate

    with tempfile.TemporaryDirectory() as folder:
        layout = ('panel', 'door', 'door_vertical')
        painted = generate(
            4_700_003, 'edge_build', experiments=layout, readings=READINGS_A_PART, repeats=REPEATS,
            parcels=2_000_000,
        )  # fmt: skip
        write(painted, Path(folder) / 'campaign')
        campaign = read_campaign(Path(folder) / 'campaign' / 'campaign.yaml')
    again = replace(campaign.experiments[0], name='panel again')
    return replace(campaign, experiments=(*campaign.experiments, again))


def films(campaign: Campaign, rounds: int) -> None:
    """Print what a film costs, alone and with its derivatives by the pattern."""
    sprays = [(e.path.flow * e.path.dwell_s != 0.0).sum() for e in campaign.experiments]
    pairs = sum(len(e) * m for e, m in zip(campaign.experiments, sprays, strict=True))
    law = MODEL.with_effect(EFFECTS['pattern_spread'].typical())
    forward = Forward(campaign, tuple(effect() for effect in EFFECTS.values()))
    head = f'{pairs} pairs of point and sub-step'
    print(f'\n{head:53}{"wall":>9}{"processor":>11}{"ns/pair":>9}')
    for name, model in (('', MODEL), (', all laws of the kernel', law)):
        film, terms = SearchStage(), SearchStage()
        for k in range(10 * rounds):
            gain = model.planar.K1_cm3_per_s * (1.0 + 1e-6 * k)  # else it is still there
            other = model.planar.model_copy(update={'K1_cm3_per_s': gain})
            moved = model.model_copy(update={'planar': other})
            film.of(lambda moved=moved: forward.predict_um(moved))
            terms.of(lambda moved=moved: derivatives_by_pattern(
                forward.of_weights(moved), moved.patterns
            ))  # fmt: skip
        for what, stage in ((f'film{name}', film), (f'derivatives{name}', terms)):
            print(
                f'{what:53}{1e3 * stage.wall_s:6.2f} ms{1e3 * stage.processor_s:8.2f} ms'
                f'{1e9 * stage.processor_s / pairs:9.1f}'
            )


def stages(campaign: Campaign, rounds: int) -> dict[str, Any]:
    """Print the stages of a diagnosis, and return them."""
    table: dict[str, SearchStage] = {}

    def timed(name: str, work: Callable[[], Any]) -> Any:
        return table.setdefault(name, SearchStage()).of(work)

    for _ in range(rounds):
        run = timed(
            'first fit', lambda: DiagnosisState(campaign, MODEL, EFFECTS, 0, lambda line: None)
        )
        search = timed('evidence of what may be missing', lambda run=run: Search(run))
        timed('p-value', lambda search=search: search.nothing.space.p_value(0))
        timed('search of the missing effects', lambda search=search: search.stages())
        diagnosis = timed('the whole diagnosis', lambda: diagnose(campaign, MODEL, EFFECTS))
    print(f'\n{"stage, once":53}{"wall":>9}{"processor":>11}')
    for name, stage in table.items():
        print(f'{name:53}{stage.wall_s:7.2f} s{stage.processor_s:9.2f} s')
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f'\n{diagnosis.verdict} {diagnosis.accepted}; most memory {memory:.0f} MB')
    return {'stages': {name: asdict(stage) for name, stage in table.items()}, 'memory_mb': memory}


def main() -> None:
    """Measure all."""
    warnings.simplefilter('ignore')
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('words', nargs='*', metavar='CAMPAIGN.yaml | ROUNDS')
    parser.add_argument('--json', type=Path, help='also write the figures to this file')
    given = parser.parse_args()
    rounds = next((int(word) for word in given.words if word.isdigit()), 3)
    files = [word for word in given.words if not word.isdigit()]
    campaign = read_campaign(Path(files[0])) if files else drawn()
    print(
        f'{len(campaign.readings)} readings at {len(campaign)} points, '
        f'{len(campaign.experiments)} recordings, '
        f'{THREADS} threads, load {os.getloadavg()[0]:.1f}; best of {rounds}'
    )
    diagnose(campaign, MODEL, EFFECTS)
    films(campaign, rounds)
    record = {'readings': len(campaign.readings), **stages(campaign, rounds)}
    if given.json:
        given.json.write_text(json.dumps(record, indent=1), encoding='utf-8')


if __name__ == '__main__':
    main()

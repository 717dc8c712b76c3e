"""How long the recommendation of an index takes, by the effects along the rays that a model has.

    python -m benchmarks.recommend [ROUNDS] [--json FILE]

The first answer has a new model: nothing of it is known yet, but its kernel is compiled. A request
that differs in the tolerance only comes second.
"""

import argparse
import json
import statistics
import time
from pathlib import Path
from typing import Any

from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.planning.recommendation import recommend
from paint_deposition.planning.requests import IndexRequest

RAY_EFFECTS = (
    'incidence_attraction', 'standoff_efficiency', 'pattern_spread', 'air_drift', 'tcp_tilt',
)  # fmt: skip
REQUESTS = {
    'speed': ({'speed_m_per_s': 0.3},) * 2,
    'target and tolerance': (
        {'target_um': 20.0, 'tolerance': 0.06}, {'target_um': 20.0, 'tolerance': 0.07},
    ),
}  # fmt: skip


def milliseconds(model: DepositionModel, asked: dict[str, float]) -> float:
    """Of one answer."""
    began = time.perf_counter()
    recommend(model, IndexRequest(**asked))
    return 1e3 * (time.perf_counter() - began)


def timed(effects: int, requests: tuple[dict[str, float], ...], rounds: int) -> list[float]:
    """Median times [ms] of the requests, asked one after the other of a model seen for the first
    time, after one answer that compiles.
    """
    laws = tuple(EFFECTS[name].typical() for name in RAY_EFFECTS[:effects])
    found = []
    for number in range(rounds + 1):
        model = DepositionModel(effects=laws)
        new = model.planar.model_copy(update={'r_m': model.planar.r_m * (1.0 + 1e-6 * number)})
        model = model.model_copy(update={'planar': new})
        found.append([milliseconds(model, asked) for asked in requests])
    return [statistics.median(times) for times in zip(*found[1:], strict=True)]


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('rounds', nargs='?', type=int, default=20)
    parser.add_argument('--json', type=Path)
    given = parser.parse_args()
    record: list[dict[str, Any]] = []
    print(f'{"recommend an index, with":44}{"first":>10}{"again":>10}')
    for effects in (0, 1, len(RAY_EFFECTS)):
        for name, requests in REQUESTS.items():
            first, again = timed(effects, requests, given.rounds)
            record.append({'effects': effects, 'request': name, 'first_ms': first,
                           'again_ms': again})  # fmt: skip
            label = f'{effects} effects along the rays, {name}'
            print(f'{label:44}{first:7.0f} ms{again:7.0f} ms', flush=True)
    if given.json:
        given.json.write_text(json.dumps(record))


if __name__ == '__main__':
    main()

"""How a diagnosis does on parts that two brushes painted: false alarms and effects found.

Doors and panels of the virtual paint shop, whose passes take a brush and a narrower one in turn.
First nothing is missing, each time with noise of its own; then each of some effects is hidden in
several parts. Half of the models are calibrated before, half are fitted anew. Results are kept
line by line, so that a run can be cut off and taken up again.
"""

import tempfile
from collections import Counter
from pathlib import Path

import click
import numpy as np
from benchmarks.records import add, kept, results_option
from tests.virtual_paint_shop.files import write
from tests.virtual_paint_shop.shop import generate

from paint_deposition.api.inference import calibrate, diagnose
from paint_deposition.files.campaign_file import read_campaign
from paint_deposition.inference.diagnosis.verdict import Diagnosis
from paint_deposition.inference.readings.campaign import Campaign

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


def run(job: tuple[int, str | None]) -> list[dict]:
    """What the diagnosis of one part says, and the error left of that before."""
    seed, truth = job
    result = diagnosed(seed, truth)
    kind = {'none_missing': 'none', 'effect_missing': 'other'}.get(result.verdict, 'open')
    if truth is not None and truth in result.accepted:
        kind = 'named'
    rmse = result.to_dict()['rmse_um']
    error = rmse['holdout_after'] / rmse['holdout_before']
    return [{'seed': seed, 'truth': truth, 'kind': kind, 'error': error}]


def table(records: list[dict]) -> str:
    """A line for each hidden effect."""
    kinds = ('named', 'other', 'open', 'none')
    lines = [f'{"hidden":24}{"parts":>6}' + ''.join(f'{k:>7}' for k in kinds) + f'{"error":>8}']
    for truth in (None, *HIDDEN):
        own = [r for r in records if r['truth'] == truth]
        if own:
            found = Counter(r['kind'] for r in own)
            figures = ''.join(f'{found[kind]:7}' for kind in kinds)
            error = np.median([r['error'] for r in own])
            lines.append(f'{truth or "nothing":24}{len(own):6}{figures}{error:8.2f}')
    return '\n'.join(lines)


@click.command()
@click.option('--draws', default=50, show_default=True, help='Parts with nothing hidden.')
@click.option('--each', default=6, show_default=True, help='Parts with each hidden effect.')
@results_option('bench-brushes.jsonl')
def main(draws: int, each: int, results: Path) -> None:
    """Count false alarms and effects found on parts that two brushes painted."""
    hidden = [*[None] * draws, *(truth for truth in HIDDEN for _ in range(each))]
    jobs = [(880_000 + number, truth) for number, truth in enumerate(hidden)]
    done = {(r['seed'], r['truth']) for r in kept(results)}
    left = [job for job in jobs if job not in done]
    click.echo(table(add(results, run, left)))


if __name__ == '__main__':
    main()

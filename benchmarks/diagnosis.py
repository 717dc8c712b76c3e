"""How often the diagnosis is right, on doors of the virtual paint shop with hidden effects.

Every campaign is drawn by a generator that shares no code with the model; the same campaigns are
given to stepwise selection by BIC. Results are kept line by line, so that a run can be cut off and
taken up again; `--summary` prints the table of what is there.
"""

import json
import multiprocessing
import os
import sys
import tempfile
import time
from pathlib import Path

import click
import numpy as np
from tqdm import tqdm

# One thread a process: several campaigns are linear at once, and would wait for each other.
for threads in ('OPENBLAS_NUM_THREADS', 'OMP_NUM_THREADS', 'NUMBA_NUM_THREADS'):
    os.environ.setdefault(threads, '1')

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

FOOTPRINTS = ('elliptic', 'skewed', 'triangular_ring', 'two_lobes')
STRANGE = ('charge_swirl', 'masking_tape', 'poor_ground', 'pump_pulsation', 'thermal_stripe')
PAIRS = (
    'air_drift+edge_build',
    'faraday_shielding+flow_drift',
    'incidence_attraction+fog_gradient',
)
LAYOUTS = (('door',), ('door',), ('panel', 'door'), ('door', 'door_vertical'))
PARCELS = 4_000_000


def jobs(clean: int, each: int, first_seed: int) -> list[tuple[int, str]]:
    """(seed, truth) of every campaign; seeds are not those of any test."""
    from paint_deposition.effects.catalogue import EFFECTS

    listed = [(first_seed + k, '') for k in range(clean)]
    truths = list(EFFECTS)
    truths += [f'footprint:{name}' for name in FOOTPRINTS]
    truths += [f'unknown:{name}' for name in STRANGE]
    truths += PAIRS
    for number, truth in enumerate(truths):
        listed += [(first_seed + 10_000 + 100 * number + k, truth) for k in range(each)]
    return listed


def run_one(job: tuple[int, str]) -> dict:
    """Draw a campaign, diagnose it with the whole library and without the truth's class."""
    import warnings

    warnings.simplefilter('ignore')
    from tests.virtual_paint_shop.files import write
    from tests.virtual_paint_shop.shop import generate

    seed, truth = job
    random = np.random.default_rng(seed)
    layout = LAYOUTS[seed % len(LAYOUTS)]
    readings = int(random.integers(60, 131)) // len(layout)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / 'campaign'
        write(
            generate(seed, truth or None, experiments=layout, readings=readings,
                     repeats=max(12, readings // 4), parcels=PARCELS),
            folder,
        )  # fmt: skip
        try:
            return _diagnosed(folder, seed, truth, layout)
        except Exception as error:  # a crash is a result too
            return {'seed': seed, 'truth': truth, 'error': f'{type(error).__name__}: {error}'}


def _diagnosed(folder: Path, seed: int, truth: str, layout: tuple[str, ...]) -> dict:
    from paint_deposition.diagnosis.procedure import diagnose
    from paint_deposition.effects.catalogue import EFFECTS
    from paint_deposition.effects.deposition_model import DepositionModel
    from paint_deposition.files.campaign_file import read_campaign

    campaign = read_campaign(folder / 'campaign.yaml')
    started = time.perf_counter()
    diagnosis = diagnose(campaign, DepositionModel(), EFFECTS)
    seconds = time.perf_counter() - started
    record = {
        'seed': seed,
        'truth': truth,
        'layout': '+'.join(layout),
        'readings': len(campaign.readings),
        'seconds': seconds,
        **_said(diagnosis),
        'heldout': _held_out(folder, campaign, diagnosis),
        'amounts': _amounts(folder, truth, campaign, diagnosis),
        'bic': stepwise_bic(diagnosis),
    }
    if truth in EFFECTS and record['verdict'] != 'none_missing':
        gone = _class_of(truth, diagnosis)
        library = {key: value for key, value in EFFECTS.items() if key not in gone}
        record['without'] = {'removed': sorted(gone)} | _said(
            diagnose(campaign, DepositionModel(), library)
        )
    return record


def _said(diagnosis) -> dict:
    return {
        'verdict': diagnosis.verdict,
        'p_value': diagnosis.p_value,
        'accepted': list(diagnosis.accepted),
        'classes': [[list(c.members), c.probability] for c in diagnosis.classes],
        'unknown': diagnosis.unknown.kind if diagnosis.unknown else None,
        'not_testable': list(diagnosis.not_testable),
    }


def _class_of(truth: str, diagnosis) -> set[str]:
    """The truth and whatever can imitate it: declared rivals and the class found."""
    from paint_deposition.effects.catalogue import EFFECTS

    gone = {truth, *EFFECTS[truth].rivals}
    gone |= {key for key, effect in EFFECTS.items() if effect.family == EFFECTS[truth].family}
    for found in diagnosis.classes:
        if truth in found.members:
            gone |= set(found.members)
    return gone


def _held_out(folder: Path, campaign, diagnosis) -> dict[str, float]:
    """RMSE on readings the diagnosis never saw, over the noise of the gauge there."""
    from paint_deposition.files.gauge_readings import read_readings
    from paint_deposition.fitting.study import Study
    from paint_deposition.readings.campaign import Campaign, Experiment
    from paint_deposition.readings.residuals import root_mean_square

    unseen = []
    for experiment in campaign.experiments:
        table = read_readings(folder / 'truth' / f'heldout_{experiment.name}.csv')
        unseen.append(Experiment.of(experiment.name, experiment.surface, experiment.path, table))
    study = Study.of(Campaign(tuple(unseen)))
    noise = np.hypot(0.7, 0.01 * study.measured_um) / np.sqrt(study.campaign.means.repeats)
    floor = root_mean_square(noise)
    found = {}
    for name, step in (('before', diagnosis.history[0]), ('after', diagnosis.history[-1])):
        found[name] = study.residuals(study.forward.predict_um(step.model)).rmse_um / floor
    return found


def _amounts(folder: Path, truth: str, campaign, diagnosis) -> list[dict]:
    """The truth's amounts beside the intervals found, where both mean the same quantity."""
    from benchmarks.amounts import true_amounts

    hidden = json.loads((folder / 'truth' / 'truth.json').read_text())['hidden']
    found = next((c for c in diagnosis.classes if c.best == truth), None)
    if not found or truth not in diagnosis.accepted:
        return []
    passes = [int(e.path.spray_pass.max()) + 1 for e in campaign.experiments]
    return [
        {
            'name': f'{truth}.{name}',
            'true': float(value),
            'low': float(found.parameters[name].low),
            'high': float(found.parameters[name].high),
        }
        for name, value in true_amounts(hidden[0], passes).items()
    ]


def stepwise_bic(diagnosis) -> dict:
    """Forward selection by BIC over the same sensitivities: the usual way, for comparison."""
    from paint_deposition.diagnosis.sensitivities import neutral_shapes, sensitivity
    from paint_deposition.effects.catalogue import EFFECTS

    study, fit = diagnosis.study, diagnosis.history[0].fit
    sensitivities = [
        sensitivity(study.forward, fit, shape, study.sigma_um)
        for effect in EFFECTS.values()
        for shape in neutral_shapes(effect)
    ]
    columns, chosen = fit.jacobian, []
    count = len(fit.residual)

    def bic(design: np.ndarray) -> float:
        solved, *_ = np.linalg.lstsq(design, fit.residual, rcond=None)
        rest = fit.residual - design @ solved
        return float(rest @ rest) + design.shape[1] * np.log(count)

    value = bic(columns)
    while len(chosen) < 3:
        options = [
            (bic(np.hstack([columns, s.columns])), k)
            for k, s in enumerate(sensitivities)
            if s.id not in chosen
        ]
        best, k = min(options)
        if best >= value:
            break
        value, columns = best, np.hstack([columns, sensitivities[k].columns])
        chosen.append(sensitivities[k].id)
    return {'chosen': chosen}


@click.command()
@click.option('--clean', default=100, show_default=True, help='Campaigns with nothing hidden.')
@click.option('--each', default=6, show_default=True, help='Campaigns of each hidden cause.')
@click.option('--first-seed', default=910_000, show_default=True, help='For other campaigns.')
@click.option('--processes', default=2, show_default=True)
@click.option(
    '--results', default=ROOT / 'runs' / 'bench-diagnosis.jsonl', type=click.Path(path_type=Path)
)
@click.option('--summary', 'only_summary', is_flag=True, help='Print what is there.')
def main(
    clean: int, each: int, first_seed: int, processes: int, results: Path, only_summary: bool
) -> None:
    """Score the diagnosis on doors with hidden effects."""
    results.parent.mkdir(parents=True, exist_ok=True)
    lines = results.read_text().splitlines() if results.exists() else []
    records = [json.loads(line) for line in lines]
    from benchmarks.scores import table

    if not only_summary:
        known = {(r['seed'], r['truth']) for r in records}
        todo = [job for job in jobs(clean, each, first_seed) if job not in known]
        # Causes are mixed, so that a run cut off early is a fair sample.
        np.random.default_rng(0).shuffle(todo)
        todo = [(int(seed), str(truth)) for seed, truth in todo]
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

"""What chosen points save against a grid and against random points, on doors of the paint shop.

First the power that the model expects, for more and more points. Then the doors are painted with
hidden effects in the virtual paint shop, measured at each set of points with noise drawn anew, and
diagnosed: the shop shares no code with the model, and its laws differ from the library's in form.
Results are kept line by line, so that a run can be cut off and taken up again; `--report-only`
prints the tables of what is there.
"""

import warnings
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path

import click
import numpy as np
from benchmarks.records import add, kept, results_option
from tests.virtual_paint_shop.draw import draw_jobs, stream
from tests.virtual_paint_shop.gauge import GaugeNoise, measure
from tests.virtual_paint_shop.jobs import record
from tests.virtual_paint_shop.shop import Bench
from tests.virtual_paint_shop.truths import choose as choose_truths

from paint_deposition.api.simulation import look_at
from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.inference.design.reading_choice import ChosenReadings, choose, usable_places
from paint_deposition.inference.design.unmeasured_part import UnmeasuredPart
from paint_deposition.inference.diagnosis.procedure import diagnose
from paint_deposition.inference.readings.campaign import Campaign, Experiment
from paint_deposition.inference.readings.places import grid_places
from paint_deposition.inference.readings.readings import Readings
from paint_deposition.model.eq1_pattern import PlanarPattern
from paint_deposition.model.eq2_projection import Projection
from paint_deposition.motion.trajectory import Trajectory
from paint_deposition.part.surface import Surface

WAYS = ('chosen', 'grid', 'random')
# Effects that a door shows, of every family that tells of places.
TRUTHS = (
    'air_drift', 'edge_build', 'convex_attraction', 'fog_gradient', 'tcp_tilt',
    'gauge_curvature_bias',
)  # fmt: skip
COUNTS = (20, 40, 60, 90)
# The power of so many chosen points is what the others need more points for.
REFERENCE = 40
REPEATS, RANDOM_SETS = 8, 3
# Times the usual size of the hidden effects: neither always seen nor never.
SCALE = 1.5
NOISE = GaugeNoise(texture=0.01)
EDGE_M, PARCELS, LEVEL = 0.012, 4_000_000, 0.05


@dataclass(frozen=True)
class Door:
    """A door of the shop: for the bench that paints it, and as the package sees it."""

    part: UnmeasuredPart
    bench: Bench
    usable: np.ndarray

    @staticmethod
    def of(seed: int) -> 'Door':
        """The door, the gun's path and the bell of this seed."""
        pattern, (job,) = draw_jobs(seed, [], ('door',))
        surface = Surface.from_triangles(*job.part.mesh(EDGE_M), EDGE_M)
        log = record(job.motion, job.plan.sample_s, stream(seed, 30))
        motion = Trajectory(
            log.stamps_ns, log.positions_m, log.quaternions_xyzw,
            trigger_stamps_ns=log.trigger_stamps_ns, trigger_flow=1.0 * log.trigger_on,
        )  # fmt: skip
        values = asdict(pattern)
        model = DepositionModel(
            planar=PlanarPattern(**{name: values[name] for name in PlanarPattern.model_fields}),
            projection=Projection(
                model_plane_m=pattern.model_plane_m, emission_offset_m=pattern.emission_offset_m
            ),
        )
        seen = look_at(surface, motion, model)
        part = UnmeasuredPart(seen.surface, seen.path, model, EFFECTS)
        film_um = part.film_um
        return Door(part, Bench(seed, job, pattern, PARCELS), usable_places(seen.surface, film_um))

    def random(self, count: int, seed: int) -> np.ndarray:
        """Usable vertices at random."""
        rng = np.random.default_rng([seed, count])
        return rng.choice(np.flatnonzero(self.usable), count, replace=False)

    def chosen(self, count: int) -> ChosenReadings:
        """The points that ``measure`` proposes."""
        return choose(self.part, count, REPEATS)

    def points(self, way: str, count: int, seed: int) -> np.ndarray:
        """Vertices by one of the ways."""
        if way == 'chosen':
            return self.chosen(count).vertices
        if way == 'grid':
            return grid_places(self.part.surface, self.usable, count)
        return self.random(count, seed)


@lru_cache(maxsize=2)
def door(seed: int) -> Door:
    """Kept for the other jobs of a process."""
    return Door.of(seed)


def expected(door_and_count: tuple[int, int]) -> dict:
    """Mean power over the effects with so many points on a door, by the way they were chosen."""
    warnings.simplefilter('ignore')
    seed, count = door_and_count
    here = door(seed)
    chosen = here.chosen(count)
    sets = [here.random(count, k) for k in range(RANDOM_SETS)]
    drawn = [here.part.power(rows, float(REPEATS)) for rows in sets]
    powers = {'chosen': [chosen.power], 'grid': [chosen.grid_power], 'random': drawn}
    mean = {way: float(np.mean([[*one.values()] for one in all_])) for way, all_ in powers.items()}
    return {'power': mean, 'count': count}


def diagnosed(door_truth_and_count: tuple[int, str, int]) -> dict:
    """Paint a door with a hidden effect, measure it in every way, and diagnose."""
    warnings.simplefilter('ignore')
    seed, truth, count = door_truth_and_count
    here, found = door(seed), {}
    for way in WAYS:
        rows = here.points(way, count, seed)
        at = here.part.surface.vertices_m[rows]
        truths = choose_truths(truth, stream(seed, 1), None, SCALE)
        film_um, expected_um = here.bench.readings(truths, at[:, 0], at[:, 2])
        rng = np.random.default_rng([seed, len(truth)])
        read_um, *_ = measure(np.arange(count), film_um, expected_um, NOISE, rng)
        readings = Readings.of(
            at, read_um, sigma_um=NOISE.sigma_um(expected_um),
            normals=here.part.surface.normals[rows],
        )  # fmt: skip
        part = Experiment.of('door', here.part.surface, here.part.path, readings)
        said = diagnose(Campaign((part,)), here.part.model, EFFECTS)
        found[way] = {
            'detected': said.p_value <= LEVEL,
            'named': any(truth in c.members for c in said.classes if c.best in said.accepted),
        }
    return {'said': found, 'count': count}


def power_table(powers: list[dict]) -> list[str]:
    """Mean power by the number of points, and how many points have the power of the reference."""
    counts = sorted({one['count'] for one in powers})
    mean = {
        way: [np.mean([p['power'][way] for p in powers if p['count'] == n]) for n in counts]
        for way in WAYS
    }
    lines = [f'{"points":>8}' + ''.join(f'{way:>10}' for way in WAYS)]
    for row, count in enumerate(counts):
        lines.append(f'{count:>8}' + ''.join(f'{100 * mean[w][row]:>8.1f} %' for w in WAYS))
    if REFERENCE not in counts:
        return lines
    wanted = mean['chosen'][counts.index(REFERENCE)]
    for way in WAYS[1:]:
        curve = np.maximum.accumulate(mean[way])
        enough = curve[-1] >= wanted
        needed = float(np.exp(np.interp(wanted, curve, np.log(counts))))
        place, saved = 'on a grid' if way == 'grid' else 'at random', 1.0 - REFERENCE / needed
        more, over = ('', '') if enough else ('more than ', 'over ')
        lines.append(
            f'as much as with {REFERENCE} chosen points takes {more}{needed:.0f} {place}: '
            f'{over}{100 * saved:.0f} % of the readings saved'
        )
    return lines


def diagnosis_table(records: list[dict]) -> list[str]:
    """How often the hidden effect was detected, and named, by the way the points were chosen."""
    lines = ['hidden effect of 1.5 times the usual size:   detected     named']
    for way in WAYS:
        own = [r['said'][way] for r in records]
        detected, named = (sum(one[key] for one in own) for key in ('detected', 'named'))
        lines.append(f'{way:>40}{detected:>7} of {len(own)}{named:>6} of {len(own)}')
    return lines


@click.command()
@click.option('--doors', default=3, show_default=True, help='Doors of different shape.')
@click.option('--count', default=40, show_default=True, help='Readings that are diagnosed.')
@click.option('--first-seed', default=41_000, show_default=True, help='For other doors.')
@results_option('bench-measure.jsonl')
@click.option('--report-only', is_flag=True, help='Print what is there.')
def main(doors: int, count: int, first_seed: int, results: Path, report_only: bool) -> None:
    """Compare chosen points with a grid and with random ones."""
    records = kept(results)
    seeds = range(first_seed, first_seed + doors)
    jobs = [(seed, n) for n in COUNTS for seed in seeds]
    jobs += [(seed, truth, count) for seed in seeds for truth in TRUTHS]
    if not report_only:
        done = {tuple(r['job']) for r in records}
        records = add(results, run, [job for job in jobs if job not in done])
    powers = [r for r in records if 'power' in r]
    said = [r for r in records if 'said' in r]
    click.echo('\n'.join([*power_table(powers), '', *diagnosis_table(said)]))


def run(job: tuple) -> list[dict]:
    """One line of the results."""
    return [{'job': job} | (expected(job) if len(job) == 2 else diagnosed(job))]


if __name__ == '__main__':
    main()

"""The paint shop: draws a job, hides an effect in it, paints on its bench, and takes readings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from types import MappingProxyType

import numpy as np

from .doors import Part, flat_panel
from .draw import brush_beside, draw_jobs, solids_cm3_per_s, stream, timed
from .flight import Air, Landings, fly
from .gauge import GaugeNoise, Readings, Spots, keep_clear, layout, scatter, tabulate
from .jobs import Job, Log, Plan, record, slices
from .parcels import Pattern, conner_plume, draw_pattern
from .truths import Scene, Truth, choose, plain

PARCELS = 8_000_000
POOL = 1 << 19
USUAL_NOISE = GaugeNoise()
NO_BRUSHES: Mapping[int, Pattern] = MappingProxyType({})


@dataclass(frozen=True)
class Experiment:
    """One painted part: its mesh, the controller's log and the gauge's tables."""

    name: str
    part: Part
    plan: Plan
    vertices_m: np.ndarray  # (v, 3)
    faces: np.ndarray  # (f, 3)
    log: Log
    readings: Readings
    heldout: Readings  # further points, for the judge alone


@dataclass(frozen=True)
class Campaign:
    """Experiments with one bell and one hidden truth."""

    pattern: Pattern
    experiments: tuple[Experiment, ...]
    truth: dict


def generate(
    seed: int, truth: str | list[str] | None = None, *, experiments: tuple[str, ...] = ('door',),
    readings: int = 100, repeats: int = 25, heldout: int = 60, style: str | None = None,
    noise: GaugeNoise = USUAL_NOISE, amplitude: float | dict | None = None, scale: float = 1.0,
    parcels: int = PARCELS, mesh_edge_m: float = 0.012, second_brush: float | None = None,
) -> Campaign:  # fmt: skip
    """A campaign; the same seed gives the same doors, paths, layout and noise for any truth.

    truth: None, an effect id, 'id~form', 'unknown:...', 'footprint:...', 'a+b' or a list.
    style: 'columns', 'rows', 'random' or None for any.
    amplitude: instead of typical x U(0.7, 2), in the effect's unit (dict: by id); scale multiplies
    a drawn one. second_brush: every other pass is painted with a brush 2, so many times as wide.
    """
    truths = choose(truth, stream(seed, 1), amplitude, scale)
    pattern, jobs = draw_jobs(seed, truths, experiments)
    brushes = {} if second_brush is None else {1: pattern, 2: brush_beside(pattern, second_brush)}
    jobs = [replace(job, plan=replace(job.plan, brushes=tuple(brushes))) for job in jobs]
    how = {'readings': readings, 'repeats': repeats, 'heldout': heldout, 'style': style,
           'noise': noise, 'mesh_edge_m': mesh_edge_m, 'brushes': brushes}  # fmt: skip
    painted = [_paint(seed, n, job, pattern, truths, parcels, **how) for n, job in enumerate(jobs)]
    return _campaign(seed, pattern, painted, truths, brushes)


def panel_study(
    seed: int, index_m: float = 0.577, *, readings: int = 75, repeats: int = 15,
    parcels: int = PARCELS,
) -> Campaign:  # fmt: skip
    """A flat panel, three passes of a bell (SB50 near 0.57 m), 20 um of film at 0.577 m."""
    rng = stream(seed, 11)
    pattern = draw_pattern(rng, rng.uniform(0.55, 0.59), solids_cm3_per_s(rng))
    speed = pattern.K1_cm3_per_s / (20.0 * 0.577)
    plan = Plan(index_m=index_m, passes=3, standoff_m=0.25, follow=0.0, overrun_m=0.55,
                gun_margin_m=0.50, teach_error_m=0.0, speed_m_per_s=speed)  # fmt: skip
    part = flat_panel(0.6, 2 * index_m + 0.5)
    job = Job('panel', part, *timed(part, plan, stream(seed, 12)))
    painted = _paint(seed, 0, job, pattern, [], parcels, readings=readings, repeats=repeats)
    return _campaign(seed, pattern, [painted], [], {})


class Bench:
    """Paints one job with any truths, always with the same parcels."""

    def __init__(
        self, seed: int, job: Job, pattern: Pattern, parcels: int,
        brushes: Mapping[int, Pattern] = NO_BRUSHES,
    ) -> None:  # fmt: skip
        """Where the plan names brushes, each paints its own passes with its pattern."""
        self.scene = Scene(job.part, pattern, job.motion)
        self.parcels_total = parcels
        self.plume = conner_plume(pattern, POOL, seed=seed)
        self._clean_landings = {}
        numbers = sorted(set(job.plan.brushes))
        each = parcels // max(len(numbers), 1)
        self._brushes = [Bench(seed + n, job.of_brush(n), brushes[n], each) for n in numbers]

    def readings(self, truths: list[Truth], x, z) -> tuple[np.ndarray, np.ndarray]:
        """(film, what a noise-free gauge says) at the points, um."""
        film = self.film_at(truths, x, z)
        for t in truths:
            film = t.on_film(film, x, z, self.scene, lambda gx, gz: self.film_at(truths, gx, gz))
        reading = film
        for truth in truths:
            reading = truth.on_gauge(reading, x, z, self.scene)
        return film, reading

    def film_at(self, truths: list[Truth], x: np.ndarray, z: np.ndarray) -> np.ndarray:
        """Film of the parcels that land and stay, um."""
        if self._brushes:
            return sum(brush.film_at(truths, x, z) for brush in self._brushes)
        landings = self._landings(truths, x, z)
        kept = 1.0
        for truth in truths:
            kept = kept * truth.on_landing(landings, self.scene)
        return np.bincount(landings.point, landings.film_um * kept, minlength=x.size)

    def _landings(self, truths: list[Truth], x: np.ndarray, z: np.ndarray) -> Landings:
        # Those by which the parcels land elsewhere or in other numbers than in the clean job.
        places = ('on_plume', 'on_motion', 'on_flow', 'on_air')
        flying = [
            truth for truth in truths
            if any(getattr(type(truth), one) is not getattr(Truth, one) for one in places)
        ]  # fmt: skip
        key = (x.tobytes(), z.tobytes())
        if not flying and key in self._clean_landings:
            return self._clean_landings[key]
        nominal, pattern = self.scene.nominal, self.scene.pattern
        plume, motion = self.plume, nominal
        flow = lambda t: pattern.K1_cm3_per_s * nominal.commanded(t)  # noqa: E731
        for truth in flying:
            plume = truth.on_plume(plume, pattern)
            motion = truth.on_motion(motion, self.scene)
            flow = truth.on_flow(flow, self.scene)
        spraying = slices(motion, flow)
        air = Air(np.zeros_like(spraying.tcp_0_m), np.zeros_like(plume.x_m))
        for truth in flying:
            air = truth.on_air(air, spraying, plume)
        part = self.scene.part
        landings = fly(part, spraying, plume, air, part.point(x, z), pattern.model_plane_m,
                       pattern.emission_offset_m, self.parcels_total)  # fmt: skip
        if not flying:
            self._clean_landings[key] = landings
        return landings


def _paint(
    seed: int, number: int, job: Job, pattern: Pattern, truths: list[Truth], parcels: int, *,
    readings: int, repeats: int, heldout: int = 40, style: str | None = 'columns',
    noise: GaugeNoise = USUAL_NOISE, mesh_edge_m: float = 0.012,
    brushes: Mapping[int, Pattern] = NO_BRUSHES,
) -> Experiment:  # fmt: skip
    rng = stream(seed, 40 + number)
    style = style or str(rng.choice(['columns', 'rows', 'random']))
    spots = keep_clear(job.part, layout(job.part, style, readings, repeats, rng))
    others = keep_clear(job.part, Spots.at(*scatter(job.part, heldout, rng, 0.015)))
    at_x, at_z = np.concatenate([spots.x_m, others.x_m]), np.concatenate([spots.z_m, others.z_m])
    bench = Bench(seed, job, pattern, parcels, brushes)
    clean, _ = bench.readings([], at_x, at_z)
    film, expected = bench.readings(truths, at_x, at_z)
    first = len(spots.x_m)
    marks = np.empty((at_x.size, len(truths)))
    for k, one in enumerate(truths):
        alone = expected if len(truths) == 1 else bench.readings([one], at_x, at_z)[1]
        marks[:, k] = alone - clean
    offset = noise.session_offset_um * rng.normal()
    tables = []
    for chosen, part in ((spots, slice(0, first)), (others, slice(first, None))):
        films = film[part], expected[part], clean[part], marks[part]
        tables.append(tabulate(job.part, chosen, *films, noise, offset, rng))
    log = record(job.motion, job.plan.sample_s, rng)
    return Experiment(job.name, job.part, job.plan, *job.part.mesh(mesh_edge_m), log, *tables)


def gauged(
    job: Job, x: np.ndarray, z: np.ndarray, films: tuple[np.ndarray, ...], noise: GaugeNoise,
    level: float, offset: float, rng: np.random.Generator,
) -> Experiment:  # fmt: skip
    """A part with readings at points (n,): film, what a gauge says, and film without effects."""
    none = np.empty((x.size, 0))  # what each effect does by itself is not asked here
    levelled = (level * film for film in films)
    table = tabulate(job.part, Spots.at(x, z), *levelled, none, noise, offset, rng)
    log, nothing = record(job.motion, job.plan.sample_s, rng), table.select(slice(0))
    return Experiment(job.name, job.part, job.plan, *job.part.mesh(), log, table, nothing)


def _campaign(
    seed: int, pattern: Pattern, painted: list[Experiment], truths: list[Truth],
    brushes: Mapping[int, Pattern],
) -> Campaign:  # fmt: skip
    truth = {
        'seed': seed, 'id': '+'.join(t.id for t in truths) or 'clean',
        'hidden': [t.as_dict() for t in truths], 'pattern': asdict(pattern),
        'brushes': {number: asdict(each) for number, each in brushes.items()},
    }  # fmt: skip
    return Campaign(pattern, tuple(painted), plain(truth))

"""The world of traced droplets: hard cases of the virtual paint shop, measured and judged.

Amounts can be compared only where truth and law mean the same by their parameters: errors of the
tool, shifts at the model plane, delays, levels and volumes, each in the form of its law that has
the amount. Attraction, shielding or losses follow laws of their own in the shop.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from tests.virtual_paint_shop.conner import film_um
from tests.virtual_paint_shop.draw import draw_jobs, stream
from tests.virtual_paint_shop.gauge import GaugeNoise, measure
from tests.virtual_paint_shop.jobs import Job
from tests.virtual_paint_shop.parcels import Pattern
from tests.virtual_paint_shop.shop import Campaign, Experiment, generate
from tests.virtual_paint_shop.truths import Truth, choose, library

from .record import Judged, Painted, Part, strengths

# Kernels of 12 mm probes then scatter by 0.4 % of the film, against a texture of 0.5 to 1.5 %.
PARCELS = 4_000_000
SIZES = (0.5, 8.0)  # in typical sizes of the effect
# The library's typical sizes are guesses: those of this shop are off by up to this factor.
GUESSED = 2.0
READINGS = (40, 400)
MESH_EDGES_M = (0.003, 0.015)
LAYOUTS = (('panel', 'door'), ('door',), ('panel', 'door', 'door_vertical'))
LAYOUT_SHARES = (0.5, 0.25, 0.25)
# Not seen at all beside the pattern, or only on a few points: no partners for a pair.
ALONE = ('level', 'time', 'visibility')
# Scatter of the film by the number of droplets traced, a share.
TRACED = 0.004
# Standard deviations of what a judge takes as free in a pattern; of lengths and volumes a share.
FREE = {'K1_cm3_per_s': 0.5, 'K2': 0.2, 'K3': 0.2, 'phi_rad': 0.6, 'r_m': 0.25, 'sigma1_m': 0.25,
        'sigma2_m': 0.25}  # fmt: skip
NAMES = {
    'gauge_zero': 'offset_um',
    'gun_wake': 'lag_s',
    'overspray_fog': 'fog_um',
    'pose_lag': 'lag_s',
    'tcp_standoff': 'offset_z_m',
}
# Angle of the truth, and parameters of the law, along the axes of the tool.
TURNED = {
    'tcp_offset': ('direction_rad', 'offset_x_m', 'offset_y_m'),
    'tcp_tilt': ('axis_rad', 'tilt_x_rad', 'tilt_y_rad'),
}
SAG_REFERENCE_UM = 20.0
# Other forms of a law that mean the same by their amount: a shift at the model plane.
SAME_AMOUNT = {'air_drift': ('square', 'carried'), 'gun_wake': ('even',)}


@dataclass(frozen=True)
class Case:
    """One campaign to be painted."""

    seed: int
    kind: str
    truths: tuple[str, ...]  # names, with the form of the law
    amplitudes: tuple[float, ...]
    layout: tuple[str, ...]
    readings: int  # on all parts together
    stated: bool  # the gauge's noise is stated, else to be had from repeats
    mesh_edge_m: float
    noise: GaugeNoise


def draw_case(seed: int, kind: str, truths: tuple[str, ...] | None = None) -> Case:
    """A campaign of a kind; `truths` names what is hidden instead of a draw."""
    rng = stream(seed, 60)
    names = _drawn_truths(kind, rng) if truths is None else truths
    known = library()
    layout = LAYOUTS[rng.choice(len(LAYOUTS), p=LAYOUT_SHARES)]
    return Case(
        seed,
        kind,
        names,
        tuple(amplitude(known[name], rng) for name in names),
        layout,
        int(_log_uniform(rng, *READINGS)),
        bool(rng.random() < 0.5),
        float(_log_uniform(rng, *MESH_EDGES_M)),
        GaugeNoise(
            floor_um=rng.uniform(0.4, 1.0),
            relative=rng.uniform(0.0, 0.01),
            heavy_tails=bool(rng.random() < 0.2),
            session_offset_um=_log_uniform(rng, 0.3, 1.0),
            texture=_log_uniform(rng, 0.005, 0.015),
            level=_log_uniform(rng, 0.01, 0.04),
            slip_fraction=0.01 if rng.random() < 0.2 else 0.0,
        ),
    )


def amplitude(truth: type[Truth], rng: np.random.Generator) -> float:
    guess = _log_uniform(rng, 1.0 / GUESSED, GUESSED)
    return float(truth.of_size(guess * _log_uniform(rng, *SIZES), rng))


def _painted(case: Case, parcels: int) -> Campaign:
    """The case's parts with their films; the noise in their readings is one draw of many."""
    each = -(-case.readings // len(case.layout))
    return generate(
        case.seed,
        list(case.truths) or None,
        experiments=case.layout,
        readings=each,
        repeats=0 if case.stated else max(each // 4, 8),
        heldout=80,
        noise=case.noise,
        amplitude=dict(zip(case.truths, case.amplitudes, strict=True)),
        parcels=parcels,
        mesh_edge_m=case.mesh_edge_m,
    )


def _drawn_truths(kind: str, rng: np.random.Generator) -> tuple[str, ...]:
    """Every cause is as likely as any other, and every form of its law."""
    if kind == 'clean':
        return ()
    prefix = {'unknown': 'unknown:', 'footprint': 'footprint:'}.get(kind)
    causes: dict[str, list[type[Truth]]] = {}
    for truth in library().values():
        strange = truth.id.startswith(('unknown:', 'footprint:'))
        if truth.id.startswith(prefix) if prefix else not strange:
            causes.setdefault(truth.id, []).append(truth)
    if kind != 'pair':
        return (_any_form(causes[rng.choice(sorted(causes))], rng),)
    partners = sorted(c for c, forms in causes.items() if forms[0].family not in ALONE)
    while True:
        one, other = rng.choice(partners, 2, replace=False)
        if causes[one][0].family != causes[other][0].family:
            return _any_form(causes[one], rng), _any_form(causes[other], rng)


def _any_form(forms: list[type[Truth]], rng: np.random.Generator) -> str:
    return forms[rng.integers(len(forms))].name()


def _log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def paint(
    seed: int,
    kind: str,
    effects: tuple[str, ...] | None = None,
    case: Case | None = None,
    parcels: int = PARCELS,
) -> Painted:
    """A case painted and measured, with what a judge of a diagnosis needs to know.

    Args:
        effects: names of what is hidden, instead of a draw.
        case: this one instead of the one of seed and kind.
    """
    case = draw_case(seed, kind, effects) if case is None else case
    painted = _painted(case, parcels)
    rng, amplitudes = stream(case.seed, 61), dict(zip(case.truths, case.amplitudes, strict=True))
    truths = choose(list(case.truths), stream(case.seed, 1), amplitudes)
    pattern, jobs = draw_jobs(case.seed, truths, case.layout)
    parts, judged = zip(*(
        _measured(case, experiment, pattern, job, rng)
        for experiment, job in zip(painted.experiments, jobs, strict=True)
    ), strict=True)  # fmt: skip
    together, *each = strengths(judged)
    hidden = painted.truth['hidden']
    passes = [job.plan.passes for job in jobs]
    noise_from = 'stated' if case.stated else 'repeats'
    return Painted(
        'droplets', seed, kind, tuple(name.partition('~')[0] for name in case.truths),
        parts, together, tuple(each),
        true_amounts(hidden[0], passes) if len(hidden) == 1 else {},
        case.noise.level, case.noise.session_offset_um,
        {'shape': 'conner', 'noise_from': noise_from, 'truths': case.truths,
         'amplitudes': case.amplitudes, 'mesh_edge_m': case.mesh_edge_m},
    )  # fmt: skip


def _measured(
    case: Case, experiment: Experiment, pattern: Pattern, job: Job, rng: np.random.Generator
) -> tuple[Part, Judged]:
    """The part as read in one session, and what the judge needs of its points."""
    noise, table, unseen = case.noise, experiment.readings, experiment.heldout
    read_um, level, zero_um = measure(table.point, table.film_um, table.expected_um, noise, rng)
    log, texture = experiment.log, np.hypot(noise.texture, TRACED)
    part = Part(
        experiment.name, experiment.vertices_m, experiment.faces, log.stamps_ns, log.positions_m,
        log.quaternions_xyzw, log.trigger_stamps_ns, log.trigger_on, table.positions_m,
        table.point, read_um, table.sigma_um if case.stated else None,
        unseen.positions_m,
        unseen.film_um * (level - 1.0) + unseen.expected_um + zero_um,
        np.hypot(noise.sigma_um(unseen.expected_um), texture * unseen.film_um),
    )  # fmt: skip
    _, first, count = np.unique(table.point, return_index=True, return_counts=True)
    film, marks = table.film_um[first], table.marks_um[first]
    together = (table.expected_um - table.clean_um)[first]
    gauge = noise.sigma_um(table.expected_um[first]) / np.sqrt(count)
    own = np.column_stack([noise.level * film, np.full(film.size, noise.session_offset_um)])
    sigma = np.hypot(gauge, texture * film)
    slopes = _pattern_slopes_um(pattern, job, table.positions_m[first], table.normals[first])
    return part, Judged(np.column_stack([together, marks]), slopes, own, sigma)


def _pattern_slopes_um(
    pattern: Pattern, job: Job, points_m: np.ndarray, normals: np.ndarray
) -> np.ndarray:
    """(P, 7) change of the film with the pattern's parameters, each in its standard deviation."""
    plain = film_um(pattern, job.motion, points_m, normals, 0.05)
    columns = []
    for name, deviation in FREE.items():
        value = getattr(pattern, name)
        step = 0.02 * deviation * (value if name.endswith(('_m', '_s')) else 1.0)
        bent = film_um(replace(pattern, **{name: value + step}), job.motion, points_m, normals,
                       0.05)  # fmt: skip
        columns.append((bent - plain) / 0.02)
    return np.stack(columns, axis=1)


def true_amounts(hidden: dict, passes: list[int]) -> dict[str, float]:
    """Values of parameters, `effect.parameter`, that stand for a truth.

    None where the laws cannot be compared.

    Args:
        hidden: the truth's entry in ``truth.json``.
        passes: number of passes of each experiment.
    """
    amplitude, truth = hidden['amplitude'], hidden['id']
    if hidden['form'] and hidden['form'] not in SAME_AMOUNT.get(truth, ()):
        return {}
    found = {NAMES[truth]: amplitude} if truth in NAMES else {}
    if truth in TURNED:
        angle, *names = TURNED[truth]
        along = amplitude * np.array([np.cos(hidden[angle]), np.sin(hidden[angle])])
        found = dict(zip(names, along, strict=True))
    elif truth == 'air_drift':
        # The surface faces +y, so that its right side, seen by the gun, is -x.
        x, _, z = hidden['direction']
        found = {'shift_down_m': -amplitude * z, 'shift_across_m': -amplitude * x}
    elif truth == 'sag':
        found = {'run_m': amplitude / SAG_REFERENCE_UM}
    elif truth == 'flow_drift':
        found = {'drift_per_pass': np.mean([_growth(amplitude, n) for n in passes])}
    return {f'{truth}.{name}': float(value) for name, value in found.items()}


def _growth(drift: float, passes: int) -> float:
    """Mean growth from pass to pass where the flow is linear about the middle of the job."""
    half = 0.5 * (passes - 1)
    return ((1.0 + drift * half) / (1.0 - drift * half)) ** (1.0 / (passes - 1)) - 1.0

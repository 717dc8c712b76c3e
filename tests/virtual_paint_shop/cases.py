"""Hard campaigns for judging a diagnosis: what is hidden, how strong, and how it was measured.

A case fixes the parts, the gun's path, the hidden cause and the gauge.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .draw import stream
from .gauge import GaugeNoise
from .shop import Campaign, generate
from .truths import Truth, library

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


def paint(case: Case, parcels: int = PARCELS) -> Campaign:
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

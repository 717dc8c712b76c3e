"""What the kernel reads: a row of numbers for each sub-step, and the constants of the model."""

import math
from collections.abc import Sequence

import numpy as np

from paint_deposition.effects.base import Effect
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.kernel import eq2_flux as kernel
from paint_deposition.kernel.laws import Law
from paint_deposition.model.eq1_pattern import PlanarPattern
from paint_deposition.motion.path import SprayPath

Laws = tuple[tuple[Law, int], ...]
# Stands for a gain of nothing, which has no logarithm [um/s].
NO_GAIN_UM_PER_S = 1e-30


def model_constants(model: DepositionModel) -> np.ndarray:
    """(B, 11) constants of eqs. (1) and (2), a row a brush, as the kernel uses them."""
    return np.stack([_constants(model, planar) for planar in model.patterns])


def _constants(model: DepositionModel, planar: PlanarPattern) -> np.ndarray:
    projection = model.projection
    ring = planar.K1_cm3_per_s * (1.0 - planar.K2) / planar.gamma_m2
    centre = planar.K1_cm3_per_s * planar.K2 / (2.0 * np.pi * planar.sigma2_m**2)
    c = np.empty(kernel.MODEL_CONSTANTS)
    c[kernel.OMEGA] = projection.model_plane_m
    c[kernel.RING], c[kernel.CENTRE] = np.log2(np.maximum([ring, centre], NO_GAIN_UM_PER_S))
    c[kernel.RADIUS] = planar.r_m
    c[kernel.NARROW1] = 0.5 * np.log2(np.e) / planar.sigma1_m**2
    c[kernel.NARROW2] = 0.5 * np.log2(np.e) / planar.sigma2_m**2
    c[kernel.COS] = planar.K3 * np.cos(planar.phi_rad)
    c[kernel.SIN] = planar.K3 * np.sin(planar.phi_rad)
    c[kernel.NEAREST] = projection.nearest_m
    c[kernel.REACH] = model.reach_of_m(planar)
    c[kernel.SHADOW] = model.shadow
    return c


def compiled_laws(effects: Sequence[Effect]) -> tuple[Laws, Laws, np.ndarray]:
    """What the kernel inlines of effects.

    Flux factors and pattern scales, each with how many parameters it takes; (n,) parameters, one
    unused number where there are none.
    """
    found: list[Laws] = []
    values: list[float] = []
    for kind in ('flux_factor', 'pattern_scale'):
        chosen = [e for e in effects if getattr(type(e), kind) is not None]
        found.append(tuple((getattr(type(e), kind), len(e.values())) for e in chosen))
        values += [value for effect in chosen for value in effect.values()]
    return found[0], found[1], np.array(values or [0.0])


def term_constants(model: DepositionModel) -> np.ndarray:
    """(B, 11) constants with which the film's terms are kept apart, whatever their gains."""
    even = {'K1_cm3_per_s': 1.0, 'K2': 0.5}
    c = model_constants(model.with_patterns(p.model_copy(update=even) for p in model.patterns))
    c[:, [kernel.RING, kernel.CENTRE]] += 1.0
    return c


def term_weights(planar: PlanarPattern) -> tuple[np.ndarray, np.ndarray]:
    """How the terms of a brush's film add up.

    Returns:
        (7,) weights of the terms in the film, and (7, 7) in its derivatives by log K1, K2,
        K3 cos(phi), K3 sin(phi), r [m], log sigma1 and log sigma2, one row each.
    """
    p = planar
    ring, centre = p.K1_cm3_per_s * (1.0 - p.K2), p.K1_cm3_per_s * p.K2
    whole_ring = np.zeros(kernel.TERMS)
    whole_ring[[kernel.EVEN, kernel.BY_COS, kernel.BY_SIN]] = (
        1.0, p.K3 * math.cos(p.phi_rad), p.K3 * math.sin(p.phi_rad),
    )  # fmt: skip
    centred, outward, spread1, spread2 = np.eye(kernel.TERMS)[
        [kernel.CENTRED, kernel.OUTWARD, kernel.SPREAD1, kernel.SPREAD2]
    ]
    film = ring * whole_ring + centre * centred
    # The normalisation gamma is a square of lengths: r d/dr + sigma1 d/dsigma1 doubles it.
    log_gamma_by_r = p.gamma_by_r_m / p.gamma_m2
    log_gamma_by_sigma = 2.0 - p.r_m * log_gamma_by_r
    by_cos, by_sin = ring * np.eye(kernel.TERMS)[[kernel.BY_COS, kernel.BY_SIN]]
    return film, np.stack([
        film,
        p.K1_cm3_per_s * (centred - whole_ring),
        by_cos,
        by_sin,
        ring * (outward / p.sigma1_m**2 - log_gamma_by_r * whole_ring),
        ring * (spread1 / p.sigma1_m**2 - log_gamma_by_sigma * whole_ring),
        centre * (spread2 / p.sigma2_m**2 - 2.0 * centred),
    ])  # fmt: skip


def emission_points_m(model: DepositionModel, path: SprayPath) -> np.ndarray:
    """(M, 3) where the spray seems to come from on each sub-step [m]."""
    return path.position_m - model.projection.emission_offset_m * path.rotation[:, :, 2]


def step_rows(model: DepositionModel, path: SprayPath, origin_m: np.ndarray) -> np.ndarray:
    """(M, 16) sub-steps, coordinates relative to ``origin_m`` (3,)."""
    omega = model.projection.model_plane_m
    rows = np.empty((len(path), kernel.STEP_COLUMNS))
    rows[:, kernel.ORIGIN : kernel.AXIS_X] = emission_points_m(model, path) - origin_m
    rows[:, kernel.AXIS_X : kernel.AXIS_Y] = omega * path.rotation[:, :, 0]
    rows[:, kernel.AXIS_Y : kernel.AXIS_Z] = omega * path.rotation[:, :, 1]
    rows[:, kernel.AXIS_Z : kernel.SHIFT] = path.rotation[:, :, 2]
    rows[:, kernel.SHIFT : kernel.WEIGHT] = path.pattern_shift_m
    rows[:, kernel.WEIGHT] = path.dwell_s * path.flow * omega**2
    rows[:, kernel.SPEED] = path.speed_m_per_s
    return rows

"""What the kernel reads: sub-steps, constants of the model, and which rays are to be traced."""

import math

import numpy as np

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.kernel import eq2_flux as kernel
from paint_deposition.kernel.compiler import named_for_its_code, njit
from paint_deposition.kernel.eq2_flux import AXIS_Z, NEAREST, ORIGIN, within_reach
from paint_deposition.model.eq1_pattern import PlanarPattern
from paint_deposition.motion.path import SprayPath


def model_constants(model: DepositionModel) -> np.ndarray:
    """(B, 11) constants of eqs. (1) and (2), a row a brush, as the kernel uses them."""
    constants = np.empty((len(model.patterns), kernel.MODEL_CONSTANTS))
    for c, planar in zip(constants, model.patterns, strict=True):
        ring = planar.K1_cm3_per_s * (1.0 - planar.K2) / planar.gamma_m2
        centre = planar.K1_cm3_per_s * planar.K2 / (2.0 * np.pi * planar.sigma2_m**2)
        c[kernel.OMEGA] = model.projection.model_plane_m
        # Stands for a gain of nothing, which has no logarithm [um/s].
        c[kernel.RING], c[kernel.CENTRE] = np.log2(np.maximum([ring, centre], 1e-30))
        c[kernel.RADIUS] = planar.r_m
        c[kernel.NARROW1] = 0.5 * math.log2(math.e) / planar.sigma1_m**2
        c[kernel.NARROW2] = 0.5 * math.log2(math.e) / planar.sigma2_m**2
        c[kernel.COS] = planar.K3 * np.cos(planar.phi_rad)
        c[kernel.SIN] = planar.K3 * np.sin(planar.phi_rad)
        c[kernel.NEAREST] = model.projection.nearest_m
        c[kernel.REACH] = model.reach_of_m(planar)
        c[kernel.SHADOW] = model.shadow
    return constants


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
    within_r = math.erf(p.r_m / (math.sqrt(2.0) * p.sigma1_m))
    log_gamma_by_r = (2.0 * math.pi) ** 1.5 * p.sigma1_m * within_r / p.gamma_m2
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


# Lines of sight are traced anew after this travel of the emission point [m].
SIGHT_STEP_M = 0.01
# Rays traced at once, which bounds the memory.
RAYS_AT_ONCE = 200_000


@njit(cache=True, nogil=True)
@named_for_its_code
def reached_blocks(spheres, rows, tracing, brush, constants, tracings):
    """(S, B) bool, whether any sub-step of a tracing reaches a block."""
    lit = np.zeros((tracings, len(spheres)), dtype=np.bool_)
    for m in range(len(rows)):
        for block in range(len(spheres)):
            if within_reach(spheres[block], rows[m], constants[brush[m]]):
                lit[tracing[m], block] = True
    return lit


@njit(cache=True, nogil=True)
@named_for_its_code
def rays_to_trace(
    bounds, p, n, positions, normals, horizon, traced, rows, begins, brush, constants, which,
    block, starts,
):  # fmt: skip
    """Place in ``seen``, tracing and point of each ray that is needed."""
    count = 0
    for run in range(len(which)):
        count += bounds[block[run] + 1] - bounds[block[run]]
    places = np.empty(count, dtype=np.int64)
    tracings, points = np.empty_like(places), np.empty_like(places)
    count = 0
    for run in range(len(which)):
        eye = traced[which[run]]
        first = bounds[block[run]]
        for i in range(first, bounds[block[run] + 1]):
            x, y, z = eye[0] - positions[i, 0], eye[1] - positions[i, 1], eye[2] - positions[i, 2]
            height = x * normals[i, 0] + y * normals[i, 1] + z * normals[i, 2]
            if height > horizon[i] * np.sqrt(x * x + y * y + z * z):
                continue
            for m in range(begins[which[run]], begins[which[run] + 1]):
                step = rows[m]
                dx, dy = p[0, i] - step[ORIGIN], p[1, i] - step[ORIGIN + 1]
                dz = p[2, i] - step[ORIGIN + 2]
                along = dx * step[AXIS_Z] + dy * step[AXIS_Z + 1] + dz * step[AXIS_Z + 2]
                facing = -(dx * n[0, i] + dy * n[1, i] + dz * n[2, i])
                if facing > 0.0 and along > constants[brush[m], NEAREST]:
                    places[count] = starts[run] + i - first
                    tracings[count], points[count] = which[run], i
                    count += 1
                    break
    return places[:count], tracings[:count], points[:count]

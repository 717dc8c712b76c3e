"""What the kernel reads: a row of numbers for each sub-step, and the constants of the model."""

import numpy as np

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.kernel import accumulation as kernel
from paint_deposition.motion.path import SprayPath

# Stands for a gain of nothing, which has no logarithm [um/s].
NO_GAIN_UM_PER_S = 1e-30


def model_constants(model: DepositionModel) -> np.ndarray:
    """(11,) constants of eqs. (1) and (2) in the form in which the kernel uses them."""
    planar, projection = model.planar, model.projection
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
    c[kernel.REACH] = model.reach_m
    c[kernel.SHADOW] = model.shadow
    return c


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

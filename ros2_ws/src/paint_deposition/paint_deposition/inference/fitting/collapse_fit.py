"""Eq. (3) fitted to readings across the passes of a panel, as in section 4.1 of the paper."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from paint_deposition.inference.readings.panel import Panel
from paint_deposition.inference.readings.residuals import Residuals
from paint_deposition.model.collapse import ThreeGaussianCollapse

# Starts of the search: offset radii and standard deviations in units of the panel's scale.
RADII = (0.2, 0.35, 0.5)
SIGMAS = (0.12, 0.22)
# Residuals beyond this many standard deviations get a smaller weight.
ROBUST_AT = 2.0
NARROWEST, WIDEST = 0.02, 1.0


@dataclass(frozen=True)
class CollapseFit:
    """The three Gaussians of a pass.

    Attributes:
        collapse: eq. (3) for the first pass's speed.
        residuals: of the P points, with the film of all passes as the prediction.
    """

    collapse: ThreeGaussianCollapse
    residuals: Residuals


def fit_collapse(panel: Panel, measured_um: np.ndarray, sigma_um: np.ndarray) -> CollapseFit:
    """Fit eq. (3), summed over the passes, with a loss that is robust against gross errors.

    Args:
        panel: where points and passes lie.
        measured_um, sigma_um: (P,) point means and their standard deviations [um].
    """
    scale = panel.scale_m
    faster = panel.speed_m_per_s[0] / panel.speed_m_per_s
    places = panel.places_m / scale
    area = max(float(measured_um.mean()) * 1.0, 1e-3)

    def film(x: np.ndarray) -> np.ndarray:
        gains, centres, sigmas = x[:3] * area, np.array([x[3], -x[4], 0.0]), np.exp(x[5:])
        away = (places[:, :, np.newaxis] - centres) / sigmas
        heights = gains / (3.0 * np.sqrt(2.0 * np.pi) * sigmas)
        return ((heights * np.exp(-0.5 * away**2)).sum(axis=2) * faster).sum(axis=1)

    low = [0.0, 0.0, 0.0, 0.0, 0.0, *3 * [np.log(NARROWEST)]]
    high = [30.0, 30.0, 30.0, 1.5, 1.5, *3 * [np.log(WIDEST)]]
    found = [
        least_squares(
            lambda x: (film(x) - measured_um) / sigma_um,
            [1.0, 1.0, 1.0, radius, radius, *np.log([sigma, sigma, 1.5 * sigma])],
            bounds=(low, high),
            loss='soft_l1',
            f_scale=ROBUST_AT,
            x_scale=[1.0, 1.0, 1.0, 0.2, 0.2, 0.5, 0.5, 0.5],
            max_nfev=60,
        )
        for radius in RADII
        for sigma in SIGMAS
    ]
    best = min(found, key=lambda result: result.cost).x
    gain = best[:3] * area * scale
    sigma = np.exp(best[5:]) * scale
    collapse = ThreeGaussianCollapse(
        K1_um_m=gain[0], K2_um_m=gain[1], K3_um_m=gain[2],
        r1_m=best[3] * scale, r2_m=best[4] * scale,
        sigma1_m=sigma[0], sigma2_m=sigma[1], sigma3_m=sigma[2],
    )  # fmt: skip
    return CollapseFit(collapse, Residuals(measured_um, film(best), sigma_um))

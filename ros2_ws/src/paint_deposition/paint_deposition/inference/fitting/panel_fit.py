"""Eq. (3) fitted across the passes of a panel (section 4.1), and how far its readings reach.

Paint that lands beyond the readings is extrapolated. A little more film along a panel's rim, as
fat edges have it, then makes the fitted pattern far too wide, which its intervals do not show.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.optimize import least_squares

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import ReadingsError
from paint_deposition.film.pass_film import sampled_collapse
from paint_deposition.inference.fitting.least_squares import Fit
from paint_deposition.inference.fitting.study import Study
from paint_deposition.inference.readings.campaign import Campaign
from paint_deposition.inference.readings.panel import Panel
from paint_deposition.inference.readings.plausibility import FEWEST_POINTS
from paint_deposition.inference.readings.residuals import Residuals
from paint_deposition.model.eq3_collapse import ThreeGaussianCollapse

# Starts of the search: offset radii and standard deviations in units of the panel's scale.
RADII = (0.2, 0.35, 0.5)
SIGMAS = (0.12, 0.22)
# Residuals beyond this many standard deviations get a smaller weight.
ROBUST_AT = 2.0
NARROWEST, WIDEST = 0.02, 1.0


@dataclass(frozen=True)
class CollapseFit:
    """The three Gaussians of a pass."""

    # Eq. (3) for the first pass's speed.
    collapse: ThreeGaussianCollapse
    residuals: Residuals  # of the P points, with the film of all passes as the prediction


def fit_collapse(panel: Panel, measured_um: np.ndarray, sigma_um: np.ndarray) -> CollapseFit:
    """Fit eq. (3), summed over the passes, with a loss that is robust against gross errors.

    Args:
        panel: where points and passes lie.
        measured_um, sigma_um: (P,) point means and their standard deviations [um].
    """
    scale = panel.scale_m
    faster = panel.speed_m_per_s[0] / panel.speed_m_per_s
    places = panel.places_m / scale
    area = max(float(measured_um.mean()), 1e-3)

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
            bounds=(low, high), loss='soft_l1', f_scale=ROBUST_AT,
            x_scale=[1.0, 1.0, 1.0, 0.2, 0.2, 0.5, 0.5, 0.5], max_nfev=60,
        )
        for radius, sigma in product(RADII, SIGMAS)
    ]  # fmt: skip
    best = min(found, key=lambda result: result.cost).x
    gain = best[:3] * area * scale
    sigma = np.exp(best[5:]) * scale
    collapse = ThreeGaussianCollapse(
        K1_um_m=gain[0], K2_um_m=gain[1], K3_um_m=gain[2],
        r1_m=best[3] * scale, r2_m=best[4] * scale,
        sigma1_m=sigma[0], sigma2_m=sigma[1], sigma3_m=sigma[2],
    )  # fmt: skip
    return CollapseFit(collapse, Residuals(measured_um, film(best), sigma_um))


# Readings reach an edge of the pattern beyond which no more of a pass's paint lands than this.
MOST_BEYOND = 0.025
# Width of the strips at the ends without which the fit is repeated [m].
STRIPS_M = (0.05, 0.1)


@dataclass(frozen=True)
class Reach:
    """How far the readings of a panel reach to both sides of the pass that they cover best."""

    experiment: int  # its number
    name: str  # its name
    across_m: np.ndarray  # (P,) coordinate of its points across the passes [m]
    ends_m: tuple[float, float]  # distance of the outermost reading on either side [m]
    beyond: tuple[float, float]  # share of the pass's paint that lands further out on either side
    needed_m: float  # distance at which both sides would be reached [m]

    def __str__(self) -> str:
        return (
            f'{self.name}: the readings end {self.ends_m[0]:.2f} and {self.ends_m[1]:.2f} m to '
            f'the sides of a pass, where {100 * self.beyond[0]:.0f} and '
            f'{100 * self.beyond[1]:.0f} % of its paint lands further out: the edges of the '
            'pattern are extrapolated; measure, on a larger panel if need be, '
            f'about {self.needed_m:.1f} m to both sides of a pass'
        )


def short_reaches(campaign: Campaign, model: DepositionModel) -> tuple[Reach, ...]:
    """The panels of a campaign on which no pass was measured to both edges of its pattern.

    Of a brush there are none if one of its panels shows both edges, or where no part is a flat
    panel.
    """
    by_brush: dict[int, list[Reach]] = {}
    for k, one in enumerate(campaign.experiments):
        if panel := Panel.of(one):
            reach = _reach(k, one.name, panel, model.painting_with(panel.brush))
            by_brush.setdefault(panel.brush, []).append(reach)
    short = (f for f in by_brush.values() if min(max(r.beyond) for r in f) > MOST_BEYOND)
    return tuple(reach for found in short for reach in found)


def shifts(
    study: Study, fit: Fit, reaches: tuple[Reach, ...], fitted: Callable[[Study], Fit]
) -> np.ndarray:
    """(n, k) by how much the fit's vector moves without the readings at the ends.

    Args:
        reaches: panels whose ends are left out, strip by strip.
    """
    moved = []
    for strip_m in STRIPS_M:
        inside = np.ones(len(study), dtype=bool)
        for reach in reaches:
            low, high = reach.across_m.min() + strip_m, reach.across_m.max() - strip_m
            here = study.campaign.experiment_of == reach.experiment
            inside[here] = (reach.across_m >= low) & (reach.across_m <= high)
        if FEWEST_POINTS <= inside.sum() < len(inside):
            try:
                moved.append(fitted(study.of_points(inside)).vector - fit.vector)
            except ReadingsError:  # no reading of a part is left
                continue
    return np.array(moved).reshape(len(moved), len(fit.vector))


def _reach(number: int, name: str, panel: Panel, model: DepositionModel) -> Reach:
    reaches = []
    low, high = panel.across_m.min(), panel.across_m.max()
    passes = zip(panel.passes_m, panel.speed_m_per_s, panel.mirrored, strict=True)
    for line, speed, mirrored in passes:
        collapse = sampled_collapse(
            model, speed, standoff_m=panel.distance_m, travel_rad=panel.travel_rad, turned=mirrored
        )
        x, landed = collapse.x_m, cumulative_trapezoid(collapse.film_um, collapse.x_m, initial=0.0)
        landed = landed / landed[-1]
        below, above = np.interp([low - line, high - line], x, landed, left=0.0, right=1.0)
        beyond = float(below), float(1.0 - above)
        ends = np.interp([MOST_BEYOND, 1.0 - MOST_BEYOND], landed, x)
        to_ends = float(line - low), float(high - line)
        reaches.append(
            Reach(number, name, panel.across_m, to_ends, beyond, float(np.abs(ends).max()))
        )
    return min(reaches, key=lambda reach: max(reach.beyond))

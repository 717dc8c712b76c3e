"""Fitted parameters with their uncertainties, and what no law explains, in figures for people."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.linalg import solve_triangular

from paint_deposition.inference.fitting.least_squares import STEP, Fit, covariance_factor
from paint_deposition.inference.fitting.pattern_vector import PATTERN_NAMES, PatternVector

# Places of K3 and phi among the parameters of a pattern.
K3, PHASE = map(PATTERN_NAMES.index, ('K3', 'phi_rad'))


@dataclass(frozen=True)
class Estimate:
    """A parameter of the fitted model."""

    name: str  # as in the model file; 'effect.parameter' for effects
    value: float  # fitted
    sigma: float  # its standard deviation
    # 95 % interval, within what is possible.
    low: float
    high: float
    determined: bool  # whether the readings say anything about it
    reason: str = ''  # if not, why


def estimates(fit: Fit, shifts: np.ndarray | None = None) -> tuple[Estimate, ...]:
    """Every varied parameter with its uncertainty.

    The covariance is ``scaled_covariance``. Intervals are quantiles of the fit's normal
    distribution carried over to the parameters, in which a logarithm becomes a ratio and two
    components of the asymmetry its size and phase.
    """
    covariance = scaled_covariance(fit, shifts)
    sigma = np.sqrt(np.diag(_spread(fit, covariance)))
    weak = fit.parameters.weak_prior
    # A parameter was measured if its width has fallen below this share of its weak prior's.
    learned = np.sqrt(np.diag(covariance)) <= 0.5 * weak.width
    # So many standard deviations of it away no bell is.
    strange = np.abs(fit.vector - weak.centre) > 3.0 * weak.width
    at_low, at_high = np.isclose(fit.vector, fit.parameters.bounds, rtol=0.0, atol=1e-3)
    values = fit.parameters.values(fit.vector[np.newaxis])[0]
    pattern, found = fit.parameters.pattern, []
    random = np.random.default_rng(0)
    vectors = random.multivariate_normal(fit.vector, covariance, 4000, method='cholesky')
    inside = np.clip(vectors, *fit.parameters.bounds)
    away = _around_phase(fit.parameters.values(inside), values, pattern)
    # Ends of the 95 % intervals.
    low, high = values + np.quantile(away, (0.025, 0.975), axis=0)
    for k, name in enumerate(_names(fit)):
        row, place = divmod(k, len(PATTERN_NAMES))
        if row < pattern.count:
            own, first = pattern.entries(row), k - place
            k3, sigma_k3 = values[first + K3], sigma[first + K3]
            known = learned[own], strange[own], k3, sigma_k3
            reason = _pattern_reason(PATTERN_NAMES[place], values[k], sigma[k], *known)
        else:
            entry = k - len(pattern.names) + len(pattern)
            reason = '' if learned[entry] else 'these points hardly tell its size'
            if at_low[entry] or at_high[entry]:
                reason = 'it is at the bound of what is physical: its law may be another'
        value, sd, least, most = (float(of[k]) for of in (values, sigma, low, high))
        found.append(Estimate(name, value, sd, least, most, not reason, reason))
    return tuple(found)


def correlations(fit: Fit, shifts: np.ndarray | None = None) -> dict[tuple[str, str], float]:
    """Correlations of all pairs of parameters, strongest first."""
    spread = _spread(fit, scaled_covariance(fit, shifts))
    sigma = np.sqrt(np.diag(spread))
    matrix = spread / np.outer(sigma, sigma)
    names = _names(fit)
    pairs = {
        (names[i], names[j]): float(matrix[i, j])
        for i in range(len(names))
        for j in range(i)
        # Brushes share their phase.
        if not names[i].endswith('phi_rad') or not names[j].endswith('phi_rad')
    }
    return dict(sorted(pairs.items(), key=lambda item: -abs(item[1])))


def scaled_covariance(fit: Fit, shifts: np.ndarray | None = None) -> np.ndarray:
    """(k, k) covariance of the fit's vector, widened where residuals exceed the noise.

    Where the fit has a discrepancy for which its vector was not chosen, the vector is further off
    than the best one: the covariance is the sandwich of White (Econometrica 50:1, 1982).

    Args:
        shifts: (n, k) of the vector, each as likely as not, which are added as further standard
            deviations of their own directions.
    """
    plain, whitening = replace(fit, discrepancy=None).marginal, fit.parameters.prior.whitening
    data, prior = plain.jacobian.T @ plain.jacobian, whitening.T @ whitening
    spread, gain = data, np.linalg.inv(data + prior)
    if fit.discrepancy is not None:
        factor = covariance_factor(fit.nuisance)
        turned = solve_triangular(factor, plain.jacobian, lower=True, trans='T')
        spread = data + turned.T @ fit.discrepancy @ turned
    spread = max(fit.marginal.chi_square_per_freedom, 1.0) * spread
    covariance = gain @ (spread + prior) @ gain
    return covariance if shifts is None else covariance + shifts.T @ shifts


def _names(fit: Fit) -> tuple[str, ...]:
    parameters = fit.parameters
    return (*parameters.pattern.names, *(f'{effect}.{name}' for effect, name in parameters.varied))


def _around_phase(values: np.ndarray, centre: np.ndarray, pattern: PatternVector) -> np.ndarray:
    """The phases, which run in a circle, at most half a turn from their centres."""
    away = values - centre
    phases = slice(PHASE, len(pattern.names), len(PATTERN_NAMES))
    away[..., phases] = np.remainder(away[..., phases] + np.pi, 2.0 * np.pi) - np.pi
    return away


def _spread(fit: Fit, covariance: np.ndarray) -> np.ndarray:
    """(k, k) covariance of the parameters, linearised."""
    low, high = fit.parameters.bounds
    steps = STEP * np.eye(len(fit.vector))
    up, down = np.minimum(fit.vector + steps, high), np.maximum(fit.vector - steps, low)
    parameters = fit.parameters
    change = _around_phase(parameters.values(up), parameters.values(down), parameters.pattern)
    by_vector = (change / (up - down).sum(axis=1, keepdims=True)).T
    return by_vector @ covariance @ by_vector.T


def _pattern_reason(
    name: str, value: float, sigma: float, learned: np.ndarray, strange: np.ndarray, k3: float,
    sigma_k3: float,
) -> str:  # fmt: skip
    """Why a parameter of the pattern is not determined, '' if it is.

    Args:
        learned, strange: (7,) bool, of the entries of the pattern.
    """
    if name == 'phi_rad':
        # With the asymmetry so few standard deviations from zero its phase means nothing.
        if k3 < 2.0 * sigma_k3:
            return 'the asymmetry K3 is not significant, so it has no phase'
        if sigma > np.radians(45.0):
            return 'parallel passes hardly show the asymmetry along their travel; roll the gun'
        return ''
    if name == 'K3':
        return {
            0: 'the asymmetry does not show at these points',
            1: 'parallel passes show only its part across the travel; paint a pass with the gun '
            'rolled by 90 deg',
        }.get(int(learned[2]) + int(learned[3]), '')
    row = {'K1_cm3_per_s': 0, 'K2': 1, 'r_m': 4, 'sigma1_m': 5, 'sigma2_m': 6}[name]
    if name.endswith('_m') and strange[row]:
        return (
            f'no usual bell has {value:.2f} m; what the model lacks may have driven it there, see '
            'paint diagnose'
        )
    if not learned[row]:
        return 'its value comes from the prior of usual bells'
    # So large a standard deviation leaves the first digit open.
    if name in ('sigma1_m', 'sigma2_m') and sigma > 0.5 * value:
        return f'its standard deviation is {100 * sigma / value:.0f} % of it'
    return ''


@dataclass(frozen=True)
class FootprintProfile:
    """The footprint from its middle outward, averaged over the angle, over the peak of eq. (1)."""

    radius_m: np.ndarray  # (n,) on the model plane [m]
    # (n,) of eq. (1), as the readings have it, and how well they know it.
    eq1: np.ndarray
    found: np.ndarray
    sd: np.ndarray


@dataclass(frozen=True)
class DiscrepancyFigures:
    """The discrepancy in a campaign, as far as its readings show it."""

    # By how much the film of a setting differs from any law, and parts of one setting from each
    # other, as shares of the thickest film.
    setting_share: float
    part_share: float
    length_m: float  # over which neighbours differ alike [m]
    # Largest deviation of the footprint from eq. (1) that shows, over its peak.
    footprint_of_peak: float
    # Size of its deviations, over its peak, and the factor that is one standard deviation of it.
    footprint_size: tuple[float, float]
    profile: FootprintProfile  # of the footprint

    def to_dict(self) -> dict[str, float]:
        """Sizes and length, for JSON."""
        names = ('setting_share', 'part_share', 'length_m', 'footprint_of_peak')
        return {name: getattr(self, name) for name in names}

    @property
    def footprint(self) -> dict[str, Any]:
        """How far the footprint is from eq. (1), for JSON."""
        profile = {name: values.tolist() for name, values in vars(self.profile).items()}
        return {'deviation_of_peak': self.footprint_of_peak, 'profile': profile}

    def __str__(self) -> str:
        setting, peak = 100.0 * self.setting_share, 100.0 * self.footprint_of_peak
        parts = f', {100.0 * self.part_share:.1f} % between parts painted alike'
        footprint = f'; the footprint differs from eq. (1) by {peak:.0f} % of its peak'
        return (
            f'Model discrepancy, from usual sprays and these readings: {setting:.1f} % of the '
            f'thickest film for a setting{parts if self.part_share else ""}, correlated over '
            f'about {1e3 * self.length_m:.0f} mm{footprint if peak else ""}.'
        )

"""Where the unexplained shows: against which covariate, and in which region of the part."""

import numpy as np

from paint_deposition.inference.comparison.comparison import misfit_regions
from paint_deposition.inference.diagnosis.evidence import NullModel, simulated
from paint_deposition.inference.diagnosis.trial import Trial
from paint_deposition.inference.diagnosis.verdict import Unknown
from paint_deposition.inference.fitting.least_squares import Fit
from paint_deposition.inference.fitting.study import Study

# Degree of the polynomials in the ranks of a covariate.
DEGREE = 4
DRAWS = 1000
CURVE_POINTS = 15


def locate_unexplained(study: Study, fit: Fit, nothing: Trial, seed: int) -> Unknown:
    """Regress the deviations on each covariate, smoothly, and take the one that explains most.

    The p-value is that of the maximum over all covariates if sprays differed as usual ones do.

    Args:
        study: the readings.
        fit: the model so far.
        nothing: whose discrepancy is that of the sprays.
        seed: of the simulated deviations.
    """
    usual = nothing.remainder.covariance(nothing.remainder.usual(nothing.best.sizes))
    null = NullModel.around(fit, study.nuisance, remainder=usual)
    draws = simulated(len(study), study.noise.degrees_of_freedom, DRAWS, seed)
    found, by_chance = [], np.zeros(DRAWS)
    for covariate in filter(lambda c: c.varies, study.covariates(fit.model)):
        smooth = _smooth(covariate.values) / study.sigma_um[:, np.newaxis]
        directions, _ = np.linalg.qr(null.whiten(smooth))
        found.append((float(np.sum((directions.T @ null.deviation) ** 2)), covariate))
        by_chance = np.maximum(by_chance, np.sum((directions.T @ draws) ** 2, axis=0))
    strength, covariate = max(found, key=lambda item: item[0])
    smooth = np.column_stack([np.ones(len(study)), _smooth(covariate.values)])
    weights = 1.0 / study.sigma_um[:, np.newaxis]
    coefficients, *_ = np.linalg.lstsq(smooth * weights, fit.residual, rcond=None)
    order = np.argsort(covariate.values)
    points = order[np.linspace(0, len(order) - 1, CURVE_POINTS).astype(int)]
    regions = misfit_regions(study, study.residuals(fit.predicted_um), fit.model)
    names = [experiment.name for experiment in study.campaign.experiments]
    shown = [name for name in names if name in {region.experiment for region in regions}]
    first = regions[0] if regions else None
    mean_um = float(np.mean(study.measured_um[first.rows])) if first else np.nan
    return Unknown(
        covariate.name,
        float((1 + np.count_nonzero(by_chance >= strength)) / (1 + DRAWS)),
        {
            covariate.name: covariate.values[points].tolist(),
            'residual_um': (smooth[points] @ coefficients).tolist(),
        },
        first.description if first else 'no single place stands out',
        tuple(shown),
        shown[0] if shown and shown == names[-len(shown) :] != names else '',
        first.mean_residual_um if first else 0.0,
        first.mean_residual_um / (mean_um - first.mean_residual_um) if first else 0.0,
    )


def _smooth(values: np.ndarray) -> np.ndarray:
    """(P, DEGREE) polynomials of the values' ranks, so that outliers have no leverage."""
    ranks = np.argsort(np.argsort(values)) / max(len(values) - 1, 1)
    return np.polynomial.legendre.legvander(2.0 * ranks - 1.0, DEGREE)[:, 1:]

"""Coordinates of the pattern in which its uncertainty is about normal, and what is known of bells.

Logarithms of what is positive, and the asymmetry as K3 cos(phi) and K3 sin(phi), so that phi is
well-behaved when K3 vanishes.
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Coordinate:
    """One of them."""

    name: str  # as in the posterior of a model file
    # Mean and standard deviation of a weak prior.
    centre: float
    width: float
    # Bounds.
    low: float
    high: float
    between_jobs: float  # standard deviation between jobs of one bell at the same settings


# Weak priors: any bell's pattern lies well within two widths. They only keep finite what the
# readings do not determine.
#
# Between jobs: 4 % was found for the mean film of clearcoat on 40 panels painted alike; another
# batch of paint and another setting of the pump add to it. That the shape of the pattern varies
# by 6 %, with the viscosity and the wear of the cup, is an assumption, and wide on purpose: a
# value half of what jobs really differ takes many of them for a missing effect.
PATTERN = (
    Coordinate('log_K1', np.log(2.0), 2.0, np.log(1e-3), np.log(99.0), 0.10),
    Coordinate('K2', 0.3, 0.4, 0.0, 1.0, 0.06),
    Coordinate('K3_cos_phi', 0.0, 0.4, -0.99, 0.99, 0.06),
    Coordinate('K3_sin_phi', 0.0, 0.4, -0.99, 0.99, 0.06),
    Coordinate('r_m', 0.2, 0.15, 0.0, 0.99, 0.012),
    Coordinate('log_sigma1', np.log(0.09), 0.7, np.log(0.006), np.log(0.9), 0.06),
    Coordinate('log_sigma2', np.log(0.14), 0.7, np.log(0.006), np.log(0.9), 0.06),
)
# An effect's parameters differ between jobs by this share of their prior width; an assumption.
EFFECT_BETWEEN_JOBS = 0.6

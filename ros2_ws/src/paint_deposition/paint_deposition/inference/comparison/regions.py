"""Regions of the part where the model misses the readings, in words and numbers."""

from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.inference.fitting.study import Study
from paint_deposition.inference.readings.residuals import Residuals

# Regions are discs of these radii about a point [m], or bands of some sixths of the height.
RADII_M = (0.08, 0.12, 0.18, 0.26, 0.36)
BANDS = 6
FEWEST = 2
MOST_REGIONS = 6
# Significance level: the probability that noise alone gives a part any region.
SIGNIFICANCE = 0.02
DRAWS = 1000
SEED = 0


@dataclass(frozen=True)
class Region:
    """Neighbouring points whose mean residual is significant.

    Attributes:
        description: in words, for a report.
        experiment: name.
        rows: (n,) points of the study.
        readings: single readings at those points.
        mean_residual_um: measured minus predicted [um].
    """

    description: str
    experiment: str
    rows: np.ndarray
    readings: int
    mean_residual_um: float

    def to_dict(self) -> dict[str, Any]:
        """An entry of ``regions`` in the files of results."""
        names = ('description', 'experiment', 'readings', 'mean_residual_um')
        return {name: getattr(self, name) for name in names}


def misfit_regions(study: Study, points: Residuals, model: DepositionModel) -> list[Region]:
    """Significant regions, strongest first.

    Args:
        study: the readings.
        points: residuals of the study's P points.
        model: gives the incidence that the descriptions quote.
    """
    values = {c.name: c.values for c in study.covariates(model)}
    random = np.random.default_rng(SEED)
    found = []
    for index, experiment in enumerate(study.campaign.experiments):
        rows = np.flatnonzero(study.campaign.experiment_of == index)
        places = _windows(study.campaign.positions_m[rows], values['height_fraction'][rows])
        if not len(places):
            continue
        noise = np.abs(places @ random.normal(size=(len(rows), DRAWS))).max(axis=0)
        threshold = float(np.quantile(noise, 1.0 - SIGNIFICANCE))
        left = points.residual_um[rows] / points.sigma_um[rows]
        for _ in range(MOST_REGIONS):
            scores = places @ left
            best = int(np.argmax(np.abs(scores)))
            if abs(scores[best]) < threshold:
                break
            members = places[best] > 0.0
            region = rows[members]
            readings = int(study.campaign.means.repeats[region].sum())
            mean = float(np.mean(points.residual_um[region]))
            words = _described(values, region, rows, readings, mean)
            described = Region(words, experiment.name, region, readings, mean)
            found.append((abs(scores[best]), described))
            # The next region is sought among the other points.
            left = np.where(members, 0.0, left)
    return [region for _, region in sorted(found, key=lambda item: -item[0])]


def _windows(positions_m: np.ndarray, height: np.ndarray) -> np.ndarray:
    """(W, P) windows over the points: discs about each and bands of height, of unit length.

    A window's product with independent deviations is standard normal, so the largest over all
    windows can be compared with that of noise (spatial scan: Kulldorff 1997).
    """
    distance = np.linalg.norm(positions_m[:, np.newaxis] - positions_m[np.newaxis], axis=2)
    discs = [distance < radius for radius in RADII_M]
    ends = combinations(np.linspace(0.0, 1.0, BANDS + 1), 2)
    bands = [(height >= low) & (height <= high) for low, high in ends]
    members = np.unique(np.vstack([*discs, *bands]), axis=0).astype(float)
    count = members.sum(axis=1, keepdims=True)
    enough = (count[:, 0] >= FEWEST) & (count[:, 0] < len(positions_m))
    return (members / np.sqrt(np.maximum(count, 1.0)))[enough]


def _described(
    values: dict[str, np.ndarray],
    region: np.ndarray,
    rows: np.ndarray,
    readings: int,
    mean_um: float,
) -> str:
    incidence = values['incidence_deg'][region]
    return (
        f'{_place(values, region, rows)}, {readings} readings, model {abs(mean_um):.1f} µm '
        f'{"low" if mean_um > 0 else "high"}, incidence {incidence.min():.0f}-'
        f'{incidence.max():.0f} deg'
    )


def _place(values: dict[str, np.ndarray], region: np.ndarray, rows: np.ndarray) -> str:
    """The thirds of the part's height, and the half as seen by the gun if it lies in one only."""
    height = values['height_fraction'][region]
    low, high = np.quantile(height, [0.1, 0.9])
    thirds = ['lower third', 'middle third', 'upper third']
    first, last = (int(min(2, max(0, 3 * value))) for value in (low, high))
    if last - first == 2:
        vertical = 'full height'
    else:
        vertical = ' and '.join(thirds[first : last + 1])
    across = values['across_m']
    ends = across[rows].min(), across[rows].max()
    share = (across[region] - ends[0]) / max(ends[1] - ends[0], 1e-9)
    if share.min() > 0.5:
        return f'{vertical}, right half'
    if share.max() < 0.5:
        return f'{vertical}, left half'
    return vertical

"""Where on a part the model is off: significant regions, and residuals over the surface."""

from dataclasses import dataclass
from itertools import combinations
from operator import itemgetter
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix, diags
from scipy.spatial import cKDTree

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.inference.fitting.study import Study
from paint_deposition.inference.readings.readings import Residuals
from paint_deposition.part.surface import Surface


@dataclass(frozen=True)
class Region:
    """Neighbouring points whose mean residual is significant."""

    description: str  # in words, for a report
    experiment: str  # name
    rows: np.ndarray  # (n,) points of the study
    readings: int  # single readings at those points
    mean_residual_um: float  # measured minus predicted [um]

    def to_dict(self) -> dict[str, Any]:
        """An entry of ``regions`` in the files of results."""
        names = ('description', 'experiment', 'readings', 'mean_residual_um')
        return {name: getattr(self, name) for name in names}


def misfit_regions(study: Study, points: Residuals, model: DepositionModel) -> list[Region]:
    """Significant regions, strongest first.

    Args:
        points: residuals of the study's P points.
        model: gives the incidence that the descriptions quote.
    """
    values = study.covariates(model)
    random = np.random.default_rng(0)
    found = []
    for index, experiment in enumerate(study.campaign.experiments):
        rows = np.flatnonzero(study.campaign.experiment_of == index)
        places = _windows(study.campaign.positions_m[rows], values['height_fraction'][rows])
        if not len(places):
            continue
        noise = np.abs(places @ random.normal(size=(len(rows), 1000))).max(axis=0)
        # Noise alone gives a part any region with a probability of 2 %.
        threshold = float(np.quantile(noise, 0.98))
        left = points.residual_um[rows] / points.sigma_um[rows]
        for _ in range(6):
            scores = places @ left
            best = int(np.argmax(np.abs(scores)))
            if abs(scores[best]) < threshold:
                break
            members = (places[best] > 0.0) & (left != 0.0)
            region = rows[members]
            readings = int(study.campaign.readings.repeats[region].sum())
            mean = float(np.mean(points.residual_um[region]))
            words = _described(values, region, rows, readings, mean)
            described = Region(words, experiment.name, region, readings, mean)
            found.append((-abs(scores[best]), described))
            # The next region is sought among the other points.
            left = np.where(members, 0.0, left)
    return [region for _, region in sorted(found, key=itemgetter(0))]


def _windows(positions_m: np.ndarray, height: np.ndarray) -> np.ndarray:
    """(W, P) windows over the points: discs about each and bands of height, of unit length.

    A window's product with independent deviations is standard normal, so the largest over all
    windows can be compared with that of noise (spatial scan: Kulldorff 1997).
    """
    distance = np.linalg.norm(positions_m[:, np.newaxis] - positions_m[np.newaxis], axis=2)
    # Discs of these radii about a point [m].
    discs = [distance < radius for radius in (0.08, 0.12, 0.18, 0.26, 0.36)]
    # Bands of some sixths of the height.
    ends = combinations(np.linspace(0.0, 1.0, 7), 2)
    bands = [(height >= low) & (height <= high) for low, high in ends]
    members = np.unique(np.vstack([*discs, *bands]), axis=0).astype(float)
    count = members.sum(axis=1, keepdims=True)
    enough = (count[:, 0] >= 2) & (count[:, 0] < len(positions_m))
    return (members / np.sqrt(np.maximum(count, 1.0)))[enough]


def _described(
    values: dict[str, np.ndarray], region: np.ndarray, rows: np.ndarray, readings: int,
    mean_um: float,
) -> str:  # fmt: skip
    """The region by thirds of the part's height, share of its width from the left, and misfit."""
    low, high = np.quantile(values['height_fraction'][region], [0.1, 0.9])
    first, last = (int(min(2, max(0, 3 * value))) for value in (low, high))
    thirds = ['lower third', 'middle third', 'upper third'][first : last + 1]
    place = 'full height' if len(thirds) == 3 else ' and '.join(thirds)
    across = values['across_m']
    share = (across[region] - across[rows].min()) / max(np.ptp(across[rows]), 1e-9)
    left, right = 100.0 * np.quantile(share, [0.1, 0.9])
    # A region that is wider than this share of its part [%] has no place across it, nor has one
    # of readings that all lie within so little [m].
    if right - left <= 60.0 and np.ptp(across[rows]) >= 0.05:
        from_left = f'{left:.0f}' if right - left < 1.0 else f'{left:.0f} to {right:.0f}'
        place += f' at {from_left} % of the width from the left'
    incidence = values['incidence_deg'][region]
    return (
        f'{place}, {readings} readings, model {abs(mean_um):.1f} µm '
        f'{"low" if mean_um > 0 else "high"}, incidence {incidence.min():.0f}-'
        f'{incidence.max():.0f} deg'
    )


def interpolation_matrix(
    surface: Surface, positions_m: np.ndarray, normals: np.ndarray
) -> tuple[csr_matrix, np.ndarray]:
    """Matrix (V, P) that interpolates values at points over the surface around them.

    Each vertex takes a mean of the points within a radius on its side of the part, weighted by
    a smooth kernel: single readings are noisy, and what matters is where neighbours agree. The
    radius is somewhat more than the usual distance between neighbouring points, 25 to 90 mm.

    Args:
        positions_m, normals: (P, 3) points on its surface.

    Returns:
        The matrix, and (V,) whether any point is in reach of the vertex, else its row is empty.
    """
    radius_m = 0.09
    if len(positions_m) > 1:
        nearest = cKDTree(positions_m).query(positions_m, k=2)[0][:, 1]
        radius_m = min(max(1.8 * float(np.median(nearest)), 0.025), radius_m)
    near = cKDTree(surface.vertices_m).sparse_distance_matrix(
        cKDTree(positions_m), radius_m, output_type='ndarray'
    )
    facing = np.einsum('ij,ij->i', surface.normals[near['i']], normals[near['j']])
    # Surface whose normal differs by more than 60 degrees is another side of the part.
    near = near[(facing > 0.5) & (near['v'] < radius_m)]
    weight = (1.0 - (near['v'] / radius_m) ** 2) ** 3
    shape = (len(surface.vertices_m), len(positions_m))
    matrix = csr_matrix((weight, (near['i'], near['j'])), shape=shape)
    total = np.asarray(matrix.sum(axis=1)).ravel()
    matrix = csr_matrix(diags(1.0 / np.where(total > 0.0, total, 1.0)) @ matrix)
    return matrix, np.diff(matrix.indptr) > 0

"""What readings and a film differ by, in figures and over the part."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix, diags
from scipy.spatial import cKDTree

from paint_deposition.film.statistics import DEFAULT_PAINTED_ABOVE_UM

# Skin whose normal differs by more than 60 degrees is another side of the part.
SAME_SIDE_COSINE = 0.5


@dataclass(frozen=True)
class Residuals:
    """Readings against predictions; residual = measured minus predicted.

    Attributes:
        positions_m: (N, 3) of the readings [m].
        predicted_um: (N,) [um].
        residual_um: (N,) [um].
        sigma_um: (N,) standard deviation of each reading [um].
    """

    positions_m: np.ndarray
    predicted_um: np.ndarray
    residual_um: np.ndarray
    sigma_um: np.ndarray

    @property
    def painted(self) -> np.ndarray:
        """(N,) whether the model predicts paint there."""
        return self.predicted_um > DEFAULT_PAINTED_ABOVE_UM

    @property
    def bias_um(self) -> float:
        """Mean residual [um]."""
        return float(self.residual_um.mean())

    @property
    def rmse_um(self) -> float:
        """Root mean square residual [um]."""
        return _root_mean_square(self.residual_um)

    @property
    def rmse_painted_um(self) -> float:
        """Root mean square residual where the model predicts paint [um], 0 if nowhere."""
        return _root_mean_square(self.residual_um[self.painted])

    @property
    def chi_square_per_reading(self) -> float:
        """Mean square of residual over sigma; 1 is the gauge's noise alone."""
        return float(np.mean((self.residual_um / self.sigma_um) ** 2))

    @property
    def worst(self) -> int:
        """Row of the residual that is largest in magnitude."""
        return int(np.argmax(np.abs(self.residual_um)))


def _root_mean_square(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0


def spreading(
    vertices_m: np.ndarray,
    vertex_normals: np.ndarray,
    points_m: np.ndarray,
    point_normals: np.ndarray,
    radius_m: float,
) -> csr_matrix:
    """Matrix (V, P) that spreads values at points over the skin around them.

    Each vertex takes the mean of the points within the radius on its side of the part, the nearer
    the heavier; the row of a vertex without any is empty.
    """
    near = cKDTree(vertices_m).sparse_distance_matrix(
        cKDTree(points_m), radius_m, output_type='ndarray'
    )
    facing = np.einsum('ij,ij->i', vertex_normals[near['i']], point_normals[near['j']])
    near = near[facing > SAME_SIDE_COSINE]
    # A vertex on a point takes its value alone.
    weight = (1.0 - (near['v'] / radius_m) ** 2) ** 2 / (near['v'] + 1e-3 * radius_m) ** 2
    shape = (len(vertices_m), len(points_m))
    matrix = csr_matrix((weight, (near['i'], near['j'])), shape=shape)
    total = np.asarray(matrix.sum(axis=1)).ravel()
    return csr_matrix(diags(1.0 / np.where(total > 0.0, total, 1.0)) @ matrix)

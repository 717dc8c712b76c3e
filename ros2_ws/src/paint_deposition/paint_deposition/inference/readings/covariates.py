"""Covariates: quantities that differ from point to point, against which a residual can show."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.effects.learned_curves import along_path, at_points
from paint_deposition.inference.readings.campaign import Experiment


def varies(values: np.ndarray) -> bool:
    """Whether a covariate (P,) differs between points by more than rounding in the recording."""
    return bool(np.std(values) > 1e-4 * np.max(np.abs(values)))


@dataclass(frozen=True)
class Rays:
    """Straight rays from the M spraying sub-steps to the P points, for eqs. (1) and (2) alone."""

    share: np.ndarray  # (M, P) film that each sub-step leaves at each point [um]
    # (M, P) where the ray pierces the model plane, tool axes [m].
    x_m: np.ndarray
    y_m: np.ndarray
    cos_incidence: np.ndarray  # (M, P)
    standoff_ratio: np.ndarray  # (M, P) distance along the axis over Omega
    rows: np.ndarray  # (M,) rows of the experiment's path
    experiment: Experiment  # whose path and points they join

    @staticmethod
    def of(experiment: Experiment, model: DepositionModel) -> 'Rays':
        """Trace them in plain NumPy; the sub-steps of a long path are thinned."""
        path, points = experiment.path, experiment.measured_points
        rows = np.flatnonzero(path.flow * path.dwell_s > 0.0)
        stride = 1 + len(rows) // 4000
        rows = rows[::stride]
        axes = path.rotation[rows]
        offset, omega = model.projection.emission_offset_m, model.projection.model_plane_m
        origin = path.position_m[rows] - offset * axes[:, :, 2]
        to_point = points.positions_m[np.newaxis] - origin[:, np.newaxis]
        local = to_point @ axes
        distance = np.linalg.norm(to_point, axis=2)
        facing = -np.einsum('mpi,pi->mp', to_point, points.normals)
        along = local[:, :, 2]
        lit = (along > model.projection.nearest_m) & (facing > 0.0)
        depth = np.where(lit, along, 1.0)
        x, y = (omega * local[:, :, k] / depth for k in (0, 1))
        flux = np.empty(x.shape)
        brush = model.pattern_rows(path.brush[rows])
        for number, planar in enumerate(model.patterns):
            own = brush == number
            flux[own] = planar.flux_um_per_s(x[own], y[own])
        flux *= (omega / depth) ** 2 * facing / depth
        weight = (path.flow * path.dwell_s)[rows] * stride
        share = np.where(lit, flux, 0.0) * weight[:, np.newaxis]
        cos_incidence = facing / np.maximum(distance, 1e-9)
        return Rays(share, x, y, cos_incidence, depth / omega, rows, experiment)

    def mean(self, values: np.ndarray) -> np.ndarray:
        """(P,) average of (M, P) or (M, 1) values, weighted by the film each ray left."""
        total = np.maximum(self.share.sum(axis=0), 1e-12)
        return (self.share * values).sum(axis=0) / total

    @property
    def main_pass(self) -> np.ndarray:
        """(P,) pass, from 0, that left most of the film at each point."""
        number = self.experiment.path.spray_pass
        by_pass = np.zeros((int(number.max()) + 1, self.share.shape[1]))
        np.add.at(by_pass, number[self.rows].astype(int), self.share)
        return by_pass.argmax(axis=0)

    @cached_property
    def along(self) -> dict[str, np.ndarray]:
        """Covariates by name, as arrays that broadcast to the M sub-steps and P points.

        (M, 1) what the path is like, (M, P) how a ray lands, (1, P) what the surface is like.
        """
        points, path = self.experiment.measured_points, self.experiment.path.select(self.rows)
        return {
            'incidence_deg': np.degrees(np.arccos(np.clip(self.cos_incidence, -1.0, 1.0))),
            'standoff_ratio': self.standoff_ratio,
            **{name: values[:, np.newaxis] for name, values in along_path(path).items()},
            **{name: values()[np.newaxis] for name, values in at_points(points).items()},
            'tool_x_m': self.x_m,
            'tool_y_m': self.y_m,
            'film_um': self.share.sum(axis=0)[np.newaxis],
        }

    @cached_property
    def covariates(self) -> dict[str, np.ndarray]:
        """(P,) all covariates of the points by name, on average over the film that arrived."""
        return {name: self.mean(values) for name, values in self.along.items()}

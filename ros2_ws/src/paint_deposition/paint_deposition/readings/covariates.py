"""Covariates: quantities that differ from point to point, against which a residual can show."""

from dataclasses import dataclass

import numpy as np

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.part.axes import across_axis
from paint_deposition.readings.campaign import Experiment

# Edge effects reach a few centimetres: the covariate decays over this length [m].
EDGE_LENGTH_M = 0.03
# Most sub-steps from which rays are traced; a longer path is thinned.
SUB_STEPS_USED = 4000
# A quantity whose standard deviation is a smaller share of its largest value is constant.
ROUNDING = 1e-4


@dataclass(frozen=True)
class Covariate:
    """One quantity at each point.

    Attributes:
        name: with its unit, as in the report.
        values: (P,).
    """

    name: str
    values: np.ndarray

    @property
    def varies(self) -> bool:
        """Whether it differs between points by more than rounding in the recording."""
        return bool(np.std(self.values) > ROUNDING * np.max(np.abs(self.values)))


@dataclass(frozen=True)
class Rays:
    """Straight rays from the M sub-steps that spray to the P points, for eqs. (1) and (2) alone.

    Attributes:
        share: (M, P) film that each sub-step leaves at each point [um].
        x_m, y_m: (M, P) where the ray pierces the model plane, tool axes [m].
        cos_incidence: (M, P). standoff_ratio: (M, P) distance along the axis over Omega.
        rows: (M,) rows of the experiment's path.
    """

    share: np.ndarray
    x_m: np.ndarray
    y_m: np.ndarray
    cos_incidence: np.ndarray
    standoff_ratio: np.ndarray
    rows: np.ndarray

    @staticmethod
    def of(experiment: Experiment, model: DepositionModel) -> 'Rays':
        """Trace them in plain NumPy; sub-steps are thinned to SUB_STEPS_USED."""
        path, points = experiment.path, experiment.measured_points
        rows = np.flatnonzero(path.flow * path.dwell_s > 0.0)
        stride = 1 + len(rows) // SUB_STEPS_USED
        rows = rows[::stride]
        axes = path.rotation[rows]
        offset, omega = model.projection.emission_offset_m, model.projection.model_plane_m
        origin = path.position_m[rows] - offset * axes[:, :, 2]
        to_point = points.positions_m[np.newaxis] - origin[:, np.newaxis]
        local = np.einsum('mpi,mij->mpj', to_point, axes)
        distance = np.linalg.norm(to_point, axis=2)
        facing = -np.einsum('mpi,pi->mp', to_point, points.normals)
        along = local[:, :, 2]
        lit = (along > max(offset, 1e-3)) & (facing > 0.0)
        depth = np.where(lit, along, 1.0)
        x, y = (omega * local[:, :, k] / depth for k in (0, 1))
        flux = model.planar.flux_um_per_s(x, y) * (omega / depth) ** 2 * facing / depth
        weight = (path.flow * path.dwell_s)[rows] * stride
        share = np.where(lit, flux, 0.0) * weight[:, np.newaxis]
        return Rays(share, x, y, facing / np.maximum(distance, 1e-9), depth / omega, rows)

    def mean(self, values: np.ndarray) -> np.ndarray:
        """(P,) average of (M, P) or (M, 1) values, weighted by the film each ray left."""
        total = np.maximum(self.share.sum(axis=0), 1e-12)
        return (self.share * values).sum(axis=0) / total


def covariates(experiment: Experiment, model: DepositionModel, rays: Rays) -> list[Covariate]:
    """All covariates of an experiment's P points."""
    points = experiment.measured_points
    path = experiment.path.select(rays.rows)
    start_ns = path.stamp_ns[0] if len(path) else 0
    seconds = (path.stamp_ns - start_ns) * 1e-9
    incidence = np.degrees(np.arccos(np.clip(rays.mean(rays.cos_incidence), -1.0, 1.0)))
    from_end = np.minimum(path.from_turn_m, path.to_turn_m)
    since_on = np.minimum(path.since_on_s, 1.0)
    return [
        Covariate('incidence_deg', incidence),
        Covariate('standoff_ratio', rays.mean(rays.standoff_ratio)),
        Covariate('curvature_per_m', points.curvature_per_m),
        Covariate('edge_closeness', np.exp(-points.edge_distance_m / EDGE_LENGTH_M)),
        Covariate('sky_view_factor', points.sky_view_factor),
        Covariate('height_fraction', points.height_fraction),
        Covariate('across_m', points.positions_m @ across_axis(points.outward, points.down)),
        Covariate('spray_pass', rays.mean(path.spray_pass[:, np.newaxis])),
        Covariate('time_s', rays.mean(seconds[:, np.newaxis])),
        Covariate('speed_m_per_s', rays.mean(path.speed_m_per_s[:, np.newaxis])),
        Covariate('stroke_end_m', rays.mean(from_end[:, np.newaxis])),
        Covariate('since_trigger_s', rays.mean(since_on[:, np.newaxis])),
        Covariate('tool_x_m', rays.mean(rays.x_m)),
        Covariate('tool_y_m', rays.mean(rays.y_m)),
        Covariate('film_um', rays.share.sum(axis=0)),
    ]

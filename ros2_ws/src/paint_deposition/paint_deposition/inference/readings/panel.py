"""A flat panel painted by straight parallel passes: coordinates across the passes."""

from dataclasses import dataclass

import numpy as np

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.film.pass_film import collapse_um
from paint_deposition.inference.readings.campaign import Experiment
from paint_deposition.motion.trajectory import ONLY_BRUSH

# Cosines of the largest angles: between normals of a flat panel, between parallel passes, and
# between the gun's axis and the panel's normal.
FLAT_COSINE = np.cos(np.radians(3.0))
PARALLEL_COSINE = np.cos(np.radians(2.0))
SQUARE_COSINE = np.cos(np.radians(5.0))
SHORTEST_PASS_M = 0.05
# All but the ends of a pass lie this close to one line [m].
INNER, STRAIGHT_M = (0.05, 0.95), 0.02


@dataclass(frozen=True)
class Panel:
    """Where readings and passes lie across the direction of travel."""

    across_m: np.ndarray  # (P,) coordinate of each point [m]
    passes_m: np.ndarray  # (n,) coordinate of each pass's line [m]
    speed_m_per_s: np.ndarray  # (n,) of each pass
    # (n,) bool, passes on which the gun was turned by half a turn against the first.
    mirrored: np.ndarray
    distance_m: float  # mean distance of the TCP from the surface, the standoff [m]
    travel_rad: float  # direction of the first pass in the tool's x-y frame [rad]
    brush: int = ONLY_BRUSH  # number of the brush of all passes

    @staticmethod
    def of(experiment: Experiment) -> 'Panel | None':
        """The panel of an experiment, or None if part or motion are of another kind."""
        normals = experiment.measured_points.normals
        positions = experiment.measured_points.positions_m
        outward = normals.mean(axis=0)
        outward /= np.linalg.norm(outward)
        if (normals @ outward).min() < FLAT_COSINE or len(experiment.brushes) != 1:
            return None
        path = experiment.path.select(experiment.path.flow > 0.0)
        passes = [path.select(path.spray_pass == n) for n in np.unique(path.spray_pass)]
        passes = [p for p in passes if p.dwell_s @ p.speed_m_per_s > SHORTEST_PASS_M]
        if not passes:
            return None
        travels = np.array([p.dwell_s @ p.velocity_m_per_s for p in passes])
        travels /= np.linalg.norm(travels, axis=1, keepdims=True)
        travel = travels[0]
        axes = np.array([np.median(p.rotation, axis=0) for p in passes])
        across, turned = np.cross(-outward, travel), axes[:, :, 0] @ axes[0, :, 0]
        # The first sub-steps of a pass may still be counted with the pass before.
        spread = [np.ptp(np.quantile(p.position_m @ across, INNER)) for p in passes]
        if (
            np.abs(travels @ travel).min() < PARALLEL_COSINE
            or (-axes[:, :, 2] @ outward).min() < SQUARE_COSINE
            or np.abs(turned).min() < PARALLEL_COSINE
            or max(spread) > STRAIGHT_M
        ):
            return None
        height = np.mean([np.median(p.position_m @ outward) for p in passes])
        return Panel(
            across_m=positions @ across,
            passes_m=np.array([np.median(p.position_m @ across) for p in passes]),
            speed_m_per_s=np.array([np.median(p.speed_m_per_s) for p in passes]),
            mirrored=turned < 0.0,
            distance_m=float(height - (positions @ outward).mean()),
            travel_rad=float(np.arctan2(travel @ axes[0, :, 1], travel @ axes[0, :, 0])),
            brush=min(experiment.brushes),
        )

    @property
    def scale_m(self) -> float:
        """Order of a pass's width: the index, or a share of the readings' extent [m]."""
        if len(self.passes_m) > 1:
            return float(np.median(np.diff(np.sort(self.passes_m))))
        return 0.6 * float(np.ptp(self.across_m))

    def film_um(self, model: DepositionModel, across_m: np.ndarray) -> np.ndarray:
        """Film of the passes on the panel at other places across them (L,) [um].

        Passes count as endless; effects on the finished film are left out.
        """
        of_brush, at = model.painting_with(self.brush), (self.distance_m, self.travel_rad)
        passes = zip(self.passes_m, self.speed_m_per_s, self.mirrored, strict=True)
        films = [
            collapse_um(of_brush, across_m - line, speed, *at, turned=mirrored)
            for line, speed, mirrored in passes
        ]
        return np.sum(films, axis=0)

    @property
    def places_m(self) -> np.ndarray:
        """(P, n) distance of each point from each pass's line, along that pass's own x axis."""
        away = self.across_m[:, np.newaxis] - self.passes_m
        return np.where(self.mirrored, -away, away)

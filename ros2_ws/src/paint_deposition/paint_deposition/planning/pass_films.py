"""Films of single passes over a part, kept so that the film of any set of passes is a sum."""

import math
from collections.abc import Callable

import numpy as np
from scipy.interpolate import CubicSpline

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.film.integrator import FilmIntegrator
from paint_deposition.motion.path_builder import spray_path
from paint_deposition.part.points import SurfacePoints
from paint_deposition.part.surface import Surface
from paint_deposition.planning.pass_motion import trajectory_of
from paint_deposition.planning.passes import PassStyle, plan_pass
from paint_deposition.planning.surface_map import SurfaceMap

MOST_POINTS = 1500
LINES_PER_SCALE = 5.0
COARSEST_STEP_M = 0.02
# Sub-steps for placing passes may be coarser than for its film: 1e-4 of the peak.
STEPS_PER_SIGMA = 5.0
SLOWEST_RATE_HZ = 10.0


class LineFilms:
    """Film at points spread evenly over the painted side, for passes along many lines.

    Args:
        surface: the part.
        surface_map: its smoothed surface.
        model: shadows and effects on the finished film are left out.
        style: how passes are run.
        finest_m: scale on which the film changes across a pass [m].
        beyond_m: lines are laid this far past the part's edges [m].
        progress: called with the share done.

    Attributes:
        lines_m: (L,) the lines, and low_m and high_m their ends [m].
        rows: (V,) vertices of the part at which films are kept.
        films_um: (L, V) film of each pass. sprayed_m: (L,) its travel with the gun open.
    """

    def __init__(
        self,
        surface: Surface,
        surface_map: SurfaceMap,
        model: DepositionModel,
        style: PassStyle,
        finest_m: float,
        beyond_m: float,
        progress: Callable[[float], None] = lambda share: None,
    ) -> None:
        chosen = spread(surface.vertex_areas_m2[surface_map.painted])
        rows = np.flatnonzero(surface_map.painted)[chosen]
        points = SurfacePoints(surface.vertices_m[rows], surface.normals[rows], down=surface.down)
        low, high = surface_map.extent_m[1]
        self.rows, self.surface_map, self.beyond_m = rows, surface_map, beyond_m
        self.low_m, self.high_m = low - beyond_m, high + beyond_m
        step = min(finest_m / LINES_PER_SCALE, COARSEST_STEP_M)
        self.lines_m = np.linspace(
            self.low_m, self.high_m, math.ceil((self.high_m - self.low_m) / step) + 1
        )
        integrator = FilmIntegrator(points, model)
        longest = finest_m / STEPS_PER_SIGMA
        # Slower poses would be gaps, at which the gun is off.
        rate = max(style.speed_m_per_s / longest, SLOWEST_RATE_HZ)
        self.films_um = np.empty((len(self.lines_m), len(rows)))
        self.sprayed_m = np.empty(len(self.lines_m))
        for k, across in enumerate(self.lines_m):
            planned = plan_pass(surface_map, float(across), style)
            motion = trajectory_of((planned,), style, rate_hz=rate)
            path, _ = spray_path(motion, max_step_m=longest)
            integrator.reset()
            integrator.add(path)
            self.films_um[k] = integrator.raw_um
            self.sprayed_m[k] = planned.sprayed_m
            progress((k + 1) / len(self.lines_m))
        # Cubic splines through the lines' films are linear in them: one matrix for all points.
        self._basis = CubicSpline(self.lines_m, np.eye(len(self.lines_m)))

    def weights(self, lines_m: np.ndarray) -> np.ndarray:
        """(..., L) weights of the kept films for passes along lines (..., n) [m]."""
        return self._basis(np.clip(lines_m, self.low_m, self.high_m)).sum(axis=-2)

    def sigma_n(self, lines_m: np.ndarray) -> np.ndarray:
        """(...) standard deviation over mean of the film of passes along lines (..., n) [m]."""
        film = self.weights(lines_m) @ self.films_um
        return film.std(axis=-1) / film.mean(axis=-1)


def spread(area_m2: np.ndarray) -> np.ndarray:
    """Rows that stand for equal shares of the area, MOST_POINTS at most."""
    reached = np.cumsum(area_m2)
    count = min(MOST_POINTS, 4 * len(area_m2))
    shares = (np.arange(count) + 0.5) / count * reached[-1]
    return np.searchsorted(reached, shares)

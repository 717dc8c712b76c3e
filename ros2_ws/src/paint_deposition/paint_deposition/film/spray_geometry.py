"""How the gun ran over the part, and what the coarseness of its mesh costs the film."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.film.gun_view import GunView, geometry_warnings
from paint_deposition.film.integrator import FilmIntegrator
from paint_deposition.motion.path import SprayPath
from paint_deposition.part.points import SurfacePoints
from paint_deposition.part.surface import Surface

# Distances from the surface are given without the few of approaches and ends.
RANGE = (0.05, 0.95)
# Sub-steps that stand for a longer path, and vertices among which the thickest film is looked for.
SUB_STEPS, VERTICES = 4000, 2000
# Where a curve begins the error goes with the edges, elsewhere with their square; by how much it
# depends on where the first corner lies, so half of what the first says is advised.
WANTED, SAFETY = 0.01, 0.5


@dataclass(frozen=True)
class SprayGeometry:
    """How the gun ran over the part while it sprayed."""

    passes: int  # that spray for 50 mm or more
    speed_m_per_s: float  # median of the TCP's over the paint sprayed [m/s]
    # Median distance of the TCP from the nearest surface where the gun is over the part, NaN where
    # it never is [m].
    standoff_m: float
    # 90 % of that paint leaves between these distances [m].
    standoff_low_m: float
    standoff_high_m: float
    off_normal_deg: float  # median angle between tool z and the way to that surface [deg]
    # Share of the spray's straight rays that meet the outward side of the part, 0 to 1.
    paint_over_part: float
    # Worst error of the film from flat facets of a curved part, as a share of the thickest film;
    # see ``facet_error``.
    facet_error: float
    warnings: tuple[str, ...] = ()  # what is odd, a line each, with its likely cause

    @property
    def sentence(self) -> str:
        """The figures in a line."""
        where = 'TCP nowhere over the part'
        if math.isfinite(self.standoff_m):
            where = (
                f'TCP {1e3 * self.standoff_m:.0f} mm from the surface (90 % of the paint from '
                f'{1e3 * self.standoff_low_m:.0f} to {1e3 * self.standoff_high_m:.0f} mm), '
                f'z {self.off_normal_deg:.0f} degrees off its normal'
            )
        return (
            f'{self.passes} {"pass" if self.passes == 1 else "passes"}, '
            f'{self.speed_m_per_s:.2f} m/s, {where}, {100 * self.paint_over_part:.0f} % of the '
            'paint over the part'
        )

    @property
    def facet_sentence(self) -> str:
        """What the coarseness of the mesh costs."""
        return f'coarseness of the mesh: up to {100 * self.facet_error:.1f} % of the peak film'

    def to_dict(self) -> dict[str, Any]:
        """The figures by name, with the sentence and the warnings."""
        return {**vars(self), 'sentence': self.sentence, 'warnings': list(self.warnings)}


def spray_geometry(
    surface: Surface, path: SprayPath, model: DepositionModel, frame_id: str = ''
) -> SprayGeometry:
    """Sum up how the gun ran over a part that is turned to it, and say what is odd.

    Some of the path sprays; of the model, pattern and projection count, effects do not.
    """
    facets, coarse = facet_error(surface, path, model)
    view = GunView(surface, path, model)
    low, middle, high, lean = [math.nan] * 4
    if view.over.any():
        distance = view.distance_m[view.over]
        low, middle, high = np.quantile(distance, [RANGE[0], 0.5, RANGE[1]]).tolist()
        lean = float(np.median(view.off_normal_deg[view.over]))
    return SprayGeometry(
        passes=len(view.passes),
        speed_m_per_s=float(np.median(view.path.speed_m_per_s)),
        standoff_m=middle,
        standoff_low_m=low,
        standoff_high_m=high,
        off_normal_deg=lean,
        paint_over_part=float(view.landing.mean()),
        facet_error=facets,
        # Wrong geometry also makes facets cost more: it is reported alone.
        warnings=tuple(geometry_warnings(view, frame_id)) or tuple(filter(None, [coarse])),
    )


def facet_error(surface: Surface, path: SprayPath, model: DepositionModel) -> tuple[float, str]:
    """How far the film is off because a curved part was cut into flat facets, and a warning.

    The worst error is a share of the thickest film, 0 on a plane; over 1 % the warning says where
    it is and what to do, else it is ''.

    In the middle of each edge the film on the mesh is compared with that on a curve through the
    corners, see ``part.creases``. On circular and on soft folds with radii of 40 to 530 mm, caps
    and doors, cut into edges of 6 to 50 mm, the estimate was 0.74 to 1.32 times the worst true
    error of the film, from 0.01 % to 13 % of its peak. Creases count as such and cost nothing.

    The part is turned to the gun; of the model, pattern and projection count, effects do not.
    """
    edges, count = surface.curved_edges, len(surface.curved_edges)
    if not count:
        return 0.0, ''
    some = slice(None, None, 1 + len(surface.vertices_m) // VERTICES)
    points = SurfacePoints(
        np.concatenate([edges['middle_m'], edges['curved_m'], surface.vertices_m[some]]),
        np.concatenate([edges['normal'], edges['curved_normal'], surface.normals[some]]),
    )
    painted = FilmIntegrator(points, model.model_copy(update={'effects': ()}))
    film_um = painted.raw_of(path.select(slice(None, None, 1 + len(path) // SUB_STEPS)))
    peak_um = film_um.max()
    if peak_um == 0.0:
        return 0.0, ''
    error_um = np.abs(film_um[count : 2 * count] - film_um[:count])
    share, worst = float(error_um.max() / peak_um), edges[error_um.argmax()]
    if share <= WANTED:
        return share, ''
    edge_m, turn_deg = float(worst['length_m']), np.degrees(worst['turn_rad'])
    place = ', '.join(f'{value:.3f}' for value in worst['middle_m'])
    return share, (
        f'the mesh is coarser than its curvature allows: the film is off by up to '
        f'{100 * share:.1f} % of its peak near ({place}) m, where an edge of '
        f'{1e3 * edge_m:.0f} mm turns by {turn_deg:.0f} degrees; export '
        f'it finer, with edges of about {1e3 * SAFETY * edge_m * WANTED / share:.1g} mm there'
    )


def facet_errors_um(
    surface: Surface, points: SurfacePoints, path: SprayPath, model: DepositionModel
) -> np.ndarray:
    """(P,) film on the curve that a mesh stands for less that on its facets, at points [um]."""
    edges, positions_m = surface.curved_edges, points.positions_m
    if not len(edges):
        return np.zeros(len(points))
    # A point within a triangle lies near the middles of its sides, and of few others. What an
    # edge's middle has fades toward its ends: at corners the mesh is right.
    near = range(1, 1 + min(8, len(edges)))
    away_m, edge = cKDTree(edges['middle_m']).query(positions_m, near)
    fading = np.clip(1.0 - (2.0 * away_m / edges['length_m'][edge]) ** 2, 0.0, None) ** 2
    if not fading.any():
        return np.zeros(len(points))
    off_m, turns = edges['curved_m'] - edges['middle_m'], edges['curved_normal'] - edges['normal']
    normals = points.normals + np.einsum('pk,pkx->px', fading, turns[edge])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    both = SurfacePoints(
        np.concatenate([positions_m, positions_m + np.einsum('pk,pkx->px', fading, off_m[edge])]),
        np.concatenate([points.normals, normals]),
    )
    painted = FilmIntegrator(both, model.model_copy(update={'effects': ()}))
    flat_um, curved_um = np.split(painted.raw_of(path), 2)
    return curved_um - flat_um

"""A booth for tests of effects: a standing panel, a door, a gun that looks along +y."""

from functools import cache
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

import paint_deposition as pd
import scenes
from paint_deposition.effects.base import Effect
from paint_deposition.film.integrator import FilmIntegrator
from paint_deposition.model.eq1_pattern import PlanarPattern
from paint_deposition.motion.path import SprayPath
from paint_deposition.motion.path_builder import spray_path
from paint_deposition.part.points import SurfacePoints
from scenes import stamps_ns
from surfaces import on_grid

SAMPLES = Path(__file__).resolve().parent.parent / 'ros2_ws/src/paint_deposition/samples'
# Tool x along the world's x, tool y down, tool z along +y, into the surface.
LOOKING_ALONG_Y = Rotation.from_matrix([[1, 0, 0], [0, 0, 1], [0, -1, 0]]).as_quat()
STANDOFF_M = 0.25
# A pattern that fits on the panel whole.
SMALL_PATTERN = PlanarPattern(K1_cm3_per_s=1.0, r_m=0.05, sigma1_m=0.03, sigma2_m=0.04)
MODEL = pd.DepositionModel(planar=SMALL_PATTERN)


def _square(half_m: float, spacing_m: float) -> tuple[np.ndarray, np.ndarray]:
    # An even number: eq. (1) has no one value at the very centre, so no vertex is to lie there.
    line = np.linspace(-half_m, half_m, 2 * round(half_m / spacing_m))
    x, z = np.meshgrid(line, line, indexing='ij')
    return on_grid(np.stack([x, 0.0 * x, z], axis=2))


@cache
def panel(half_m: float = 0.5, spacing_m: float = 0.02) -> pd.Surface:
    """A square panel in x and z around the origin, outward to -y."""
    return pd.Surface.from_triangles(*_square(half_m, spacing_m), 2.0 * spacing_m)


@cache
def panel_with_screen() -> pd.Surface:
    """The panel, and 100 mm before it a square screen of 100 mm around the axis y."""
    vertices, faces = _square(0.5, 0.02)
    screen, screen_faces = _square(0.05, 0.02)
    return pd.Surface.from_triangles(
        np.concatenate([vertices, screen - [0.0, 0.1, 0.0]]),
        np.concatenate([faces, screen_faces + len(vertices)]),
        0.04,
    )


@cache
def door() -> pd.Surface:
    """The sample door, coarse."""
    return pd.read_mesh(SAMPLES / 'door.stl', max_edge_length_m=0.05)


def spot(x_m: float = 0.0, z_m: float = 0.0, standoff_m: float = STANDOFF_M) -> pd.Trajectory:
    """A gun at rest for a second."""
    times = np.linspace(0.0, 1.0, 11)
    positions = np.tile([x_m, -standoff_m, z_m], (len(times), 1))
    return pd.Trajectory(stamps_ns(times), positions, np.tile(LOOKING_ALONG_Y, (len(times), 1)))


def serpentine(
    heights_m=(0.0,),
    half_width_m: float = 0.45,
    opens_at_m: float = 0.25,
    speed_m_per_s: float = 0.3,
    period_s: float = 0.02,
    flow: float = 1.0,
) -> pd.Trajectory:
    """Level passes in turn to +x and -x; the gun is open within +- opens_at_m."""
    corners = []
    for number, height in enumerate(heights_m):
        ends = [-half_width_m, half_width_m] if number % 2 == 0 else [half_width_m, -half_width_m]
        corners += [[end, -STANDOFF_M, height] for end in ends]
    corners = np.array(corners)
    legs = np.linalg.norm(np.diff(corners, axis=0), axis=1) / speed_m_per_s
    at_corner = np.concatenate([[0.0], np.cumsum(legs)])
    times = np.append(np.arange(0.0, at_corner[-1], period_s), at_corner[-1])
    positions = np.stack([np.interp(times, at_corner, corners[:, k]) for k in range(3)], axis=1)
    opens = (half_width_m - opens_at_m) / speed_m_per_s
    begins = at_corner[::2]
    changes = np.concatenate([begins + opens, begins + legs[0] - opens])
    flows = np.repeat([flow, 0.0], len(begins))
    order = np.argsort(changes)
    return pd.Trajectory(
        stamps_ns(times), positions, np.tile(LOOKING_ALONG_Y, (len(times), 1)),
        trigger_stamps_ns=stamps_ns(changes[order]), trigger_flow=flows[order],
    )  # fmt: skip


def path_of(trajectory: pd.Trajectory) -> SprayPath:
    """The sub-steps of a whole recording."""
    return spray_path(trajectory)[0]


def painted(
    surface: pd.Surface,
    motion: pd.Trajectory | SprayPath,
    *effects: Effect,
    model: pd.DepositionModel = MODEL,
    precision='double',
) -> FilmIntegrator:
    """The surface after the motion, with these effects."""
    path = motion if isinstance(motion, SprayPath) else path_of(motion)
    model = model.model_copy(update={'effects': effects})
    # By one thread, as readings are predicted: that is compiled once, in a third of the time.
    return scenes.painted(surface.points(), path, model, precision, surface, parallel=False)


def volume_cm3(film_um: np.ndarray, points: SurfacePoints) -> float:
    return float(film_um @ points.area_m2)


def centroid_m(film_um: np.ndarray, points: SurfacePoints) -> np.ndarray:
    """(3,) centre of the paint."""
    return (film_um * points.area_m2) @ points.positions_m / volume_cm3(film_um, points)


def spread_m(film_um: np.ndarray, points: SurfacePoints) -> float:
    """Root mean square distance of the paint from its centre."""
    away_m2 = ((points.positions_m - centroid_m(film_um, points)) ** 2).sum(axis=1)
    return float(np.sqrt(volume_cm3(film_um * away_m2, points) / volume_cm3(film_um, points)))

"""The film that one long straight pass leaves on a plane, across the direction of travel."""

import math
from typing import Any

import numpy as np

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import PaintError
from paint_deposition.film.integrator import FilmIntegrator
from paint_deposition.model.eq3_collapse import (
    NEGLIGIBLE,
    SampledCollapse,
    line_integral_um_m_per_s,
)
from paint_deposition.motion.path import SprayPath
from paint_deposition.part.points import SurfacePoints

# A standing panel, the gun on its +y side: forward travel is level, x of a profile points up.
TRAVEL = np.array([1.0, 0.0, 0.0])
ACROSS = np.array([0.0, 0.0, 1.0])
OUTWARD = np.array([0.0, 1.0, 0.0])
# Sub-steps grow from this length at the line's middle, where eq. (1) is not smooth [m].
FINEST_STEP_M = 2e-5


def collapse_um(
    model: DepositionModel,
    x_m: np.ndarray,
    speed_m_per_s: float,
    standoff_m: float | None = None,
    travel_rad: float = 0.0,
    backwards: bool = False,
    turned: bool = False,
    fineness: float = 1.0,
) -> np.ndarray:
    """Film of one long pass over a plane that the gun faces squarely, good to 1e-6 of its peak.

    The x axis is fixed in space: tool z times forward travel, to its right as the gun sees it.
    A gun that keeps its orientation lays the same profile both ways; one that is turned with the
    travel lays the mirrored one.

    Args:
        model: effects on the path and along the rays count; the plane is a standing panel,
            travel is level and x points up. Effects on the finished film are left out.
        x_m: (N,) distances from the gun's line [m].
        speed_m_per_s: of the gun along its line [m/s].
        standoff_m: TCP to plane [m]; default: where the plane is the model plane.
        travel_rad: direction of forward travel in the tool's x-y frame, from x to y [rad].
        backwards: the pass runs the other way.
        turned: the gun is turned by half a turn about its axis.
        fineness: steps along the pass, relative to those that are good to 1e-6.

    Returns:
        (N,) film [um].

    Raises:
        PaintError: speed or standoff is not above zero, or the plane is behind the emission point.
    """
    standoff = model.projection.nominal_standoff_m if standoff_m is None else standoff_m
    for name, value in (('speed_m_per_s', speed_m_per_s), ('standoff_m', standoff)):
        if not (math.isfinite(value) and value > 0.0):
            raise PaintError(f'{name} is {value:g}; give a number above 0')
    offset_m, nearest_m = model.projection.emission_offset_m, model.projection.nearest_m
    if standoff + offset_m <= nearest_m:
        raise PaintError(
            f'standoff_m is {standoff:g} and the emission point of the model lies {-offset_m:g} m '
            f'in front of the TCP: give a standoff above {nearest_m - offset_m:g}'
        )
    if model.effects:
        way = -1.0 if backwards else 1.0
        roll = travel_rad + (math.pi if turned else 0.0)
        return pass_film_um(model, x_m, way * speed_m_per_s, standoff, roll, fineness)
    shrinking = model.projection.model_plane_m / (standoff + model.projection.emission_offset_m)
    across = (-shrinking if turned else shrinking) * x_m
    return shrinking / speed_m_per_s * line_integral_um_m_per_s(model.planar, across, travel_rad)


def sampled_collapse(
    model: DepositionModel, speed_m_per_s: float, fineness: float = 1.0, **options: Any
) -> SampledCollapse:
    """``collapse_um`` sampled finely enough for sums over passes; options as there.

    At a fineness of 0.25 sigma_n of parallel passes is still good to 1e-5, in a tenth of the time.
    """
    standoff = options.get('standoff_m') or model.projection.nominal_standoff_m
    magnification = max(model.projection.magnification(standoff), 1e-6)
    reach = model.planar.radius_of_flux_m(NEGLIGIBLE) * model.widening * magnification
    finest = min(model.planar.sigma1_m, model.planar.sigma2_m) * magnification
    count = round(fineness * min(max(math.ceil(2.0 * reach / finest * 16.0), 257), 4097))
    x = np.linspace(-reach, reach, count | 1)
    # Where the asymmetry f turns over, at the centre, samples close in by halves.
    close = (x[1] - x[0]) * 0.5 ** np.arange(1, 16)
    x = np.sort(np.concatenate([x, close, -close]))
    film_um = collapse_um(model, x, speed_m_per_s, fineness=fineness, **options)
    return SampledCollapse(x, film_um, finest)


def pass_film_um(
    model: DepositionModel,
    x_m: np.ndarray,
    velocity_m_per_s: float,
    standoff_m: float,
    roll_rad: float,
    fineness: float = 1.0,
) -> np.ndarray:
    """``collapse_um`` with effects: integrated sub-step by sub-step.

    ``velocity_m_per_s`` is negative backwards, ``roll_rad`` the direction of travel in the tool.
    """
    # Middles and lengths of sub-steps, even in u with distance = FINEST_STEP_M sinh(u).
    magnification = model.projection.magnification(standoff_m)
    far = 1.5 * max(map(model.reach_of_m, model.patterns)) * magnification
    finest = min(model.planar.sigma1_m, model.planar.sigma2_m) * magnification
    u_far = math.asinh(far / FINEST_STEP_M)
    half = math.ceil(u_far * fineness * 5.0 * far / finest)
    u, step = np.linspace(-u_far, u_far, 2 * half, retstep=True)
    along, length = FINEST_STEP_M * np.sinh(u), FINEST_STEP_M * np.cosh(u) * step
    speed, way = abs(velocity_m_per_s), math.copysign(1.0, velocity_m_per_s)
    cos, sin = math.cos(roll_rad), math.sin(roll_rad)
    tool = np.stack([cos * TRAVEL - sin * ACROSS, sin * TRAVEL + cos * ACROSS, -OUTWARD], axis=1)
    path = SprayPath.of(
        stamp_ns=np.round(along / speed * 1e9).astype(np.int64),
        dwell_s=length / speed,
        flow=np.ones(len(along)),
        position_m=standoff_m * OUTWARD + way * along[:, None] * TRAVEL,
        rotation=np.tile(tool, (len(along), 1, 1)),
        velocity_m_per_s=np.tile(velocity_m_per_s * TRAVEL, (len(along), 1)),
    )
    points = SurfacePoints(x_m[:, None] * ACROSS, np.tile(OUTWARD, (len(x_m), 1)))
    return FilmIntegrator(points, model, precision='double').raw_of(path)

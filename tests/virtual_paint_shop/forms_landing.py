"""Other laws of the effects where the parcels land: alike in kind, not in form.

Nobody has measured these laws closely; each form follows from one of the mechanisms that are held
to be behind the effect, with the same reference as the effect's first law.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from scipy.interpolate import RectBivariateSpline

from .doors import OUTLINE_MARGIN_M, Part
from .flight import Air, Landings, Slices
from .parcels import Parcels
from .truths import KAPPA_REF_PER_M, Scene, with_narrowing
from .truths_landing import (
    ConvexAttraction,
    EdgeBuild,
    FaradayShielding,
    IncidenceAttraction,
    PatternSpread,
    StandoffEfficiency,
)

GRID_M = 0.01
RIM_M = np.array([0.03, 0.06, 0.09, 0.12])
HORIZON_M = np.array([0.01, 0.02, 0.04, 0.07, 0.11, 0.16])
AROUND = np.arange(12) * np.pi / 6


class _Edge(EdgeBuild):
    """A gain over the distance to the nearest free edge, in reaches."""

    shortest_m, longest_m = 0.01, 0.05

    @classmethod
    def details(cls, rng):
        return {'reach_m': rng.uniform(cls.shortest_m, cls.longest_m)}

    def on_landing(self, landings: Landings, scene: Scene) -> np.ndarray:
        x, z = landings.position_m[:, 0], landings.position_m[:, 2]
        d = np.maximum(scene.part.edge_distance(x, z), 0.0) / self.drawn['reach_m']
        return np.maximum(1.0 + self.amplitude * self.gain(d), 0.0)

    @staticmethod
    def gain(d: np.ndarray) -> np.ndarray:
        raise NotImplementedError


class EdgeExponential(_Edge):
    """The fringe field of an earthed sheet that is near others of its size decays like e^-d."""

    form, longest_m = 'exponential', 0.08

    @staticmethod
    def gain(d):
        return np.exp(-d)


class EdgeGaussian(_Edge):
    """The sharp field of the edge, blurred by droplets that coast past it."""

    form, shortest_m, longest_m = 'gaussian', 0.02, 0.06

    @staticmethod
    def gain(d):
        return np.exp(-0.5 * d**2)


class EdgeRamp(_Edge):
    """A band of even slope, drawn up by surface tension until the film gelled."""

    form, shortest_m, longest_m = 'ramp', 0.03, 0.12

    @staticmethod
    def gain(d):
        return np.maximum(1.0 - d, 0.0)


class EdgePower(_Edge):
    """Field at the rim of a thin conducting sheet ~ d^-1/2 (Jackson), blunted by its thickness.

    Minus 1/3, so that it ends eight reaches away.
    """

    form, longest_m = 'power', 0.03

    @staticmethod
    def gain(d):
        return np.maximum(1.5 * ((1.0 + d) ** -0.5 - 1.0 / 3.0), 0.0)


class EdgeFlow(_Edge):
    """A fat edge: paint flows to the edge out of a band beside it, and none is lost."""

    form, longest_m = 'flow', 0.04

    @staticmethod
    def gain(d):
        return (np.exp(-d) - 0.4 * np.exp(-0.4 * d)) / 0.6


class _Recess(FaradayShielding):
    """Shielding by a measure of the recess that is 1 in a valley of 250 mm radius."""

    def on_landing(self, landings: Landings, scene: Scene) -> np.ndarray:
        x, z = landings.position_m[:, 0], landings.position_m[:, 2]
        return self.kept(np.maximum(_on_grid(scene.part, self.measure).ev(x, z), 0.0))

    def kept(self, recess: np.ndarray) -> np.ndarray:
        return np.exp(-self.amplitude * recess)

    @staticmethod
    def measure(part: Part, x: np.ndarray, z: np.ndarray) -> np.ndarray:
        raise NotImplementedError


class RecessDepth(_Recess):
    """Field lines end on the rims: what counts is the depth below the lower of two rims."""

    form = 'depth'

    def kept(self, recess):
        return 1.0 / (1.0 + self.amplitude * recess)

    @staticmethod
    def measure(part, x, z):
        rises = np.array([_rise(part, x, z, a, RIM_M).max(axis=0) for a in AROUND])
        below = np.minimum(rises[:6], rises[6:]).max(axis=0)
        return below / (0.5 * KAPPA_REF_PER_M * RIM_M[-1] ** 2)


class RecessWide(_Recess):
    """A field that does not see bends narrower than the space charge in front of them: 80 mm."""

    form = 'wide'

    @staticmethod
    def measure(part, x, z):
        return part.curvature_over(x, z, 0.080)[1] / KAPPA_REF_PER_M


class RecessSkyView(_Recess):
    """Droplets come from every side: the share of the half space that the recess hides."""

    form = 'sky_view'

    @staticmethod
    def measure(part, x, z):
        hidden = 0.0
        for a in AROUND:
            tangent = (_rise(part, x, z, a, HORIZON_M) / HORIZON_M[:, None, None]).max(axis=0)
            hidden = hidden + tangent**2 / (1.0 + tangent**2) * (tangent > 0) / AROUND.size
        return hidden / 0.036


class ConvexRoot(ConvexAttraction):
    """Field of a rounded wedge grows like a root of its curvature."""

    form = 'root'

    def on_landing(self, landings: Landings, scene: Scene) -> np.ndarray:
        low, _ = _curvature(landings, scene, 0.025)
        k = np.maximum(-low, 0.0) / KAPPA_REF_PER_M
        return 1.0 + self.amplitude * (np.sqrt(k + 0.02) - np.sqrt(0.02)) / 0.87


class ConvexLinear(ConvexAttraction):
    """Field ~ 1 / radius as on a cylinder, seen over 40 mm; saturates at corona onset."""

    form = 'cylinder'

    def on_landing(self, landings: Landings, scene: Scene) -> np.ndarray:
        low, _ = _curvature(landings, scene, 0.040)
        return 1.0 + self.amplitude * np.clip(-low / KAPPA_REF_PER_M, 0.0, 4.0)


class _Incidence(IncidenceAttraction):
    """Gain over incidence for attraction, its inverse for rebound."""

    def on_landing(self, landings: Landings, scene: Scene) -> np.ndarray:
        away = self.away(np.maximum(landings.cos_incidence, 0.2))
        if self.amplitude >= 0:
            return 1.0 + self.amplitude * away
        return 1.0 / (1.0 - self.amplitude * away)

    @staticmethod
    def away(cosine: np.ndarray) -> np.ndarray:
        raise NotImplementedError


class IncidenceTangent(_Incidence):
    """A droplet's sideways momentum counts: tan^2 of the incidence, saturating."""

    form = 'tangent'

    @staticmethod
    def away(cosine):
        return 0.5 * np.minimum(cosine**-2 - 1.0, 2.5)


class IncidenceLate(_Incidence):
    """Nothing up to 12 degrees, where the field is still along the spray; linear beyond."""

    form = 'late'

    @staticmethod
    def away(cosine):
        return 0.7 * np.maximum(np.arccos(np.minimum(cosine, 1.0)) - np.deg2rad(12.0), 0.0)


class IncidencePower(IncidenceAttraction):
    """A power of the cosine, as sticking laws of thermal spraying have it."""

    form = 'power'
    most = 1.2

    def on_landing(self, landings: Landings, scene: Scene) -> np.ndarray:
        return np.maximum(landings.cos_incidence, 0.2) ** -self.amplitude


class StandoffLinear(StandoffEfficiency):
    """Transfer efficiency falls linearly with the way, as measured over short ranges."""

    form = 'linear'

    def on_landing(self, landings: Landings, scene: Scene) -> np.ndarray:
        far = landings.beyond_m / scene.pattern.model_plane_m
        return np.clip(1.0 - self.amplitude * far, 0.05, 3.0)


class StandoffPower(StandoffEfficiency):
    """Losses of a jet that entrains air and slows down: a power of the way."""

    form = 'power'

    def on_landing(self, landings: Landings, scene: Scene) -> np.ndarray:
        far = 1.0 + landings.beyond_m / scene.pattern.model_plane_m
        return np.maximum(far, 0.3) ** -self.amplitude


class StandoffRunaway(StandoffEfficiency):
    """Small droplets are lost at once where the jet ends: losses grow with the square beyond."""

    form = 'runaway'

    def on_landing(self, landings: Landings, scene: Scene) -> np.ndarray:
        far = 1.0 + landings.beyond_m / scene.pattern.model_plane_m
        return np.exp(-0.5 * self.amplitude * (np.maximum(far, 0.0) ** 2 - 1.0))


class SpreadUniform(PatternSpread):
    """Shaping air that holds every droplet alike."""

    form = 'uniform'

    def on_air(self, air: Air, slices: Slices, parcels: Parcels) -> Air:
        return with_narrowing(air, np.full(parcels.size.shape, self.amplitude))


class SpreadSmall(PatternSpread):
    """Shaping air that holds the small droplets; large ones fly through it."""

    form = 'small_droplets'

    def on_air(self, air: Air, slices: Slices, parcels: Parcels) -> Air:
        return with_narrowing(air, self.amplitude * (1.6 - 1.2 * parcels.size))


def _rise(
    part: Part, x: np.ndarray, z: np.ndarray, azimuth: float, reach_m: np.ndarray
) -> np.ndarray:
    """(reaches, ...) how far the part rises above the point's tangent plane, 0 beyond its rim."""
    along = reach_m[:, None, None]
    at_x, at_z = x + along * np.cos(azimuth), z + along * np.sin(azimuth)
    y_x, y_z = part.slope(x, z)
    plane = part.height(x, z) + y_x * (at_x - x) + y_z * (at_z - z)
    rise = part.height(at_x, at_z) - plane
    return np.where(part.edge_distance(at_x, at_z) > 0.0, rise, 0.0)


@lru_cache(maxsize=8)
def _on_grid(part: Part, measure: Callable) -> RectBivariateSpline:
    """A slowly varying measure of the surface, tabulated."""
    margin = OUTLINE_MARGIN_M
    x = np.arange(-0.5 * part.width_m - margin, 0.5 * part.width_m + margin + GRID_M, GRID_M)
    z = np.arange(-margin, part.height_m + margin + GRID_M, GRID_M)
    gx, gz = np.meshgrid(x, z, indexing='ij')
    return RectBivariateSpline(x, z, measure(part, gx, gz), kx=1, ky=1)


def _curvature(landings: Landings, scene: Scene, reach_m: float) -> tuple[np.ndarray, np.ndarray]:
    x, z = landings.position_m[:, 0], landings.position_m[:, 2]
    return scene.part.curvature_over(x, z, reach_m)

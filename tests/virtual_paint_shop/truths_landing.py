"""Hidden effects where the parcels land: field, bounce, losses on the way, things in between.

Further forms follow from a mechanism held to be behind the effect, at the first law's reference.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

import numpy as np
import trimesh
from scipy.interpolate import RectBivariateSpline

from .doors import OUTLINE_MARGIN_M, Part
from .flight import Landings
from .truths import KAPPA_REF_PER_M, Scene, Truth, between, variant

GRID_M = 0.01
RIM_M = np.array([0.03, 0.06, 0.09, 0.12])
HORIZON_M = np.array([0.01, 0.02, 0.04, 0.07, 0.11, 0.16])
AROUND = np.arange(12) * np.pi / 6


class IncidenceAttraction(Truth):
    """Gain 1 + a u / (1 + u / 0.8), or bounce 1 / (1 + |a| u); u = 1/cos - 1 of each parcel."""

    id, family, typical, most, unit = 'incidence_attraction', 'incidence', 1.0, 6.0, '1'

    @classmethod
    def of_size(cls, size, rng):
        amount = min(cls.typical * size, cls.most)
        return amount if rng.random() < 0.7 else -0.6 * amount

    def on_landing(self, landings, scene):
        away = self.away(np.maximum(landings.cos_incidence, 0.2), self.amplitude >= 0)
        if self.amplitude >= 0:
            return 1.0 + self.amplitude * away
        return 1.0 / (1.0 - self.amplitude * away)

    @staticmethod
    def away(cosine: np.ndarray, gains: bool) -> np.ndarray:
        u = 1.0 / cosine - 1.0
        return u / (1.0 + u / 0.8) if gains else u


def _late(cosine, gains):
    return 0.7 * np.maximum(np.arccos(np.minimum(cosine, 1.0)) - np.deg2rad(12.0), 0.0)


variant(IncidenceAttraction, 'tangent', "A droplet's sideways momentum: tan^2, saturating.",
        away=lambda cosine, gains: 0.5 * np.minimum(cosine**-2 - 1.0, 2.5))  # fmt: skip
variant(IncidenceAttraction, 'late', 'Nothing up to 12 degrees, and linear beyond.', away=_late)


variant(IncidenceAttraction, 'power', 'As sticking laws of thermal spraying have it.', most=1.2,
        on_landing=lambda self, landings, scene: (
            np.maximum(landings.cos_incidence, 0.2) ** -self.amplitude),
        )  # fmt: skip


class ConvexAttraction(Truth):
    """1 + a (1 - e^-k) / (1 - e^-1), k = convex curvature over 15 mm x 250 mm."""

    id, family, typical, unit = 'convex_attraction', 'curvature', 0.15, '1'
    most, over_m = 1.0, 0.015

    def on_landing(self, landings, scene):
        low, _ = _curvature(landings, scene, self.over_m)
        return 1.0 + self.amplitude * self.gain(np.maximum(-low, 0.0) / KAPPA_REF_PER_M)

    @staticmethod
    def gain(k: np.ndarray) -> np.ndarray:
        return (1.0 - np.exp(-k)) / (1.0 - np.exp(-1.0))


variant(ConvexAttraction, 'root', 'A rounded wedge: a root of its curvature.', over_m=0.025,
        gain=lambda k: (np.sqrt(k + 0.02) - np.sqrt(0.02)) / 0.87)  # fmt: skip
variant(ConvexAttraction, 'cylinder', 'Field ~ 1 / radius over 40 mm, up to the corona.',
        over_m=0.040, gain=lambda k: np.minimum(k, 4.0))  # fmt: skip


class FaradayShielding(Truth):
    """Recesses get less: exp(-a k^0.8), k = concave curvature over 30 mm x 250 mm."""

    id, family, typical, most, unit = 'faraday_shielding', 'curvature', 0.15, 1.0, '1'

    def on_landing(self, landings, scene):
        _, high = _curvature(landings, scene, 0.030)
        k = np.maximum(high, 0.0) / KAPPA_REF_PER_M
        return np.exp(-self.amplitude * k**0.8)


def _depth(part: Part, x: np.ndarray, z: np.ndarray) -> np.ndarray:
    rises = np.array([_rise(part, x, z, a, RIM_M).max(axis=0) for a in AROUND])
    below = np.minimum(rises[:6], rises[6:]).max(axis=0)
    return below / (0.5 * KAPPA_REF_PER_M * RIM_M[-1] ** 2)


def _hidden_sky(part: Part, x: np.ndarray, z: np.ndarray) -> np.ndarray:
    hidden = 0.0
    for a in AROUND:
        tangent = (_rise(part, x, z, a, HORIZON_M) / HORIZON_M[:, None, None]).max(axis=0)
        hidden = hidden + tangent**2 / (1.0 + tangent**2) * (tangent > 0) / AROUND.size
    return hidden / 0.036


class _Recess(FaradayShielding):
    """Shielding by a measure of the recess that is 1 in a valley of 250 mm radius."""

    measure = staticmethod(_depth)

    def on_landing(self, landings, scene):
        x, z = landings.position_m[:, 0], landings.position_m[:, 2]
        recess = np.maximum(_on_grid(scene.part, self.measure).ev(x, z), 0.0)
        if self.form == 'depth':
            return 1.0 / (1.0 + self.amplitude * recess)
        return np.exp(-self.amplitude * recess)


variant(_Recess, 'depth', 'Field lines end on the rims: depth below the lower.', measure=_depth)
variant(_Recess, 'wide', 'A field that does not see bends narrower than the space charge: 80 mm.',
        measure=lambda part, x, z: part.curvature_over(x, z, 0.080)[1] / KAPPA_REF_PER_M,
        )  # fmt: skip
variant(_Recess, 'sky_view', 'The share of the half space that is hidden.', measure=_hidden_sky)


class EdgeBuild(Truth):
    """Field concentration at free edges: 1 + a gain(d), d the distance in reaches."""

    id, family, typical, unit = 'edge_build', 'boundary', 0.25, '1'
    most, ranges = 2.0, between(reach_m=(0.015, 0.035))

    def on_landing(self, landings, scene):
        x, z = landings.position_m[:, 0], landings.position_m[:, 2]
        d = np.maximum(scene.part.edge_distance(x, z), 0.0) / self.drawn['reach_m']
        return np.maximum(1.0 + self.amplitude * self.gain(d), 0.0)

    @staticmethod
    def gain(d: np.ndarray) -> np.ndarray:
        return 1.0 / (1.0 + d**2)


variant(EdgeBuild, 'exponential', 'The fringe field of a sheet near others decays like e^-d.',
        ranges=between(reach_m=(0.01, 0.08)), gain=lambda d: np.exp(-d))  # fmt: skip
variant(EdgeBuild, 'gaussian', 'The field of the edge, blurred by droplets that coast past it.',
        ranges=between(reach_m=(0.02, 0.06)), gain=lambda d: np.exp(-0.5 * d**2))  # fmt: skip
variant(EdgeBuild, 'ramp', 'A band of even slope, drawn up by surface tension.',
        ranges=between(reach_m=(0.03, 0.12)), gain=lambda d: np.maximum(1.0 - d, 0.0))  # fmt: skip
variant(EdgeBuild, 'power', 'Field at a rim ~ d^-1/2 (Jackson), blunted; ends eight reaches away.',
        ranges=between(reach_m=(0.01, 0.03)),
        gain=lambda d: np.maximum(1.5 * ((1.0 + d) ** -0.5 - 1.0 / 3.0), 0.0))  # fmt: skip
variant(EdgeBuild, 'flow', 'A fat edge: paint flows there from beside it, and none is lost.',
        ranges=between(reach_m=(0.01, 0.04)),
        gain=lambda d: (np.exp(-d) - 0.4 * np.exp(-0.4 * d)) / 0.6)  # fmt: skip


class StandoffEfficiency(Truth):
    """Droplets are lost under way: e^(-a s), s = own path beyond the model plane over Omega."""

    id, family, typical, most, unit = 'standoff_efficiency', 'standoff', 0.5, 3.0, '1'

    def on_landing(self, landings, scene):
        return self.kept(landings.beyond_m / scene.pattern.model_plane_m, self.amplitude)

    @staticmethod
    def kept(s: np.ndarray, a: float) -> np.ndarray:
        return np.exp(-a * s)


variant(StandoffEfficiency, 'linear', 'Efficiency falls linearly, as measured over short ways.',
        kept=lambda s, a: np.clip(1.0 - a * s, 0.05, 3.0))  # fmt: skip
variant(StandoffEfficiency, 'power', 'A jet that entrains air and slows down: a power of the way.',
        kept=lambda s, a: np.maximum(1.0 + s, 0.3) ** -a)  # fmt: skip
variant(StandoffEfficiency, 'runaway', 'Small droplets are lost at once where the jet ends.',
        kept=lambda s, a: np.exp(-0.5 * a * (np.maximum(1.0 + s, 0.0) ** 2 - 1.0)),
        )  # fmt: skip


class PatternSpread(Truth):
    """Parcels do not fan out from one point: lateral distance q (1 + (1 - b)(z / Omega - 1)).

    b = amplitude x 0.7 (small droplets) to 1.3 (large); b > 0: shaping air holds them together.
    """

    id, family, typical, most, unit, sign = 'pattern_spread', 'standoff', 0.3, 0.8, '1', 'either'
    by_size = (0.7, 0.6)  # of the smallest droplet, and how much more of the largest

    def on_air(self, air, slices, parcels):
        least, more = self.by_size
        narrowing = self.amplitude * (least + more * parcels.size)
        return replace(air, narrowing=air.narrowing + narrowing)


variant(PatternSpread, 'uniform', 'Air that holds every droplet alike.', by_size=(1.0, 0.0))
variant(PatternSpread, 'small_droplets', 'Air that holds small ones most.', by_size=(1.6, -1.2))


class Occlusion(Truth):
    """Something in the part's mesh stands in the way from the bell's edge (Embree).

    A ledge along the lower edge or a trim stands out by `amplitude`; a hanger bar is half as wide.
    """

    id, family, typical, most, unit = 'occlusion', 'visibility', 0.06, 0.11, 'm'

    @classmethod
    def details(cls, rng):
        kind = {'kind': str(rng.choice(['ledge', 'trim', 'bar'], p=[0.1, 0.35, 0.55]))}
        limits = {'at': (0.25, 0.75), 'from': (0.0, 0.2), 'to': (0.75, 1.0), 'gap_m': (0.07, 0.12)}
        return kind | {name: rng.uniform(*ends) for name, ends in limits.items()}

    def obstacle(self, part: Part) -> tuple[np.ndarray, np.ndarray]:
        """Vertices and faces of the body: a box section swept along the surface."""
        size, at = min(self.amplitude, 0.11), self.drawn['at']
        span = np.linspace(self.drawn['from'], self.drawn['to'], 60)
        if self.drawn['kind'] == 'bar':
            z = span * part.height_m
            x = np.full_like(z, (at - 0.5) * part.width_m)
            side, near = np.array([0.25 * size, 0.0, 0.0]), self.drawn['gap_m']
            return _swept(part, x, z, side, near, near + 0.02)
        ledge = self.drawn['kind'] == 'ledge'
        z = np.full(60, 0.003 if ledge else at * part.height_m)
        span = np.linspace(0.0, 1.0, 60) if ledge else span
        x = part.left(z) + span * (0.5 * part.width_m - part.left(z))
        return _swept(part, x, z, np.array([0.0, 0.0, 0.003]), 0.0, size)

    def on_part(self, part):
        return replace(part, obstacle=self.obstacle(part)) if part.kind == 'door' else part

    def on_landing(self, landings, scene):
        if scene.part.obstacle is None:
            return 1.0
        mesh = trimesh.Trimesh(*scene.part.mesh(), process=False)
        normal = scene.part.normal(landings.position_m[:, 0], landings.position_m[:, 2])
        start = landings.position_m + 0.0015 * normal
        return 1.0 - mesh.ray.intersects_any(start, landings.rim_m - start).astype(float)


def _swept(
    part: Part, x: np.ndarray, z: np.ndarray, side: np.ndarray, near_m: float, far_m: float
) -> tuple[np.ndarray, np.ndarray]:
    """A closed body along the surface line (x, z), `near_m` to `far_m` in front, +- side wide."""
    near, far = (part.point(x, z) + np.array([0.0, off, 0.0]) for off in (near_m, far_m))
    rings = np.stack([near - side, near + side, far + side, far - side], axis=1)
    count = len(x) - 1
    corner = np.arange(count)[:, None] * 4 + np.arange(4)[None, :]
    after = np.roll(corner, -1, axis=1)
    quads = np.stack([corner, after, after + 4, corner + 4], axis=-1).reshape(-1, 4)
    quads = np.concatenate([quads, [[0, 3, 2, 1]], [4 * count + np.arange(4)]])
    return rings.reshape(-1, 3), np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def _rise(part: Part, x, z, azimuth: float, reach_m: np.ndarray) -> np.ndarray:
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
    return scene.part.curvature_over(landings.position_m[:, 0], landings.position_m[:, 2], reach_m)

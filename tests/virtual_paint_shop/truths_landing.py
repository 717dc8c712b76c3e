"""Hidden effects where the parcels land: field, bounce, losses on the way, things in between."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import trimesh

from .doors import Part
from .flight import Air, Landings, Slices
from .parcels import Parcels
from .truths import KAPPA_REF_PER_M, Scene, Truth, with_narrowing


class IncidenceAttraction(Truth):
    """Charged droplets are drawn to surface that turns away (a > 0), or bounce off it (a < 0).

    With u = 1/cos - 1 of each parcel's own incidence: gain 1 + a u / (1 + u / 0.8), saturating;
    bounce 1 / (1 + |a| u).
    """

    id, family, typical, unit = 'incidence_attraction', 'incidence', 1.0, '1'
    most = 6.0

    @classmethod
    def of_size(cls, size, rng):
        amount = min(cls.typical * size, cls.most)
        return amount if rng.random() < 0.7 else -0.6 * amount

    def on_landing(self, landings: Landings, scene: Scene) -> np.ndarray:
        away = 1.0 / np.maximum(landings.cos_incidence, 0.2) - 1.0
        if self.amplitude >= 0:
            return 1.0 + self.amplitude * away / (1.0 + away / 0.8)
        return 1.0 / (1.0 - self.amplitude * away)


class ConvexAttraction(Truth):
    """Field lines crowd on convex lines: gain saturates with curvature over 15 mm.

    1 + a (1 - e^-k) / (1 - e^-1), k = convex curvature x 250 mm, so 1 + a at 250 mm radius.
    """

    id, family, typical, unit = 'convex_attraction', 'curvature', 0.15, '1'
    most = 1.0

    def on_landing(self, landings: Landings, scene: Scene) -> np.ndarray:
        low, _ = _curvature(landings, scene, 0.015)
        k = np.maximum(-low, 0.0) / KAPPA_REF_PER_M
        return 1.0 + self.amplitude * (1.0 - np.exp(-k)) / (1.0 - np.exp(-1.0))


class FaradayShielding(Truth):
    """Recesses get less: exp(-a k^0.8), k = concave curvature over 30 mm x 250 mm."""

    id, family, typical, unit = 'faraday_shielding', 'curvature', 0.15, '1'
    most = 1.0

    def on_landing(self, landings: Landings, scene: Scene) -> np.ndarray:
        _, high = _curvature(landings, scene, 0.030)
        k = np.maximum(high, 0.0) / KAPPA_REF_PER_M
        return np.exp(-self.amplitude * k**0.8)


class EdgeBuild(Truth):
    """Field concentration at free edges: 1 + a / (1 + (d / reach)^2) at distance d."""

    id, family, typical, unit = 'edge_build', 'boundary', 0.25, '1'
    most = 2.0

    @classmethod
    def details(cls, rng):
        return {'reach_m': rng.uniform(0.015, 0.035)}

    def on_landing(self, landings: Landings, scene: Scene) -> np.ndarray:
        x, z = landings.position_m[:, 0], landings.position_m[:, 2]
        d = np.maximum(scene.part.edge_distance(x, z), 0.0) / self.drawn['reach_m']
        return 1.0 + self.amplitude / (1.0 + d**2)


class StandoffEfficiency(Truth):
    """Droplets are lost under way: e^(-a s / Omega), s = own path beyond the model plane."""

    id, family, typical, unit = 'standoff_efficiency', 'standoff', 0.5, '1'
    most = 3.0

    def on_landing(self, landings: Landings, scene: Scene) -> np.ndarray:
        return np.exp(-self.amplitude * landings.beyond_m / scene.pattern.model_plane_m)


class PatternSpread(Truth):
    """Parcels do not fan out from one point: beside the model plane each keeps its own slope.

    Lateral distance = q (1 + (1 - b)(z / Omega - 1)): straight lines from a spread-out source;
    b = amplitude x 0.7 (small droplets) to 1.3 (large); b > 0: shaping air holds them together.
    """

    id, family, typical, unit, sign = 'pattern_spread', 'standoff', 0.3, '1', 'either'
    most = 0.8

    def on_air(self, air: Air, slices: Slices, parcels: Parcels) -> Air:
        return with_narrowing(air, self.amplitude * (0.7 + 0.6 * parcels.size))


class Occlusion(Truth):
    """Something in the part's mesh stands in the parcels' way.

    A ledge along the lower edge or a trim on the surface (stands out by `amplitude`), or a hanger
    bar in front of the surface (half as wide). Parcels leave the bell's edge; one whose straight
    way to its landing meets the mesh (Embree) never arrives.
    """

    id, family, typical, unit = 'occlusion', 'visibility', 0.06, 'm'
    most = 0.11

    @classmethod
    def details(cls, rng):
        return {
            'kind': str(rng.choice(['ledge', 'trim', 'bar'], p=[0.1, 0.35, 0.55])),
            'at': rng.uniform(0.25, 0.75),
            'from': rng.uniform(0.0, 0.2),
            'to': rng.uniform(0.75, 1.0),
            'gap_m': rng.uniform(0.07, 0.12),
        }

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

    def on_part(self, part: Part) -> Part:
        return replace(part, obstacle=self.obstacle(part)) if part.kind == 'door' else part

    def on_landing(self, landings: Landings, scene: Scene) -> np.ndarray | float:
        if scene.part.obstacle is None:
            return 1.0
        mesh = trimesh.Trimesh(*scene.part.mesh(), process=False)
        start = landings.position_m + 0.0015 * scene.part.normal(
            landings.position_m[:, 0], landings.position_m[:, 2]
        )
        return 1.0 - mesh.ray.intersects_any(start, landings.rim_m - start).astype(float)


def _swept(
    part: Part, x: np.ndarray, z: np.ndarray, side: np.ndarray, near_m: float, far_m: float
) -> tuple[np.ndarray, np.ndarray]:
    """A closed body along the surface line (x, z), `near_m` to `far_m` in front, +- side wide."""
    surface, out = part.point(x, z), np.array([0.0, 1.0, 0.0])
    rings = np.stack(
        [
            surface - side + near_m * out,
            surface + side + near_m * out,
            surface + side + far_m * out,
            surface - side + far_m * out,
        ],
        axis=1,
    )
    count = len(x) - 1
    corner = np.arange(count)[:, None] * 4 + np.arange(4)[None, :]
    after = np.roll(corner, -1, axis=1)
    quads = np.stack([corner, after, after + 4, corner + 4], axis=-1).reshape(-1, 4)
    quads = np.concatenate([quads, [[0, 3, 2, 1]], [4 * count + np.arange(4)]])
    return rings.reshape(-1, 3), np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def _curvature(landings: Landings, scene: Scene, reach_m: float) -> tuple[np.ndarray, np.ndarray]:
    """At the gauge points' landings the curvature hardly varies; taken at each landing anyway."""
    x, z = landings.position_m[:, 0], landings.position_m[:, 2]
    return scene.part.curvature_over(x, z, reach_m)

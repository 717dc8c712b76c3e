"""What the gun has before it: the nearest surface, and where its straight rays land."""

import math
from functools import cached_property

import numpy as np

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.model.eq1_pattern import PlanarPattern
from paint_deposition.motion.path import SprayPath
from paint_deposition.part.refinement import face_normals
from paint_deposition.part.surface import Surface

# Poses that stand for the whole path, and rays that stand for the spray of each.
POSES, RAYS = 240, 160
# What is shorter is the end of another pass.
SHORTEST_PASS_M = 0.05


class GunView:
    """What the gun has before it, at poses that stand for equal shares of the paint.

    The part is turned to the gun; of the model, pattern and projection count, effects do not.
    """

    def __init__(self, surface: Surface, path: SprayPath, model: DepositionModel) -> None:
        self.surface, self.whole, self.model = surface, path, model
        paint = np.cumsum(path.flow * path.dwell_s)
        shares = (np.arange(POSES) + 0.5) / POSES
        self.path = path.select(np.searchsorted(paint, shares * paint[-1]))

    @cached_property
    def _nearest(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        place = self.surface.locate(self.path.position_m)
        way = place.positions_m - self.path.position_m
        return place.distance_m, way / np.maximum(place.distance_m, 1e-9)[:, None], place.normals

    @property
    def distance_m(self) -> np.ndarray:
        """(N,) distance of the TCP from the nearest surface [m]."""
        return self._nearest[0]

    @property
    def way(self) -> np.ndarray:
        """(N, 3) unit vectors from the TCP to the nearest surface."""
        return self._nearest[1]

    @cached_property
    def over(self) -> np.ndarray:
        """(N,) bool, whether the gun is over the part, on whichever side; none if on few poses."""
        # The gun is over the part where the nearest surface looks at it within 25 degrees: beside
        # the part its edge is nearest.
        over = np.abs(self._incidence) > math.cos(math.radians(25.0))
        # With fewer poses over the part, distance and lean say nothing.
        return over if over.mean() >= 0.05 else np.zeros_like(over)

    @property
    def is_behind(self) -> bool:
        """Whether the gun, where it is over the part, is mostly on the side that looks inward."""
        return bool(np.median(self._incidence[self.over]) > 0.0)

    @cached_property
    def off_normal_deg(self) -> np.ndarray:
        """(N,) angle between tool z and the way to the nearest surface [deg]."""
        cosine = np.einsum('ij,ij->i', self.path.rotation[:, :, 2], self.way)
        return np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))

    @cached_property
    def landing(self) -> np.ndarray:
        """(N,) share of each pose's straight rays that meet the outward side of the part."""
        projection = self.model.projection
        brush = self.model.pattern_rows(self.path.brush)
        rays = np.array([pattern_rays(planar) for planar in self.model.patterns])[brush]
        x, y, weights = np.moveaxis(rays, 1, 0)
        local = np.stack([x, y, np.full(x.shape, projection.model_plane_m)], axis=2)
        ways = np.einsum('nij,nrj->nri', self.path.rotation, local)
        back = projection.emission_offset_m * self.path.rotation[:, :, 2]
        first = projection.nearest_m / projection.model_plane_m
        starts = (self.path.position_m - back)[:, None] + first * ways
        face = self.surface.first_faces(starts.reshape(-1, 3), ways.reshape(-1, 3))
        hit = np.flatnonzero(face >= 0)
        normals = face_normals(self.surface.vertices_m, self.surface.faces[face[hit]])
        lands = np.zeros(len(face))
        lands[hit] = np.einsum('ij,ij->i', normals, ways.reshape(-1, 3)[hit]) < 0.0
        return np.einsum('nr,nr->n', lands.reshape(weights.shape), weights)

    @cached_property
    def passes(self) -> list[SprayPath]:
        """The passes that spray for 50 mm or more."""
        spraying = self.whole.select(self.whole.flow > 0.0)
        each = [spraying.select(spraying.spray_pass == n) for n in np.unique(spraying.spray_pass)]
        return [one for one in each if one.dwell_s @ one.speed_m_per_s >= SHORTEST_PASS_M]

    @cached_property
    def landing_of_passes(self) -> list[float]:
        """Share of the rays of each pass that land on the part; 1 where it is too short."""
        number, seen = self.path.spray_pass, [one.spray_pass[0] for one in self.passes]
        return [float(self.landing[number == n].mean()) if n in number else 1.0 for n in seen]

    @cached_property
    def _incidence(self) -> np.ndarray:
        return np.einsum('ij,ij->i', self.way, self._nearest[2])


def pattern_rays(planar: PlanarPattern) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(R,) places x, y on the model plane [m] that share out eq. (1), and their weights.

    Radii hold equal shares of the volume between them; azimuths follow the golden angle, so that
    no edge of a part lines up with many rays at once.
    """
    radii = np.linspace(0.0, planar.radius_of_flux_m(1e-4), 500)
    shares = (np.arange(RAYS) + 0.5) / RAYS
    radius = np.interp(shares, planar.enclosed_fraction(radii), radii)
    azimuth = math.pi * (3.0 - math.sqrt(5.0)) * np.arange(RAYS)
    x, y = radius * np.cos(azimuth), radius * np.sin(azimuth)
    even = planar.model_copy(update={'K3': 0.0})
    weights = planar.flux_um_per_s(x, y) / even.flux_um_per_s(x, y)
    return x, y, weights / weights.sum()

"""The film error that is told of a coarse mesh, beside the true one on curves known exactly."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from trimesh.creation import box

import paint_deposition as pd
from booth import MODEL, path_of, serpentine
from paint_deposition.film.spray_geometry import facet_error, facet_errors_um
from paint_deposition.part.points import SurfacePoints
from scenes import painted
from surfaces import refined, triangulated

PATH = path_of(serpentine((0.3, 0.1, -0.1, -0.3), half_width_m=0.7, opens_at_m=0.65))
BELL = pd.DepositionModel()


@dataclass(frozen=True)
class Curve:
    """A surface y = depth(z) or depth(x, z), outward to -y, and its slopes."""

    depth: Callable[[np.ndarray, np.ndarray], np.ndarray]
    slopes: Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]

    def normals(self, x: np.ndarray, z: np.ndarray) -> np.ndarray:
        across, up = self.slopes(x, z)
        normals = np.stack([across, -np.ones_like(x), up], axis=1)
        return normals / np.linalg.norm(normals, axis=1, keepdims=True)

    def nearest(self, points_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The closest places on the exact surface, and their normals."""
        x, z = points_m[:, 0].copy(), points_m[:, 2].copy()
        for _ in range(60):
            normals = self.normals(x, z)
            off = points_m - np.stack([x, self.depth(x, z), z], axis=1)
            along = off - np.einsum('ij,ij->i', off, normals)[:, None] * normals
            x, z = x + 0.7 * along[:, 0], z + 0.7 * along[:, 2]
        return np.stack([x, self.depth(x, z), z], axis=1), self.normals(x, z)


def round_fold(radius_m: float, turn_deg: float) -> Curve:
    """Flat and level below, an arc about z = 0, flat and leaning back above."""
    half = radius_m * np.tan(np.radians(turn_deg) / 2.0)
    end = radius_m * np.sin(np.radians(turn_deg)) - half
    steep = np.tan(np.radians(turn_deg))

    def slope(x, z):
        share = np.clip((z + half) / radius_m, 0.0, np.sin(np.radians(turn_deg)))
        return np.zeros_like(z), share / np.sqrt(1.0 - share**2)

    def depth(x, z):
        arc = np.clip(z, -half, end) + half
        return radius_m - np.sqrt(radius_m**2 - arc**2) + steep * np.maximum(z - end, 0.0)

    return Curve(depth, slope)


def cap(radius_m: float) -> Curve:
    def root(x, z):
        return np.sqrt(radius_m**2 - x**2 - z**2)

    return Curve(lambda x, z: radius_m - root(x, z), lambda x, z: (x / root(x, z), z / root(x, z)))


def films_um(*places: SurfacePoints) -> list[np.ndarray]:
    return [painted(points, PATH, BELL).film_um for points in places]


@pytest.mark.slow
@pytest.mark.parametrize(
    ('curve', 'edge_m', 'jitter'),
    [(round_fold(0.04, 30.0), 0.012, 0.0), (round_fold(0.08, 45.0), 0.024, 0.3),
     (cap(0.5), 0.05, 0.3)],
)  # fmt: skip
def test_the_error_is_told_within_a_third(curve, edge_m, jitter):
    vertices, faces = triangulated(curve.depth, edge_m, 0.12, jitter=jitter)
    surface = pd.Surface.from_triangles(vertices, faces, min(0.01, edge_m / 2.0))
    films = films_um(surface.points(), SurfacePoints(*curve.nearest(surface.vertices_m)))
    told = facet_error(surface, PATH, BELL)[0]
    true = np.abs(films[0] - films[1]).max() / films[1].max()
    assert 0.66 * true < told < 1.34 * true, (told, true)


def test_flat_and_sharp_parts_cost_nothing():
    flat = refined(lambda x, z: 0.3 * x, 0.1, 0.02)
    body = box((0.4, 0.3, 0.3))
    sharp = pd.Surface.from_triangles(body.vertices, np.asarray(body.faces), 0.02)
    bent = refined(lambda x, z: 0.7 * np.abs(z), 0.1, 0.02)
    for surface in (flat, sharp, bent):
        assert facet_error(surface, PATH, MODEL) == (0.0, '')


def test_the_warning_names_the_place_and_a_length_that_helps():
    depth = round_fold(0.08, 45.0).depth
    share, warning = facet_error(refined(depth, 0.024, half_width_m=0.12), PATH, BELL)
    assert share > 0.02
    assert abs(float(warning.split(') m')[0].split(', ')[-1])) < 0.08
    wanted_m = 1e-3 * float(warning.split('edges of about ')[1].split(' mm')[0])
    finer, _ = facet_error(refined(depth, wanted_m, half_width_m=0.12), PATH, BELL)
    assert finer < 0.5 * share


@pytest.mark.parametrize('curve', [round_fold(0.15, 40.0), cap(0.5)])
def test_the_error_at_readings_is_most_of_the_true_one(curve):
    surface = pd.Surface.from_triangles(*triangulated(curve.depth, 0.02, 0.2, jitter=0.2), 0.01)
    at = np.random.default_rng(0).choice(len(surface.vertices_m), 200, replace=False)
    points = SurfacePoints(surface.vertices_m[at], surface.normals[at])
    told_um = facet_errors_um(surface, points, PATH, BELL)
    flat_um, exact_um = films_um(points, SurfacePoints(*curve.nearest(points.positions_m)))
    true_um = exact_um - flat_um
    assert np.corrcoef(told_um, true_um)[0, 1] > 0.8
    assert np.std(true_um - told_um) < 0.6 * np.std(true_um)

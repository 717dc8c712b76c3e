"""Faces sprayed beside each other: how far from their seams, and how long on each pass.

The faces overlap at their seams, because the spray of each reaches beyond it. Two things even
that out on the film of all faces together: how far from its seams each face is sprayed, found by
a search over a margin that they share, and the time that the gun spends on each pass, by bounded
least squares, since the film is linear in it.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import lsq_linear

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.film.integrator import FilmIntegrator
from paint_deposition.motion.path_builder import spray_path
from paint_deposition.part.sprayable_faces import Face
from paint_deposition.part.surface import Surface
from paint_deposition.planning.face_order import FacePasses
from paint_deposition.planning.pass_motion import trajectory_of
from paint_deposition.planning.passes import plan_pass
from paint_deposition.planning.plan import evenness, plan
from paint_deposition.planning.plan_request import PlanRequest
from paint_deposition.planning.surface_map import SurfaceMap

# Margins along the seams that are tried, as shares of the overspray.
MARGINS = (0.0, 0.35, 0.7, 1.0)
# By how much longer or shorter the gun may stay on a pass than evenness on its face alone asks,
# and what a change by that much is worth in film, as a share.
DWELL, RELUCTANCE = (0.5, 2.0), 0.02


@dataclass(frozen=True)
class Blend:
    """The faces with their passes, blended.

    Attributes:
        margin_m: by how much each face is sprayed less far than its seams.
        faces: their passes, each at its speed.
        sigma_n_before: of the film without margin, each face for itself.
    """

    margin_m: float
    faces: tuple[FacePasses, ...]
    sigma_n_before: float


@dataclass(frozen=True)
class _Laid:
    """Passes on every face for one margin, and the film of each pass on the whole part."""

    margin_m: float
    faces: tuple[FacePasses, ...]
    maps: tuple[SurfaceMap, ...]
    films_um: np.ndarray


def blend(
    surface: Surface,
    model: DepositionModel,
    request: PlanRequest,
    faces: tuple[Face, ...],
    area_m2: np.ndarray,
    progress: Callable[[str, float], None],
) -> Blend:
    """Lay passes on each face, and choose margin and speeds for an even film of all.

    Args:
        surface: the part. model: what the gun sprays. request: for each face.
        faces: of the part.
        area_m2: (V,) of the surface that is to be even, 0 elsewhere [m2].
        progress: called with what is done and its share, 0 to 1.
    """
    overspray_m, tried = 0.0, []
    for number, share in enumerate(MARGINS if len(faces) > 1 else MARGINS[:1]):
        progress('faces', number / len(MARGINS))
        tried.append(_laid(surface, model, request, faces, share * overspray_m))
        overspray_m = tried[0].faces[0].style.overspray_m
    target = request.target_um if request.speed_m_per_s is None else None
    dwells = [_dwell(laid, area_m2, target) for laid in tried]
    sigmas = [
        evenness(dwell @ laid.films_um, area_m2)[1]
        for dwell, laid in zip(dwells, tried, strict=True)
    ]
    best = int(np.argmin(sigmas))
    _, before = evenness(tried[0].films_um.sum(axis=0), area_m2)
    return Blend(tried[best].margin_m, _with_dwell(tried[best], dwells[best], request), before)


def _laid(
    surface: Surface,
    model: DepositionModel,
    request: PlanRequest,
    faces: tuple[Face, ...],
    margin_m: float,
) -> _Laid:
    passes, maps, films = [], [], []
    integrator = FilmIntegrator(surface.points(), model, occluder=surface.occluder)
    for face in faces:
        planned = plan(face.without_margin(margin_m).surface, model, request)
        passes.append(FacePasses(planned.passes, planned.style))
        maps.append(planned.line_films.surface_map)
        for one in planned.passes:
            path, _ = spray_path(trajectory_of((one,), planned.style), max_step_m=model.max_step_m)
            integrator.reset()
            integrator.add(path)
            films.append(integrator.raw_um.copy())
    return _Laid(margin_m, tuple(passes), tuple(maps), np.array(films))


def _dwell(laid: _Laid, area: np.ndarray, target_um: float | None) -> np.ndarray:
    """(n,) time on each pass, over what it is on its face alone, for an even film of all."""
    weight = area / area.sum()
    films = laid.films_um
    wanted = target_um or float(weight @ films.sum(axis=0))
    rows = np.sqrt(weight)[:, np.newaxis] * films.T / wanted
    ridge = RELUCTANCE * np.eye(len(films)) / math.sqrt(len(films))
    return lsq_linear(
        np.vstack([rows, ridge]), np.concatenate([np.sqrt(weight), ridge.sum(axis=1)]), DWELL
    ).x


def _with_dwell(laid: _Laid, dwell: np.ndarray, request: PlanRequest) -> tuple[FacePasses, ...]:
    """The passes at their new speeds, with a run-up that suits them."""
    found, first = [], 0
    for face, surface_map in zip(laid.faces, laid.maps, strict=True):
        passes = []
        for number, planned in enumerate(face.passes):
            style = replace(
                face.style, speed_m_per_s=planned.speed_m_per_s / float(dwell[first + number])
            )
            backwards = bool(number % 2) and not request.one_way
            passes.append(plan_pass(surface_map, planned.across_m, style, backwards))
        first += len(passes)
        found.append(FacePasses(tuple(passes), face.style))
    return tuple(found)

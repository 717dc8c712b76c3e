"""Where readings lie on a part, or off its surface and why, and where a gauge can stand."""

import numpy as np
from scipy.spatial import cKDTree

from paint_deposition.errors import ReadingsError
from paint_deposition.inference.readings.readings import Readings
from paint_deposition.motion.path import SprayPath
from paint_deposition.part.edges import near_pairs
from paint_deposition.part.points import across_axis, box_words, downhill_axis
from paint_deposition.part.surface import Surface

# Readings further from the surface do not belong to the part.
MAX_DISTANCE_M = 0.02
# Ways in which a file may have been meant, by the factor on its positions.
OTHER_UNITS = {
    0.001: 'they fit in millimetres: the file says metres, or its unit is wrong',
    1000.0: 'they fit in metres: the file says millimetres, or its unit is wrong',
    0.0254: 'they fit in inches',
}
NEAR_M = 0.02


def refuse_off_surface(surface: Surface, readings: Readings, distance_m: np.ndarray) -> None:
    """Refuse points (P,) that are this far from the surface [m]."""
    places_m = readings.positions_m
    far = np.count_nonzero(distance_m > MAX_DISTANCE_M)
    if far:
        worst = int(np.argmax(distance_m))
        row = readings.first[worst]
        where = ', '.join(f'{value:.3f}' for value in places_m[row])
        raise ReadingsError(
            f"{readings.source}: {far} of {len(distance_m)} points lie off the part's surface, "
            f"point '{readings.point[row]}' at ({where}) m by "
            f'{distance_m[worst]:.3f} m (limit {MAX_DISTANCE_M:g}); {_hint(surface, places_m)}'
        )
    # Readings clustered on a spot of the part are metres taken for mm, if they fit so.
    longest = np.ptp(surface.vertices_m, axis=0).max()
    clustered = len(places_m) > 1 and np.ptp(places_m, axis=0).max() < 0.01 * longest
    if clustered and _fits(surface, 1000.0 * places_m):
        hint = _hint(surface, places_m)
        raise ReadingsError(f'{readings.source}: all points lie on one spot: {hint}')


def unit_in_doubt(surface: Surface, readings: Readings) -> str:
    """A warning of positions in a guessed unit that fit the part in another; '' for none."""
    places_m, part_m = readings.positions_m, np.ptp(surface.vertices_m, axis=0)
    small = np.ptp(places_m, axis=0) < 0.25 * part_m
    # The part may have no extent across its surface.
    if not readings.unit_is_guessed or not np.all(small | (part_m < NEAR_M)):
        return ''
    # Units that may have been taken for mm.
    units = [
        unit
        for factor, unit in {10.0: 'cm', 25.4: 'inch'}.items()
        if surface.locate(factor * places_m)[2].max() < MAX_DISTANCE_M
    ]
    if not units:
        return ''
    return (
        f'the readings span {box_words(places_m)} and the part '
        f'{box_words(surface.vertices_m)}; no unit of their positions is given, and they fit '
        f'in {" and in ".join(units)}, too: say unit: {{position: {units[-1]}}}, or mm if it is '
        'right'
    )


def refuse_other_side(readings: Readings, angle_rad: np.ndarray) -> None:
    """Refuse points whose normals (P,) are turned this far from the surface's [rad]."""
    away = np.count_nonzero(angle_rad > np.radians(60.0))
    if away:
        worst = int(np.argmax(angle_rad))
        raise ReadingsError(
            f'{readings.source}: {away} of {len(angle_rad)} normals point away from the '
            f"surface, point '{readings.point[readings.first[worst]]}' by "
            f'{np.degrees(angle_rad[worst]):.0f} deg; give outward normals'
        )


def _hint(surface: Surface, positions_m: np.ndarray) -> str:
    """Both bounding boxes and the likely cause, in one line."""
    vertices = surface.vertices_m
    boxes = f'the readings span {box_words(positions_m)} and the part {box_words(vertices)}'
    for factor, words in OTHER_UNITS.items():
        if _fits(surface, factor * positions_m):
            return f'{boxes}; {words}'
    *_, distance_m = surface.locate(positions_m)
    if np.median(distance_m) < NEAR_M:
        return f'{boxes}; most points lie on the part: check these'
    sides, part = (np.sort(np.ptp(each, axis=0)) for each in (positions_m, vertices))
    # Boxes whose sides agree this well are the same part at another place.
    if np.all(sides <= 1.25 * part + NEAR_M):
        return f'{boxes}; they look like positions in another frame: give them in the mesh frame'
    return f'{boxes}; give positions in the mesh frame, in metres, or name their unit with unit:'


def _fits(surface: Surface, positions_m: np.ndarray) -> bool:
    """Whether most positions lie on the part and span a good share of it."""
    span = np.ptp(positions_m, axis=0).max()
    # Readings span at least this share of the part's longest side, or a spot of it was measured.
    if span < 0.1 * np.ptp(surface.vertices_m, axis=0).max():
        return False
    *_, distance_m = surface.locate(positions_m)
    return bool(np.median(distance_m) < NEAR_M)


FEWEST_ON_A_LINE = 3


def columns_or_rows(surface: Surface, path: SprayPath, positions_m: np.ndarray) -> np.ndarray:
    """(P,) labels 'column 1', ... from the left or 'row 1', ... from the top; '' for none.

    Where points lie in both, the lines that cross the passes are taken.

    Args:
        surface: the part, seen by the gun, which fixes left and right.
        positions_m: (P, 3) of the points [m].
    """
    right = positions_m @ across_axis(surface.outward, surface.down)
    below = positions_m @ downhill_axis(surface.outward, surface.down)
    ways = [('column', right, below), ('row', below, right)]
    if not passes_are_level(path, surface.down):
        ways.reverse()
    for name, aside, along in ways:
        lines = _lines(aside, along)
        if lines is not None:
            return np.array([f'{name} {line + 1}' if line >= 0 else '' for line in lines])
    return np.full(len(positions_m), '')


def passes_are_level(path: SprayPath, down: np.ndarray) -> bool:
    """Whether the gun sprays more level than up and down."""
    motion = path.velocity_m_per_s[path.flow > 0.0]
    rising = float(np.abs(motion @ down).sum())
    return 2.0 * rising <= float(np.linalg.norm(motion, axis=1).sum())


def _lines(aside_m: np.ndarray, along_m: np.ndarray) -> np.ndarray | None:
    """(P,) number of the line of each point, -1 for none; None where there are no lines."""
    if len(aside_m) < FEWEST_ON_A_LINE:
        return None
    # A single line is this much longer than wide.
    if np.ptp(aside_m) <= np.ptp(along_m) / 10.0:
        return np.zeros(len(aside_m), dtype=int)
    order = np.argsort(aside_m, kind='stable')
    gaps = np.diff(aside_m[order])
    # Readings on one line are not known to be straighter than this [m].
    largest = np.maximum(np.sort(gaps)[::-1], 1e-3)
    ratios = largest[:-1] / largest[1:]
    ratios = ratios[: len(aside_m) // FEWEST_ON_A_LINE]
    # Lines lie this much further apart than the readings of one line stray from it.
    if not len(ratios) or ratios.max() < 3.0:
        return None
    least = largest[int(np.argmax(ratios))]
    cluster = np.empty(len(aside_m), dtype=int)
    cluster[order] = np.concatenate([[0], np.cumsum(gaps >= least)])
    counts = np.bincount(cluster)
    kept = counts >= FEWEST_ON_A_LINE
    widths = [np.ptp(aside_m[cluster == k]) for k in np.flatnonzero(kept)]
    # So many of the points at least belong to a line, or there are none.
    if counts[kept].sum() < 0.8 * len(aside_m) or max(widths) > least:
        return None
    return np.where(kept, np.cumsum(kept) - 1, -1)[cluster]


def on_face_m(surface: Surface, from_left_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points of the surface that lie straight before places on its face.

    The face is the part as the gun sees it, along its mean outward normal; places (N, 2) are from
    the part's leftmost point and over its lowest [m]. The points (N, 3) are nan where there is no
    surface; (N,) bool says whether there is.
    """
    outward, vertices = surface.outward, surface.vertices_m
    right, up, left, low = _face(surface)
    # How far before the part rays begin [m].
    front = (vertices @ outward).max() + 0.1
    places = np.nan_to_num(np.asarray(from_left_m, dtype=float))
    starts = np.outer(left + places[:, 0], right) + np.outer(low + places[:, 1], up)
    starts += front * outward
    face = surface.first_faces(starts, np.broadcast_to(-outward, starts.shape))
    hit = (face >= 0) & np.isfinite(from_left_m).all(axis=1)
    corners = vertices[surface.faces[np.maximum(face, 0)]]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    height = np.einsum('nk,nk->n', starts - corners[:, 0], normals)
    way = height / np.where(hit, normals @ outward, 1.0)
    return np.where(hit[:, np.newaxis], starts - way[:, np.newaxis] * outward, np.nan), hit


def from_edges_m(surface: Surface, points_m: np.ndarray) -> np.ndarray:
    """(N, 2) distance of points (N, 3) from the left edge and height over the lower edge [m]."""
    right, up, left, low = _face(surface)
    return np.column_stack([points_m @ right - left, points_m @ up - low])


def _face(surface: Surface) -> tuple[np.ndarray, np.ndarray, float, float]:
    """Unit vectors (3,) to the right and up, and where left and lower edge lie along them [m]."""
    outward = surface.outward
    right, up = across_axis(outward, surface.down), -downhill_axis(outward, surface.down)
    vertices = surface.vertices_m
    return right, up, float((vertices @ right).min()), float((vertices @ up).min())


# The foot of a usual gauge, from its middle to its rim [m].
FOOT_M = 0.015


def can_stand(surface: Surface, foot_m: float = FOOT_M) -> np.ndarray:
    """(V,) bool, whether a foot of this radius [m] stands level around each vertex."""
    positions, normals = surface.vertices_m, surface.normals
    lean = np.zeros(len(positions))
    for block, one, other, _ in near_pairs(positions, positions, foot_m):
        cosine = np.einsum('nk,nk->n', normals[block][one], normals[other])
        # What faces the other way is the back of the sheet.
        turned = np.where(cosine > 0.0, np.arccos(np.clip(cosine, -1.0, 1.0)), 0.0)
        np.maximum.at(lean, block.start + one, turned)
    # Under the foot the surface turns away by no more: a radius of about 85 mm.
    return (surface.points().edge_distance_m > foot_m) & (lean <= np.radians(10.0))


def spread_places(surface: Surface, usable: np.ndarray, count: int, seed: int = 0) -> np.ndarray:
    """About ``count`` of the usable vertices (V,) bool, drawn at a distance; their rows."""
    area_m2 = float(surface.vertex_areas_m2[usable].sum())
    # Area that discs thrown at random take up until none fits any more, for a disc of diameter 1.
    apart_m = np.sqrt(area_m2 / (1.436 * count))
    order = np.random.default_rng(seed).permutation(np.flatnonzero(usable))
    tree, free, kept = cKDTree(surface.vertices_m[order]), np.ones(len(order), dtype=bool), []
    for row, vertex in enumerate(order):
        if free[row]:
            kept.append(vertex)
            free[tree.query_ball_point(surface.vertices_m[vertex], apart_m)] = False
    return np.array(kept, dtype=int)


def grid_places(surface: Surface, usable: np.ndarray, count: int) -> np.ndarray:
    """``count`` of the usable vertices (V,) bool on a square grid over the face; their rows.

    The widest grid that has as many; what it has too many is left out here and there.
    """
    rows = np.flatnonzero(usable)
    face = from_edges_m(surface, surface.vertices_m)
    tree, size = cKDTree(surface.vertices_m), face.max(axis=0)
    pitch_m = 1.5 * np.sqrt(surface.vertex_areas_m2[rows].sum() / count)
    while True:
        # Places at a pitch along both sides, as far from both of their ends.
        steps = [np.arange(int(length / pitch_m) + 1) for length in size]
        across, up = (
            0.5 * (length - step[-1] * pitch_m) + pitch_m * step
            for length, step in zip(size, steps, strict=True)
        )
        places, hit = on_face_m(surface, np.stack(np.meshgrid(across, up), -1).reshape(-1, 2))
        near = np.unique(tree.query(places[hit])[1])
        near = near[usable[near]]
        if len(near) >= count or pitch_m < 0.005:
            return near[np.linspace(0, len(near) - 1, min(count, len(near))).round().astype(int)]
        pitch_m *= 0.98

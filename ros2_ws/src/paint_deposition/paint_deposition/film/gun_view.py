"""What the gun has before it: the nearest surface, where its straight rays land, what is odd."""

import math
from collections.abc import Iterator
from functools import cached_property
from itertools import compress

import numpy as np

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.motion.path import SprayPath
from paint_deposition.part.points import box_words
from paint_deposition.part.refinement import face_normals
from paint_deposition.part.surface import Surface

# Poses that stand for the whole path, and rays that stand for the spray of each.
POSES, RAYS = 240, 160
# No gun paints from so far away.
TOO_FAR_TO_PAINT_M = 1.0
# Part and path that differ so much in size are in different units.
OTHER_UNIT = 100.0
# Painters lean the gun, but less than this; an axis within 37 degrees of a direction points there.
LEANING_DEG, REVERSED_DEG, ALONG_COSINE = 35.0, 135.0, 0.8
# Standoffs further from the model plane than this share of its distance are odd.
OFF_PLANE = 0.4
# A pass with less of its paint over the part misses it.
LEAST_LANDING = 0.02


class GunView:
    """What the gun has before it, at poses that stand for equal shares of the paint.

    The part is turned to the gun; of the model, pattern and projection count, effects do not.

    Attributes:
        distance_m: (N,) distance of the TCP from the nearest surface [m].
        way: (N, 3) unit vectors from the TCP to it.
        normals: (N, 3) its outward unit normals.
    """

    def __init__(self, surface: Surface, path: SprayPath, model: DepositionModel) -> None:
        self.surface, self.whole, self.model = surface, path, model
        paint = np.cumsum(path.flow * path.dwell_s)
        shares = (np.arange(POSES) + 0.5) / POSES
        self.path = path.select(np.searchsorted(paint, shares * paint[-1]))
        nearest_m, self.normals, self.distance_m = surface.locate(self.path.position_m)
        way = nearest_m - self.path.position_m
        self.way = way / np.maximum(self.distance_m, 1e-9)[:, None]

    @cached_property
    def over(self) -> np.ndarray:
        """(N,) bool, whether the gun is over the part, on whichever side; none if on few poses."""
        # The gun is over the part where the nearest surface looks at it within 25 degrees: beside
        # the part its edge is nearest.
        over = np.abs(np.einsum('ij,ij->i', self.way, self.normals)) > math.cos(math.radians(25.0))
        # With fewer poses over the part, distance and lean say nothing.
        return over if over.mean() >= 0.05 else np.zeros_like(over)

    @cached_property
    def off_normal_deg(self) -> np.ndarray:
        """(N,) angle between tool z and the way to the nearest surface [deg]."""
        cosine = np.einsum('ij,ij->i', self.path.rotation[:, :, 2], self.way)
        return np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))

    @cached_property
    def landing(self) -> np.ndarray:
        """(N,) share of each pose's straight rays that meet the outward side of the part."""
        projection = self.model.projection
        # Places on the model plane that share out eq. (1), with their weights. Radii hold equal
        # shares of the volume between them; azimuths follow the golden angle, so that no edge of
        # a part lines up with many rays at once.
        azimuth, rays = math.pi * (3.0 - math.sqrt(5.0)) * np.arange(RAYS), []
        for planar in self.model.patterns:
            radii = np.linspace(0.0, planar.radius_of_flux_m(1e-4), 500)
            shares = (np.arange(RAYS) + 0.5) / RAYS
            radius = np.interp(shares, planar.enclosed_fraction(radii), radii)
            x, y = radius * np.cos(azimuth), radius * np.sin(azimuth)
            even = planar.model_copy(update={'K3': 0.0})
            weights = planar.flux_um_per_s(x, y) / even.flux_um_per_s(x, y)
            rays.append((x, y, weights / weights.sum()))
        of_brush = np.array(rays)[self.model.pattern_rows(self.path.brush)]
        x, y, weights = np.moveaxis(of_brush, 1, 0)
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
        """The passes that spray for 50 mm or more: what is shorter is the end of another."""
        spraying = self.whole.select(self.whole.flow > 0.0)
        each = [spraying.select(spraying.spray_pass == n) for n in np.unique(spraying.spray_pass)]
        return [one for one in each if one.dwell_s @ one.speed_m_per_s >= 0.05]


def geometry_warnings(view: GunView, frame_id: str = '') -> Iterator[str]:
    """Yield what is odd, a line each with its likely cause; what follows from one is left out."""
    sprayed_m = view.whole.position_m[view.whole.flow > 0.0]
    boxes = (
        f"the poses in frame '{frame_id}' span {box_words(sprayed_m)}, the mesh "
        f'{box_words(view.surface.vertices_m)}'
    )
    alone = _elsewhere(view, boxes)
    if alone:
        yield alone
        return
    aim = _misaimed(view, boxes)
    # Whether so much of each pass lands on the part; of one that is too short it is not known.
    passes = [view.path.spray_pass == one.spray_pass[0] for one in view.passes]
    hits = [not at.any() or float(view.landing[at].mean()) >= LEAST_LANDING for at in passes]
    hitting = [*compress(view.passes, hits)]
    aside = hitting and _aside(view, hitting) and _aside(view, view.passes)
    if aim:
        yield aim
    if aside:
        yield aside
    if aim or aside or all(hits):
        return
    missing = [str(number) for number, hit in enumerate(hits, start=1) if not hit]
    which = f'pass {missing[0]} of {len(hits)} misses'
    if len(missing) > 1:
        which = f'passes {", ".join(missing[:-1])} and {missing[-1]} of {len(hits)} miss'
    cause = "check the trigger, the part's pose and that the mesh is the whole part"
    if np.all(view.whole.flow > 0.0):
        cause = (
            'no trigger is known, so the gun is taken to spray there, too; name it with '
            '--state-topic'
        )
    yield f'{which} the part, next to none of that paint goes over it: {cause}'


def _elsewhere(view: GunView, boxes: str) -> str:
    """Poses or mesh in another unit, or poses that are nowhere over the part."""
    part, way = (
        float(np.linalg.norm(np.ptp(positions, axis=0)))
        for positions in (view.surface.vertices_m, view.path.position_m)
    )
    nominal = view.model.projection.nominal_standoff_m
    off_plane = abs(float(np.median(view.distance_m)) - nominal) > OFF_PLANE * nominal
    # No robot paints a part along a shorter path; one that only stands does so before the model
    # plane.
    if 0.0 < way < 0.01 and part > OTHER_UNIT * way and off_plane:
        return (
            f'the path is {way:.1g} m long, the part {part:.3g} m: the poses look a thousandfold '
            'too small; leave out --pose-unit, or give the poses in metres'
        )
    if way > OTHER_UNIT * part:
        return (
            f'the poses look like millimetres: they span {way:.4g} m, the part {part:.3g} m; give '
            '--pose-unit mm, or the poses in metres'
        )
    if way > 0.0 and part > OTHER_UNIT * way and view.distance_m.min() > TOO_FAR_TO_PAINT_M:
        return (
            f'the mesh looks like millimetres: it spans {part:.3g} m, the poses {way:.3g} m; use '
            '--mesh-scale 0.001, or mesh_scale: 0.001 in a campaign'
        )
    if view.over.any():
        return ''
    nearest = float(view.distance_m.min())
    if nearest < TOO_FAR_TO_PAINT_M:
        return (
            f'the passes miss the part, the gun runs beside it, {nearest:.2f} m away at the '
            f"nearest: {boxes}; check the part's pose and the frame of the poses"
        )
    return (
        f'the gun stays {nearest:.3g} m or more from the part, as if the poses were in another '
        f'frame than the mesh: {boxes}; give the part in the frame of the poses with --part-pose, '
        'in a campaign part_pose'
    )


def _misaimed(view: GunView, boxes: str) -> str:
    """A tool whose z does not look at the part, or a TCP far from where the model has it."""
    lean = float(np.median(view.off_normal_deg[view.over]))
    if lean < LEANING_DEG:
        nominal = view.model.projection.nominal_standoff_m
        standoff = float(np.median(view.distance_m[view.over]))
        if abs(standoff - nominal) < OFF_PLANE * nominal:
            return ''
        line = (
            f'the TCP is {standoff:.2f} m from the surface, where the model plane is '
            f'{nominal:.2f} m from it: check that the TCP is the centre of the bell cup, and the '
            "part's pose; if they are right, calibrate at this standoff"
        )
        return line if standoff < TOO_FAR_TO_PAINT_M else f'{line}; {boxes}'
    path = view.path.select(view.over)
    travel = path.velocity_m_per_s / np.maximum(path.speed_m_per_s, 1e-9)[:, None]
    along = float(np.median(np.abs(np.einsum('ij,ij->i', path.rotation[:, :, 2], travel))))
    toward = np.einsum('nij,ni->nj', path.rotation, view.way[view.over]).mean(axis=0)
    axis = int(np.abs(toward).argmax())
    remedy = 'z must point from the bell to the surface'
    known = abs(toward[axis]) > ALONG_COSINE
    if known:
        points = f'{"-" if toward[axis] < 0.0 else "+"}{"xyz"[axis]}'
        remedy += f', where tool {points} points now; say --tool-axis {points.lstrip("+")}'
    if along > ALONG_COSINE:
        return f'tool z runs along the travel, {lean:.0f} degrees off the surface normal; {remedy}'
    behind = np.median(np.einsum('ij,ij->i', view.way, view.normals)[view.over]) > 0.0
    if lean > REVERSED_DEG and behind:
        return (
            'the gun is behind the part and looks away from it, as if the poses were shifted '
            f'through the part, or tool z reversed and the mesh inside out: {boxes}'
        )
    if lean > REVERSED_DEG:
        return f'tool z is reversed, it points away from the part; {remedy}'
    if known:
        return f'tool z is {lean:.0f} degrees off the surface normal; {remedy}'
    return (
        f'tool z is {lean:.0f} degrees off the surface normal, now this way and now that, as if '
        f'the poses were in another frame than the mesh: {boxes}; {remedy}'
    )


def _aside(view: GunView, passes: list[SprayPath]) -> str:
    """Passes whose middle is not the part's: across them by their lines, along them by their ends.

    Ends are medians over the passes: a gun without a trigger sprays on its way in and out, too.
    """
    outward = view.surface.outward
    travel = np.concatenate([one.velocity_m_per_s for one in passes])
    travel = travel - np.outer(travel @ outward, outward)
    along = np.linalg.eigh(travel.T @ travel)[1][:, -1]
    across = np.cross(outward, along)
    lines = [np.median(one.position_m @ across) for one in passes]
    ends = np.median([np.quantile(one.position_m @ along, [0, 1]) for one in passes], axis=0)
    shift, past = np.zeros(3), 0.0
    for way, low, high in ((across, min(lines), max(lines)), (along, *ends)):
        part = view.surface.vertices_m @ way
        before, behind = part.min() - low, high - part.max()
        # Their middle is 0.2 m from the part's, and they run past its edge.
        if abs(behind - before) > 0.4 and max(before, behind) > 0.05:
            shift += 0.5 * (behind - before) * way
            past = max(past, before, behind)
    if not past:
        return ''
    axis = int(np.abs(shift).argmax())
    direction = f'{"-" if shift[axis] < 0.0 else "+"}{"xyz"[axis]} of the mesh'
    return (
        f'the passes lie {np.linalg.norm(shift):.2f} m aside of the middle of the part, toward '
        f'{direction}, and run {past:.2f} m past its edge there: unless only some of the '
        "part was to be painted, the part's pose or the TCP is shifted"
    )

"""How the gun ran over the part: passes, speed, standoff, lean of its axis, paint beside it."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.film.facet_error import facet_error
from paint_deposition.film.gun_view import GunView
from paint_deposition.motion.path import SprayPath
from paint_deposition.part.points import box_extent_m
from paint_deposition.part.surface import Surface

# No gun paints from so far away.
FAR_M = 1.0
# Part and path that differ so much in size are in different units.
OTHER_UNIT = 100.0
# Painters lean the gun, but less than this; an axis within 37 degrees of a direction points there.
LEANING_DEG, REVERSED_DEG, ALONG_COSINE = 35.0, 135.0, 0.8
# Standoffs further from the model plane than this share of its distance are odd.
OFF_PLANE = 0.4
# Passes lie aside if their middle is this far from the part's, and they run past its edge.
ASIDE_M, PAST_EDGE_M = 0.2, 0.05
# A pass with less of its paint over the part misses it.
LEAST_LANDING = 0.02


def geometry_warnings(view: GunView, frame_id: str = '') -> Iterator[str]:
    """Yield what is odd, a line each with its likely cause; what follows from one is left out."""
    sprayed_m = view.whole.position_m[view.whole.flow > 0.0]
    boxes = (
        f"the poses in frame '{frame_id}' span {_box(sprayed_m)}, the mesh "
        f'{_box(view.surface.vertices_m)}'
    )
    alone = _other_unit(view) or _not_over(view, boxes)
    if alone:
        yield alone
        return
    aim = _wrong_axis(view, boxes) or _off_model_plane(view, boxes)
    hitting = [
        one for one, share in zip(view.passes, view.landing_of_passes, strict=True)
        if share >= LEAST_LANDING
    ]  # fmt: skip
    aside = hitting and _aside(view, hitting) and _aside(view, view.passes)
    if aim:
        yield aim
    if aside:
        yield aside
    elif not aim and len(hitting) < len(view.passes):
        yield _missing(view)


def _box(positions_m: np.ndarray) -> str:
    ends = zip('xyz', positions_m.min(axis=0), positions_m.max(axis=0), strict=True)
    return ', '.join(f'{axis} {low:.2f} to {high:.2f}' for axis, low, high in ends) + ' m'


def _other_unit(view: GunView) -> str:
    part, way = (
        float(np.linalg.norm(box_extent_m(positions)))
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
    if way > 0.0 and part > OTHER_UNIT * way and view.distance_m.min() > FAR_M:
        return (
            f'the mesh looks like millimetres: it spans {part:.3g} m, the poses {way:.3g} m; use '
            '--mesh-scale 0.001, or mesh_scale: 0.001 in a campaign'
        )
    return ''


def _not_over(view: GunView, boxes: str) -> str:
    if view.over.any():
        return ''
    nearest = float(view.distance_m.min())
    if nearest < FAR_M:
        return (
            f'the passes miss the part, the gun runs beside it, {nearest:.2f} m away at the '
            f"nearest: {boxes}; check the part's pose and the frame of the poses"
        )
    return (
        f'the gun stays {nearest:.3g} m or more from the part, as if the poses were in another '
        f'frame than the mesh: {boxes}; give the part in the frame of the poses with --part-pose, '
        'in a campaign part_pose'
    )


def _wrong_axis(view: GunView, boxes: str) -> str:
    lean = float(np.median(view.off_normal_deg[view.over]))
    if lean < LEANING_DEG:
        return ''
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
    if lean > REVERSED_DEG and view.is_behind:
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


def _off_model_plane(view: GunView, boxes: str) -> str:
    nominal = view.model.projection.nominal_standoff_m
    standoff = float(np.median(view.distance_m[view.over]))
    if abs(standoff - nominal) < OFF_PLANE * nominal:
        return ''
    line = (
        f'the TCP is {standoff:.2f} m from the surface, where the model plane is {nominal:.2f} m '
        "from it: check that the TCP is the centre of the bell cup, and the part's pose; if they "
        'are right, calibrate at this standoff'
    )
    return line if standoff < FAR_M else f'{line}; {boxes}'


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
        if abs(behind - before) > 2.0 * ASIDE_M and max(before, behind) > PAST_EDGE_M:
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


def _missing(view: GunView) -> str:
    shares = view.landing_of_passes
    missing = [str(k + 1) for k, share in enumerate(shares) if share < LEAST_LANDING]
    which = f'pass {missing[0]} of {len(shares)} misses'
    if len(missing) > 1:
        which = f'passes {", ".join(missing[:-1])} and {missing[-1]} of {len(shares)} miss'
    cause = "check the trigger, the part's pose and that the mesh is the whole part"
    if np.all(view.whole.flow > 0.0):
        cause = (
            'no trigger is known, so the gun is taken to spray there, too; name it with '
            '--state-topic'
        )
    return f'{which} the part, next to none of that paint goes over it: {cause}'


# Distances from the surface are given without the few of approaches and ends.
RANGE = (0.05, 0.95)


@dataclass(frozen=True)
class SprayGeometry:
    """How the gun ran over the part while it sprayed."""

    passes: int  # that spray for 50 mm or more
    speed_m_per_s: float  # median of the TCP's over the paint sprayed [m/s]
    # Median distance of the TCP from the nearest surface where the gun is over the part, NaN where
    # it never is [m].
    standoff_m: float
    # 90 % of that paint leaves between these distances [m].
    standoff_low_m: float
    standoff_high_m: float
    off_normal_deg: float  # median angle between tool z and the way to that surface [deg]
    # Share of the spray's straight rays that meet the outward side of the part, 0 to 1.
    paint_over_part: float
    # Worst error of the film from flat facets of a curved part, as a share of the thickest film;
    # see ``film.facet_error``.
    facet_error: float
    warnings: tuple[str, ...] = ()  # what is odd, a line each, with its likely cause

    @property
    def sentence(self) -> str:
        """The figures in a line."""
        where = 'TCP nowhere over the part'
        if math.isfinite(self.standoff_m):
            where = (
                f'TCP {self.standoff_m:.2f} m from the surface ({self.standoff_low_m:.2f} to '
                f'{self.standoff_high_m:.2f}), z {self.off_normal_deg:.0f} degrees off its normal'
            )
        return (
            f'{self.passes} {"pass" if self.passes == 1 else "passes"}, '
            f'{self.speed_m_per_s:.2f} m/s, {where}, {100 * self.paint_over_part:.0f} % of the '
            'paint over the part'
        )

    @property
    def facet_sentence(self) -> str:
        """What the coarseness of the mesh costs."""
        return f'coarseness of the mesh: up to {100 * self.facet_error:.1f} % of the peak film'

    def to_dict(self) -> dict[str, Any]:
        """The figures by name, with the sentence and the warnings."""
        return {**vars(self), 'sentence': self.sentence, 'warnings': list(self.warnings)}


def spray_geometry(
    surface: Surface, path: SprayPath, model: DepositionModel, frame_id: str = ''
) -> SprayGeometry:
    """Sum up how the gun ran over a part that is turned to it, and say what is odd.

    Some of the path sprays; of the model, pattern and projection count, effects do not.
    """
    facets = facet_error(surface, path, model)
    view = GunView(surface, path, model)
    low, middle, high, lean = [math.nan] * 4
    if view.over.any():
        distance = view.distance_m[view.over]
        low, middle, high = np.quantile(distance, [RANGE[0], 0.5, RANGE[1]]).tolist()
        lean = float(np.median(view.off_normal_deg[view.over]))
    return SprayGeometry(
        passes=len(view.passes),
        speed_m_per_s=float(np.median(view.path.speed_m_per_s)),
        standoff_m=middle,
        standoff_low_m=low,
        standoff_high_m=high,
        off_normal_deg=lean,
        paint_over_part=float(view.landing.mean()),
        facet_error=facets.share,
        # Wrong geometry also makes facets cost more: it is reported alone.
        warnings=tuple(geometry_warnings(view, frame_id)) or tuple(filter(None, [facets.warning])),
    )

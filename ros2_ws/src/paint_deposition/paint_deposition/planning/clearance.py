"""Whether gun and spray keep clear of the part along a whole motion."""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from paint_deposition.motion.trajectory import Trajectory
from paint_deposition.part.surface import Surface
from paint_deposition.planning.requests import GunEnvelope


@dataclass(frozen=True)
class Contact:
    """The part within the envelope for a while."""

    # Since the first pose.
    begin_s: float
    end_s: float
    place_m: np.ndarray  # (3,) of the part that is deepest inside [m]
    depth_m: float  # how far it is inside [m]
    by_gun: bool  # whether it meets the gun, not only the cylinder before it

    def __str__(self) -> str:
        where = ', '.join(f'{value:.3f}' for value in self.place_m)
        what = 'the gun touches the part' if self.by_gun else 'the part is too near before the gun'
        return (
            f'{what} at ({where}) m from {self.begin_s:.1f} to {self.end_s:.1f} s, by '
            f'{self.depth_m * 1e3:.0f} mm'
        )

    def to_dict(self) -> dict[str, Any]:
        """An entry of ``contacts`` in a plan."""
        return {**vars(self), 'place_m': self.place_m.tolist()}


def contacts(
    surface: Surface, trajectory: Trajectory, envelope: GunEnvelope
) -> tuple[Contact, ...]:
    """Where the envelope meets the part, by the vertices of its refined mesh.

    What is smaller than an edge of that mesh may be missed by half an edge.
    """
    turns = Rotation.from_quat(trajectory.quaternions_xyzw)
    rows = rows_apart(trajectory.positions_m, turns, 0.01, math.radians(2.0))
    positions, axes = trajectory.positions_m[rows], turns[rows].as_matrix()[:, :, 2]
    # The spheres that hold gun and cylinder, about the middle of both.
    whole_m = envelope.before_m + envelope.length_m
    near = cKDTree(surface.vertices_m).query_ball_point(
        positions + (envelope.before_m - 0.5 * whole_m) * axes,
        math.hypot(envelope.radius_m, 0.5 * whole_m),
    )
    seconds = 1e-9 * (trajectory.stamps_ns[rows] - trajectory.stamps_ns[0])
    found: list[Contact] = []
    for time_s, position, axis, vertices in zip(seconds, positions, axes, near, strict=True):
        if not vertices:
            continue
        way = surface.vertices_m[vertices] - position
        along = way @ axis
        aside = np.linalg.norm(way - along[:, np.newaxis] * axis, axis=1)
        depth = np.minimum.reduce(
            [envelope.radius_m - aside, envelope.before_m - along, along + envelope.length_m]
        )
        deepest = int(np.argmax(depth))
        if depth[deepest] <= 0.0:
            continue
        by_gun = bool(((depth > 0.0) & (along < 0.0)).any())
        here = Contact(
            float(time_s), float(time_s), surface.vertices_m[vertices[deepest]],
            float(depth[deepest]), by_gun,
        )  # fmt: skip
        # Contacts closer together in time than this are one.
        if found and time_s - found[-1].end_s < 0.5:
            before = found[-1]
            deeper = max(before, here, key=lambda contact: contact.depth_m)
            by_gun = before.by_gun or here.by_gun
            found[-1] = replace(deeper, begin_s=before.begin_s, end_s=here.end_s, by_gun=by_gun)
        else:
            found.append(here)
    return tuple(found)


def rows_apart(
    positions_m: np.ndarray, turns: Rotation, step_m: float, step_rad: float
) -> np.ndarray:
    """Rows of poses (N,) that lie about so much travel or turn apart, both ends included."""
    way = np.linalg.norm(np.diff(positions_m, axis=0), axis=1) / step_m
    way += (turns[:-1].inv() * turns[1:]).magnitude() / step_rad
    steps = np.floor(np.append(0.0, np.cumsum(way)))
    return np.union1d(np.flatnonzero(np.diff(steps, prepend=-1.0) > 0.0), len(steps) - 1)

"""A part and a recorded motion beside each other: what fits, and what is odd."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import ModelError, RecordingError
from paint_deposition.film.spray_geometry import SprayGeometry, spray_geometry
from paint_deposition.motion.path import SprayPath
from paint_deposition.motion.path_builder import (
    DEFAULT_MAX_POSE_GAP_S,
    require_spraying,
    spray_path,
)
from paint_deposition.motion.trajectory import PoseCounts, Trajectory
from paint_deposition.part.facing import toward_the_guns
from paint_deposition.part.surface import Surface


@dataclass(frozen=True)
class GunOnPart:
    """A part and the motion of the gun over it.

    Attributes:
        surface: the part, its outward side turned to the gun.
        trajectory: the motion as recorded; path: the same cut into sub-steps; counts: its poses.
        geometry: how the gun ran over the part, and what is odd.
    """

    surface: Surface
    trajectory: Trajectory
    path: SprayPath
    counts: PoseCounts
    geometry: SprayGeometry

    def __repr__(self) -> str:
        return f'GunOnPart({self.geometry.sentence})'

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks on the mesh and the recording for the user."""
        return (*self.surface.notes, *self.trajectory.notes)

    def to_dict(self) -> dict[str, Any]:
        """Figures by name."""
        return {
            'geometry': self.geometry.to_dict(),
            'frame_id': self.trajectory.frame_id,
            'down': self.surface.down.tolist(),
            'area_m2': self.surface.area_m2,
            'poses': self.counts.to_dict(),
            'notes': list(self.notes),
        }


def look_at(
    surface: Surface,
    trajectory: Trajectory,
    model: DepositionModel | None = None,
    *,
    max_pose_gap_s: float = DEFAULT_MAX_POSE_GAP_S,
) -> GunOnPart:
    """Set a motion beside a part, as ``simulate`` does, without painting it.

    Args:
        surface: the part; it is turned round, with a note, if the gun looks at its back.
        trajectory: poses and trigger in the frame of the mesh.
        model: its pattern and projection say where the spray goes; default: a 50 mm bell.
        max_pose_gap_s: a longer time between two poses counts as gun off [s].

    Raises:
        RecordingError: the poses make no motion, or the gun never sprays.
    """
    if model is not None:
        require_brushes(trajectory, model)
    model = model or DepositionModel()
    return look_at_guns(surface, [trajectory], [model], max_pose_gap_s=max_pose_gap_s)[0]


def look_at_guns(
    surface: Surface,
    trajectories: Sequence[Trajectory],
    models: Sequence[DepositionModel],
    *,
    max_pose_gap_s: float = DEFAULT_MAX_POSE_GAP_S,
) -> list[GunOnPart]:
    """The same for several guns on one part, each with its motion and its model.

    The first gun whose axis meets the part says which side of it is outward.
    """
    paths = []
    for trajectory, model in zip(trajectories, models, strict=True):
        path, counts = spray_path(trajectory, max_pose_gap_s, model.max_step_m)
        _require_motion(trajectory.source, path, counts, max_pose_gap_s)
        require_spraying(trajectory, path)
        paths.append((path, counts))
    surface = toward_the_guns(surface, ((p.position_m, p.rotation[:, :, 2]) for p, _ in paths))
    return [
        GunOnPart(
            surface, trajectory, path, counts,
            spray_geometry(surface, path, model, trajectory.frame_id),
        )
        for trajectory, model, (path, counts) in zip(trajectories, models, paths, strict=True)
    ]  # fmt: skip


def require_brushes(trajectory: Trajectory, model: DepositionModel) -> None:
    """Refuse a motion with brushes that the model does not have.

    Raises:
        ModelError: naming the motion and the brushes there are.
    """
    try:
        model.require_brushes(trajectory.brushes)
    except ModelError as error:
        raise ModelError(f'{trajectory.source}: {error}') from None


def _require_motion(
    source: str, path: SprayPath, counts: PoseCounts, max_pose_gap_s: float
) -> None:
    if len(path):
        return
    reasons = {
        'not finite': counts.not_finite,
        'without a unit quaternion': counts.not_unit_quaternions,
        'with a repeated stamp': counts.repeated_stamps,
        'with a backward stamp': counts.backward_stamps,
        f'after a gap of more than {max_pose_gap_s:g} s': counts.gaps,
    }
    found = ', '.join(f'{count} {what}' for what, count in reasons.items() if count)
    raise RecordingError(
        f'{source}: no two of its {counts.received} poses make a motion'
        f'{f" ({found})" if found else ""}; record again, or see --max-pose-gap-s'
    )

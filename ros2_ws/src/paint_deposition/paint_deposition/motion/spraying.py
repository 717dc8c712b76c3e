"""Whether the gun sprays at all along a recorded motion."""

import numpy as np

from paint_deposition.errors import RecordingError
from paint_deposition.motion.path import SprayPath
from paint_deposition.motion.trajectory import Trajectory


def require_spraying(trajectory: Trajectory, path: SprayPath) -> None:
    """Refuse a motion along which the gun never sprays.

    Args:
        trajectory: as recorded.
        path: its sub-steps, at least one.

    Raises:
        RecordingError: the trigger never opens, or only while there are no poses.
    """
    if np.any(path.flow > 0.0):
        return
    stamps_ns, flow = trajectory.trigger_stamps_ns, trajectory.trigger_flow
    remedy = 'check --state-topic; without a trigger the gun sprays whenever poses flow'
    if not np.any(flow > 0.0):
        raise RecordingError(
            f'{trajectory.source}: the gun never sprays, none of the {len(flow)} messages of its '
            f'trigger opens it; {remedy}'
        )
    apart_s = 1e-9 * float(stamps_ns[np.argmax(flow > 0.0)] - trajectory.stamps_ns.min())
    raise RecordingError(
        f'{trajectory.source}: the gun never sprays while there are poses, its trigger first '
        f'opens {abs(apart_s):.3g} s {"after" if apart_s > 0.0 else "before"} the first of them: '
        f'check that both are stamped by one clock; {remedy}'
    )

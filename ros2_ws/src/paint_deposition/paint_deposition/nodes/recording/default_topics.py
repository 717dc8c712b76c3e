"""What a recorder records where nobody names topics."""

from __future__ import annotations

from collections.abc import Sequence

from paint_deposition.nodes.runtime.messages import of_gun

POSES = 'atomizer/pose'
STATIC_FRAMES, PART_POSE = '/tf_static', 'part_pose'
# The mesh marker is left out: the cloud and the field say the same in a fortieth of its size.
OF_THE_CELL = (
    'thickness/cloud',
    'thickness/field',
    'thickness/stats',
    'comparison/stats',
    'planned_path',
    # Where the part stood, for poses that are not in its frame.
    PART_POSE,
    '/tf',
    STATIC_FRAMES,
    '/diagnostics',
    '/parameter_events',
)


def default_topics(guns: Sequence[str]) -> list[str]:
    """Motion, film, plan, diagnostics and parameter changes; of several guns the film of each."""
    motion = [of_gun(gun, topic) for gun in guns for topic in (POSES, 'atomizer/state')]
    shares = [of_gun(gun, 'thickness/field') for gun in guns if len(guns) > 1]
    return [*motion, *shares, *OF_THE_CELL]

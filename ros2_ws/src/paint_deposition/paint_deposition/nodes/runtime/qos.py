"""The quality of service of every topic, by what it carries; reliable where nothing is said."""

from __future__ import annotations

from collections.abc import Sequence

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

# Two seconds of a 250 Hz robot. A queue of ten loses a fifth of the poses while a callback
# builds one mesh marker, whatever the reliability: a full queue drops its oldest message.
POSE_DEPTH = 500


# The newest message is kept for subscribers that come later: meshes, statistics, run status.
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
# Clouds, fields and other results that are drawn or recorded as they come.
RESULTS = QoSProfile(depth=10)
# Progress reports of the nodes that take poses; the newest one says all.
PROGRESS = QoSProfile(depth=100)
DIAGNOSTICS = QoSProfile(depth=10)
CLOCK = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)


def accepting(offered: Sequence[QoSProfile], depth: int) -> QoSProfile:
    """Subscription that all these publishers match, as reliable and as latched as they allow."""
    all_reliable = all(p.reliability == ReliabilityPolicy.RELIABLE for p in offered)
    all_latched = all(p.durability == DurabilityPolicy.TRANSIENT_LOCAL for p in offered)
    return QoSProfile(
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if all_reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if all_latched else DurabilityPolicy.VOLATILE,
    )


def offers_less(offered: QoSProfile, subscribed: QoSProfile) -> bool:
    """True when some publisher no longer matches the subscription; the weaker policy is larger."""
    return (
        offered.reliability > subscribed.reliability or offered.durability > subscribed.durability
    )

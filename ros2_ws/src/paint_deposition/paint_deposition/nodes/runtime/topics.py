"""Names and quality of service of the topics."""

from __future__ import annotations

from collections.abc import Sequence

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo

# Every node that takes poses reports here how far it has come.
PROGRESS_TOPIC = 'atomizer/progress'
# The part in the cell, for those who record.
PART_TOPIC = 'part'

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


def of_gun(name: str, topic: str) -> str:
    """A topic of the gun of this name; '' is the only gun of a cell."""
    return f'{name}/{topic}' if name else topic


def accepting(offered: Sequence[QoSProfile], depth: int) -> QoSProfile:
    """Subscription that all these publishers match, as reliable and as latched as they allow."""
    all_reliable = all(p.reliability == ReliabilityPolicy.RELIABLE for p in offered)
    all_latched = all(p.durability == DurabilityPolicy.TRANSIENT_LOCAL for p in offered)
    return QoSProfile(
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if all_reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if all_latched else DurabilityPolicy.VOLATILE,
    )


def weaker_policies(offered: QoSProfile, wanted: QoSProfile) -> list[str]:
    """The policies in which an offer does not meet a request; the weaker is the larger number."""
    return [
        name
        for name in ('reliability', 'durability')
        if getattr(offered, name) > getattr(wanted, name)
    ]


def endpoint_name(info: TopicEndpointInfo) -> str:
    """The full name of the node at a topic's other end."""
    return f'{info.node_namespace.rstrip("/")}/{info.node_name}'

"""The quality of service of a recorded topic, as rosbag2 stores it."""

from __future__ import annotations

from rosbags.interfaces import (
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)

FOREVER = QosTime(9223372036, 854775807)


def offered_qos(
    depth: int,
    reliable: bool = True,
    latched: bool = False,
    *,
    history: str = 'KEEP_LAST',
    liveliness: str = 'AUTOMATIC',
    deadline: QosTime = FOREVER,
    lifespan: QosTime = FOREVER,
    lease: QosTime = FOREVER,
    plain_names: bool = False,
) -> Qos:
    """The QoS of a topic as rosbag2 stores it; a latched one is transient local.

    Args:
        depth: of the publisher's queue [messages].
        history: name of the policy, as the middleware tells it.
        liveliness: name of the policy.
        deadline: longest time between two messages.
        lifespan: how long a message is good for.
        lease: within which the publisher shows that it is alive.
        plain_names: whether ROS's conventions of topic names are avoided.
    """
    return Qos(
        QosHistory[history],
        depth,
        QosReliability.RELIABLE if reliable else QosReliability.BEST_EFFORT,
        QosDurability.TRANSIENT_LOCAL if latched else QosDurability.VOLATILE,
        deadline,
        lifespan,
        QosLiveliness[liveliness],
        lease,
        plain_names,
    )

"""Quality of service as bags store it."""

from __future__ import annotations

from rclpy.duration import Duration
from rclpy.qos import QoSProfile
from rosbags.interfaces import (
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)


def as_recorded(profile: QoSProfile) -> Qos:
    """A publisher's profile, as the middleware tells it, the way bags store it."""
    return Qos(
        QosHistory[profile.history.name],
        profile.depth,
        QosReliability[profile.reliability.name],
        QosDurability[profile.durability.name],
        _as_time(profile.deadline),
        _as_time(profile.lifespan),
        QosLiveliness[profile.liveliness.name],
        _as_time(profile.liveliness_lease_duration),
        profile.avoid_ros_namespace_conventions,
    )


def _as_time(duration: Duration) -> QosTime:
    return QosTime(*divmod(duration.nanoseconds, 10**9))

"""Names and quality of service of the topics."""

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo

# On which every subscriber of the poses reports its progress.
PROGRESS_TOPIC = 'atomizer/progress'
PART_TOPIC = 'part'
TRUST_TOPIC = 'thickness/trust'

# Two seconds of a 250 Hz robot. A queue of ten loses a fifth of the poses while a callback
# builds one mesh marker, whatever the reliability: a full queue drops its oldest message.
POSE_DEPTH = 500
# Late subscribers get the newest message: meshes, statistics, the part.
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
# Clouds, fields and other results that are drawn or recorded as they arrive.
RESULTS = QoSProfile(depth=10)
PROGRESS = QoSProfile(depth=100)
DIAGNOSTICS = QoSProfile(depth=10)
CLOCK = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)


def gun_topic(name: str, topic: str) -> str:
    """A topic of the named gun; '' is the only gun of a cell."""
    return f'{name}/{topic}' if name else topic


def node_name(info: TopicEndpointInfo) -> str:
    """The fully qualified name of the node of an endpoint."""
    return f'{info.node_namespace.rstrip("/")}/{info.node_name}'

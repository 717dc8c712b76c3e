"""Who hears a replay, and what it should hear."""

from geometry_msgs.msg import PoseStamped
from paint_msgs.msg import AtomizerState, PoseProgress
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message

from paint_deposition.files.recordings.bag_files import open_bag
from paint_deposition.nodes import topics


class Listener(Node):
    """Takes poses and states as they come, as bytes, and may report progress."""

    def __init__(self, context, name='listener', reports=False, namespace=''):
        super().__init__(name, context=context, namespace=namespace)
        self.poses: list[bytes] = []
        self.states: list[AtomizerState] = []
        self.order: list[str] = []
        self.reports = reports
        self.create_subscription(
            PoseStamped, 'atomizer/pose', self.take_pose, QoSProfile(depth=5_000), raw=True
        )
        self.create_subscription(
            AtomizerState, 'atomizer/state', self.take_state, QoSProfile(depth=5_000)
        )
        self.publisher = (
            self.create_publisher(PoseProgress, 'atomizer/progress', topics.PROGRESS)
            if reports is not None
            else None
        )
        if reports:
            self.create_timer(0.05, self.report)

    def take_pose(self, cdr: bytes) -> None:
        self.poses.append(cdr)
        self.order.append('pose')

    def take_state(self, state: AtomizerState) -> None:
        self.states.append(state)
        self.order.append('state')

    def report(self) -> None:
        reporter = self.get_fully_qualified_name()
        progress = PoseProgress(reporter=reporter, poses_received=len(self.poses))
        if self.poses:
            progress.header = deserialize_message(self.poses[-1], PoseStamped).header
        self.publisher.publish(progress)


def recorded(bag, topic='/atomizer/pose') -> list[bytes]:
    with open_bag(bag) as opened:
        return [message.cdr for message in opened.messages([topic])]

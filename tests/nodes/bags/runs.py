"""What tests of the recorder send, how they look at its runs, and who hears a replay."""

import yaml
from geometry_msgs.msg import PoseStamped
from paint_msgs.msg import AtomizerState, PoseProgress
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message
from rclpy.utilities import get_rmw_implementation_identifier

from paint_deposition.files.recordings.bag_files import open_bag
from paint_deposition.nodes import topics
from paint_deposition.nodes.bags.run_recorder import RunRecorder

# Whether messages come with a number; CycloneDDS gives them none.
NUMBERED = get_rmw_implementation_identifier() != 'rmw_cyclonedds_cpp'
UNCOUNTED = ' (losses cannot be counted: this middleware does not number messages)'


def pose(stamp_ns: int) -> PoseStamped:
    return topics.pose_message('door', stamp_ns, [0.0] * 6 + [1.0])


def finish(recorder: RunRecorder) -> dict:
    """End the recording and return the information of its metadata file."""
    recorder.close()
    content = yaml.safe_load((recorder.run.folder / 'metadata.yaml').read_text())
    return content['rosbag2_bagfile_information']


def counts(information: dict) -> dict[str, int]:
    """Messages by topic, but for what the nodes say of themselves."""
    found = {entry['topic_metadata']['name']: entry['message_count']
             for entry in information['topics_with_message_count']}  # fmt: skip
    of_nodes = ('/diagnostics', '/parameter_events')
    return {name: count for name, count in found.items() if name not in of_nodes}


def messages(path) -> list[tuple[str, bytes]]:
    with open_bag(path) as bag:
        names = [topic.name for topic in bag.topics]
        return [(message.topic, message.cdr) for message in bag.messages(names)]


class Listener(Node):
    """Takes poses and states as they come, as bytes, and may report progress."""

    def __init__(self, context, reports):
        super().__init__('listener', context=context)
        self.poses: list[bytes] = []
        self.states: list[AtomizerState] = []
        whole, take = QoSProfile(depth=5_000), self.poses.append
        self.create_subscription(PoseStamped, 'atomizer/pose', take, whole, raw=True)
        self.create_subscription(AtomizerState, 'atomizer/state', self.states.append, whole)
        if reports is not None:
            progress = 'atomizer/progress', topics.PROGRESS
            self.publisher = self.create_publisher(PoseProgress, *progress)
        if reports:
            self.create_timer(0.05, self.report)

    def report(self) -> None:
        reporter = self.get_fully_qualified_name()
        progress = PoseProgress(reporter=reporter, poses_received=len(self.poses))
        if self.poses:
            progress.header = deserialize_message(self.poses[-1], PoseStamped).header
        self.publisher.publish(progress)


def recorded(bag, topic='/atomizer/pose') -> list[bytes]:
    with open_bag(bag) as opened:
        return [message.cdr for message in opened.messages([topic])]

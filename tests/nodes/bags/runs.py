"""What tests of the recorder send, and how they look at the run that it wrote."""

import yaml
from geometry_msgs.msg import PoseStamped
from rclpy.time import Time
from rclpy.utilities import get_rmw_implementation_identifier

from paint_deposition.files.recordings.bag_files import open_bag
from paint_deposition.nodes.bags.run_recorder import RunRecorder

# Whether messages come with a number; CycloneDDS gives them none.
NUMBERED = get_rmw_implementation_identifier() != 'rmw_cyclonedds_cpp'
UNCOUNTED = ' (losses cannot be counted: this middleware does not number messages)'


def pose(stamp_ns: int, x_m: float = 0.0, frame_id: str = 'door') -> PoseStamped:
    message = PoseStamped()
    message.header.stamp = Time(nanoseconds=stamp_ns).to_msg()
    message.header.frame_id = frame_id
    message.pose.position.x = x_m
    message.pose.orientation.w = 1.0
    return message


def finish(recorder: RunRecorder) -> dict:
    """End the recording and return the information of its metadata file."""
    recorder.close()
    content = yaml.safe_load((recorder.run.folder / 'metadata.yaml').read_text())
    return content['rosbag2_bagfile_information']


def counts(information: dict) -> dict[str, int]:
    """Messages by topic, but for what the nodes say of themselves."""
    found = {
        entry['topic_metadata']['name']: entry['message_count']
        for entry in information['topics_with_message_count']
    }
    of_nodes = ('/diagnostics', '/parameter_events')
    return {name: count for name, count in found.items() if name not in of_nodes}


def offered(information: dict, topic: str) -> list[dict]:
    topics = [entry['topic_metadata'] for entry in information['topics_with_message_count']]
    return next(entry for entry in topics if entry['name'] == topic)['offered_qos_profiles']


def messages(path) -> list[tuple[str, bytes]]:
    with open_bag(path) as bag:
        return [(message.topic, message.cdr) for message in bag.messages()]

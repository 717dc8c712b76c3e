"""Message definitions: as rosbag2 builds them, hashed as the installation does."""

import pytest
from mcap.records import Schema
from mcap.stream_reader import StreamReader

from paint_deposition.errors import RecordingError
from paint_deposition.files.recordings import messages as definitions


def test_text_is_what_rosbag2_wrote(shared_data):
    """rosbag2's own recorder made this file; its texts have not changed since."""
    pytest.importorskip('rcl_interfaces')
    with (shared_data / 'bags/rosbag2_topics_and_services.mcap').open('rb') as stream:
        schemas = {r.name: r for r in StreamReader(stream).records if isinstance(r, Schema)}
    for name in ('rcl_interfaces/msg/ParameterEvent', 'rcl_interfaces/msg/Log'):
        assert definitions.installed(name).text.encode() == schemas[name].data


@pytest.mark.parametrize(
    'name', ['geometry_msgs/msg/PoseStamped', 'std_msgs/msg/Bool', 'sensor_msgs/msg/PointCloud2']
)
def test_standard_and_installed_types_have_one_hash(name):
    pytest.importorskip('rclpy')
    assert definitions.standard(name).type_hash == definitions.installed(name).type_hash
    assert definitions.standard(name).type_hash.startswith('RIHS01_')


def test_own_messages_bring_all_they_use():
    pytest.importorskip('paint_msgs')
    text = definitions.installed('paint_msgs/msg/ComparisonStats').text
    for used in ('std_msgs/Header', 'builtin_interfaces/Time', 'geometry_msgs/Point'):
        assert text.count(f'{definitions.SEPARATOR}\nMSG: {used}\n') == 1


def test_a_type_that_is_not_installed_is_named():
    pytest.importorskip('ament_index_python')
    with pytest.raises(RecordingError, match='no_msgs/msg/Nothing is not installed'):
        definitions.installed('no_msgs/msg/Nothing')
    with pytest.raises(RecordingError, match='std_msgs/msg/Nothing is not installed'):
        definitions.installed('std_msgs/msg/Nothing')

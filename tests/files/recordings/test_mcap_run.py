"""Runs in the MCAP layout of rosbag2, and the definitions of their messages."""

import contextlib
import itertools
import resource
import time
from multiprocessing import get_context

import pytest
import yaml
from mcap.records import Channel, Header, Metadata, Schema, Statistics
from mcap.stream_reader import StreamReader
from rosbags.rosbag2 import Reader

from paint_deposition.errors import RecordingError
from paint_deposition.files.recordings import messages as definitions
from paint_deposition.files.recordings.mcap_recovery import recover
from paint_deposition.files.recordings.mcap_run import RunWriter, offered_qos
from paint_deposition.files.recordings.messages import standard

BOOL = 'std_msgs/msg/Bool'
FORK = get_context('fork')
TRUE_CDR, FALSE_CDR = b'\0\1\0\0\1', b'\0\1\0\0\0'
QOS_KEYS = {
    'history', 'depth', 'reliability', 'durability', 'deadline', 'lifespan', 'liveliness',
    'liveliness_lease_duration', 'avoid_ros_namespace_conventions',
}  # fmt: skip


def gun_topic(name='/gun', latched=True) -> tuple:
    return name, BOOL, standard(BOOL), [offered_qos(1, latched=latched)]


@pytest.fixture
def run(tmp_path):
    with RunWriter(tmp_path / 'run', {'mesh_sha256': 'ab12'}, ros_distro='kilted') as writer:
        writer.add_topic(*gun_topic())
        writer.add_topic(*gun_topic('/never', latched=False))
        writer.write('/gun', TRUE_CDR, log_time_ns=2_000, publish_time_ns=1_900)
        writer.write('/gun', FALSE_CDR, log_time_ns=5_000, publish_time_ns=4_900)
    return writer.folder


def test_metadata_and_records_of_a_run(run):
    content = yaml.safe_load((run / 'metadata.yaml').read_text())['rosbag2_bagfile_information']
    times = {
        'starting_time': {'nanoseconds_since_epoch': 2_000}, 'duration': {'nanoseconds': 3_000},
        'message_count': 2,
    }  # fmt: skip
    gun, never = content.pop('topics_with_message_count')
    assert content == times | {
        'version': 9, 'storage_identifier': 'mcap', 'relative_file_paths': ['run_0.mcap'],
        'files': [{'path': 'run_0.mcap', **times}], 'custom_data': {'mesh_sha256': 'ab12'},
        'ros_distro': 'kilted', 'compression_format': '', 'compression_mode': '',
    }  # fmt: skip
    assert (gun['message_count'], never['message_count']) == (2, 0)
    topic = gun['topic_metadata']
    assert (topic['name'], topic['type'], topic['serialization_format']) == ('/gun', BOOL, 'cdr')
    assert topic['type_description_hash'].startswith('RIHS01_')
    (profile,) = topic['offered_qos_profiles']
    assert set(profile) == QOS_KEYS
    assert (profile['durability'], profile['reliability']) == ('transient_local', 'reliable')
    assert profile['lifespan'] == {'sec': 9223372036, 'nsec': 854775807}
    assert sorted(path.name for path in run.iterdir()) == ['metadata.yaml', 'run_0.mcap']
    with (run / 'run_0.mcap').open('rb') as stream:
        found = list(StreamReader(stream, validate_crcs=True).records)
    assert [r.profile for r in found if isinstance(r, Header)] == ['ros2']
    channel = next(r for r in found if isinstance(r, Channel) and r.topic == '/gun')
    assert channel.message_encoding == 'cdr'
    (profile,) = yaml.safe_load(channel.metadata['offered_qos_profiles'])
    assert set(profile) == QOS_KEYS
    assert channel.metadata['topic_type_hash'] == standard(BOOL)[1]
    at_open, at_close = (
        yaml.safe_load(r.metadata['serialized_metadata'])
        for r in found if isinstance(r, Metadata) and r.name == 'rosbag2'
    )  # fmt: skip
    assert (at_open['message_count'], at_close['message_count']) == (0, 2)
    whole = yaml.safe_load((run / 'metadata.yaml').read_text())
    assert at_close == whole['rosbag2_bagfile_information']
    assert any(isinstance(r, Statistics) for r in found)
    with Reader(run) as reader:
        assert [(time, data) for _, time, data in reader.messages()] == [
            (2_000, TRUE_CDR), (5_000, FALSE_CDR)
        ]  # fmt: skip


def write_until_killed(folder, told) -> None:
    """At 250 Hz; tells when each was written [ns]."""
    writer = RunWriter(folder)
    writer.add_topic(*gun_topic())
    start_s = time.monotonic()
    for number in itertools.count(1):
        written_ns = time.monotonic_ns()
        writer.write('/gun', TRUE_CDR, number, written_ns)
        told.send(written_ns)
        while time.monotonic() < start_s + number / 250:
            time.sleep(0.0005)


@pytest.mark.slow
def test_a_killed_process_loses_less_than_a_second(tmp_path):
    told, tells = FORK.Pipe(duplex=False)
    process = FORK.Process(target=write_until_killed, args=(tmp_path / 'run', tells))
    process.start()
    tells.close()
    written_ns = [told.recv() for _ in range(400)]
    process.kill()
    with contextlib.suppress(EOFError):
        while True:
            written_ns.append(told.recv())
    recovery, _ = recover(tmp_path / 'run', tmp_path / 'recovered')
    lost_ns = written_ns[recovery.message_count :]
    # By the writer's own clock: a busy machine may keep it waiting between two messages.
    assert not lost_ns or lost_ns[-1] - lost_ns[0] < 1_000_000_000
    with Reader(tmp_path / 'recovered') as reader:
        assert [t for _, t, _ in reader.messages()] == list(range(1, recovery.message_count + 1))


def write_until_refused(folder, tells) -> None:
    """Tells how many were written, and the errors of the first refusal and of the next."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (300_000, 300_000))
    with RunWriter(folder, compression='none') as writer:
        writer.add_topic(*gun_topic())
        try:
            for number in itertools.count():
                writer.write('/gun', TRUE_CDR, number, number)
        except RecordingError as error:
            with pytest.raises(RecordingError) as again:
                writer.write('/gun', TRUE_CDR, number, number)
            tells.send((number, str(error), str(again.value)))
            raise


@pytest.mark.slow
def test_the_first_refused_write_is_the_last(tmp_path):
    """A limit on the file's size fails exactly as a full disk: some bytes, then an error."""
    run, (told, tells) = tmp_path / 'run', FORK.Pipe(duplex=False)
    process = FORK.Process(target=write_until_refused, args=(run, tells))
    process.start()
    number, message, again = told.recv()
    process.join()
    assert process.exitcode == 1
    assert again == message
    assert 'is incomplete after' in message
    assert f'paint recover {run}' in message
    assert not (run / 'metadata.yaml').exists()
    recovery, _ = recover(run, tmp_path / 'recovered')
    # What the failing chunk held is lost: 64 KiB of messages of 36 bytes.
    assert 0 <= number - recovery.message_count <= 64 * 1024 / 36 + 1


def test_text_is_what_rosbag2_wrote(shared_data):
    """rosbag2's own recorder made this file; its texts have not changed since."""
    pytest.importorskip('rcl_interfaces')
    with (shared_data / 'bags/rosbag2_topics_and_services.mcap').open('rb') as stream:
        schemas = {r.name: r for r in StreamReader(stream).records if isinstance(r, Schema)}
    for name in ('rcl_interfaces/msg/ParameterEvent', 'rcl_interfaces/msg/Log'):
        assert definitions.installed(name)[0].encode() == schemas[name].data


def test_installed_types_have_the_standard_hash_and_bring_all_they_use():
    pytest.importorskip('paint_msgs')
    for name in ('geometry_msgs/msg/PoseStamped', BOOL, 'sensor_msgs/msg/PointCloud2'):
        assert definitions.standard(name)[1] == definitions.installed(name)[1]
        assert definitions.standard(name)[1].startswith('RIHS01_')
    text = definitions.installed('paint_msgs/msg/ComparisonStats')[0]
    for used in ('std_msgs/Header', 'builtin_interfaces/Time', 'geometry_msgs/Point'):
        assert text.count(f'{definitions.SEPARATOR}\nMSG: {used}\n') == 1
    for name in ('no_msgs/msg/Nothing', 'std_msgs/msg/Nothing'):
        with pytest.raises(RecordingError, match=f'{name} is not installed'):
            definitions.installed(name)

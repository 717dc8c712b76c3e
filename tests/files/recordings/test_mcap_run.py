"""Runs in the MCAP layout of rosbag2, and the definitions of their messages."""

import os
import signal
import subprocess
import sys

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


WRITE_UNTIL_KILLED = """
import sys, time
from pathlib import Path
from paint_deposition.files.recordings.mcap_run import RunWriter
sys.path.insert(0, sys.argv[2])
from files.recordings.test_mcap_run import TRUE_CDR, gun_topic

writer = RunWriter(sys.argv[1])
writer.add_topic(*gun_topic())
start_s = time.monotonic()
number = 0
while True:
    number += 1
    written_ns = time.monotonic_ns()
    writer.write('/gun', TRUE_CDR, number, written_ns)
    print(written_ns, flush=True)
    while time.monotonic() < start_s + number / 250:
        time.sleep(0.0005)
"""


@pytest.mark.slow
def test_a_killed_process_loses_less_than_a_second(tmp_path, repository):
    run, tests = tmp_path / 'run', repository / 'tests'
    command = [sys.executable, '-c', WRITE_UNTIL_KILLED, run, tests]
    process = subprocess.Popen(command, stdout=subprocess.PIPE)
    written_ns = [int(process.stdout.readline()) for _ in range(400)]
    os.kill(process.pid, signal.SIGKILL)
    written_ns += map(int, process.stdout.read().split())
    process.wait()
    recovery, _ = recover(run, tmp_path / 'recovered')
    lost_ns = written_ns[recovery.message_count :]
    # By the writer's own clock: a busy machine may keep it waiting between two messages.
    assert not lost_ns or lost_ns[-1] - lost_ns[0] < 1_000_000_000
    with Reader(tmp_path / 'recovered') as reader:
        assert [t for _, t, _ in reader.messages()] == list(range(1, recovery.message_count + 1))


WRITE_UNTIL_REFUSED = """
import resource, sys
sys.path.insert(0, sys.argv[2])
from files.recordings.test_mcap_run import TRUE_CDR, gun_topic
from paint_deposition.errors import RecordingError
from paint_deposition.files.recordings.mcap_run import RunWriter

resource.setrlimit(resource.RLIMIT_FSIZE, (300_000, 300_000))
with RunWriter(sys.argv[1], compression='none') as writer:
    writer.add_topic(*gun_topic())
    number = 0
    try:
        while True:
            writer.write('/gun', TRUE_CDR, number, number)
            number += 1
    except RecordingError as error:
        first = str(error)
        try:
            writer.write('/gun', TRUE_CDR, number, number)
        except RecordingError as again:
            print(number, first == str(again), first, sep='|')
        raise
"""


@pytest.mark.slow
def test_the_first_refused_write_is_the_last(tmp_path, repository):
    """A limit on the file's size fails exactly as a full disk: some bytes, then an error."""
    run = tmp_path / 'run'
    command = [sys.executable, '-c', WRITE_UNTIL_REFUSED, run, repository / 'tests']
    process = subprocess.run(command, capture_output=True, text=True, check=False)
    number, same, message = process.stdout.strip().split('|')
    assert process.returncode != 0
    assert same == 'True'
    assert 'is incomplete after' in message
    assert f'paint recover {run}' in message
    assert not (run / 'metadata.yaml').exists()
    recovery, _ = recover(run, tmp_path / 'recovered')
    # What the failing chunk held is lost: 64 KiB of messages of 36 bytes.
    assert 0 <= int(number) - recovery.message_count <= 64 * 1024 / 36 + 1


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

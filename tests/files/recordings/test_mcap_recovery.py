"""Everything up to the break comes back, with what rosbag2 needs to play it."""

import os
from collections import Counter

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from rosbags.interfaces import QosReliability
from rosbags.rosbag2 import Reader

from files.recorded import straight_pass
from paint_deposition.errors import RecordingError
from paint_deposition.files.motion_files import read_recording
from paint_deposition.files.recordings.bags import write_pose_bag
from paint_deposition.files.recordings.mcap_recovery import recover
from paint_deposition.files.recordings.mcap_run import RunWriter, offered_qos
from paint_deposition.files.recordings.messages import standard

BOOL = 'std_msgs/msg/Bool'


def messages(path):
    with Reader(path) as reader:
        return [(c.topic, c.msgtype, time, bytes(data)) for c, time, data in reader.messages()]


def topics(path):
    with Reader(path) as reader:
        return {c.topic: (c.msgtype, c.msgdef, c.ext) for c in reader.connections}


@pytest.mark.parametrize(
    'name', ['rosbag2_split', 'rosbag2_cdr_test_0.mcap', 'rosbag2_topics_and_services.mcap']
)
def test_whole_recordings_of_others_come_back_whole(tmp_path, shared_data, name):
    source = shared_data / 'bags' / name
    recovery, lost = recover(source, tmp_path / 'recovered')
    assert Counter(messages(tmp_path / 'recovered')) == Counter(messages(source))
    assert topics(tmp_path / 'recovered') == topics(source)
    assert recovery.message_count == len(messages(source))
    assert (lost['breaks'], lost['damaged_chunks']) == ([], 0)


@pytest.mark.parametrize('given', ['folder', 'file'])
def test_a_cut_run_becomes_a_whole_one(tmp_path, given):
    """Cut in the middle of its third chunk or later; its custom data and QoS are special."""
    with RunWriter(tmp_path / 'run', {'mesh': 'door.stl'}, ros_distro='jazzy') as writer:
        weak = offered_qos(7)._replace(reliability=QosReliability.BEST_EFFORT)
        qos = [offered_qos(1, latched=True), weak]
        writer.add_topic('/gun', BOOL, standard(BOOL), qos)
        rng = np.random.default_rng(3)
        for number in range(9_000):
            cdr = b'\0\1\0\0' + bytes([int(rng.integers(2))])
            writer.write('/gun', cdr, (number + 1) * 1_000, number * 1_000)
    content = writer.path.read_bytes()
    writer.path.write_bytes(content[: int(0.6 * len(content))])
    (writer.folder / 'metadata.yaml').unlink()
    source = writer.folder if given == 'folder' else writer.path
    recovery, lost = recover(source, tmp_path / 'recovered')
    assert 3_000 < recovery.message_count < 9_000
    assert recovery.counts == {'/gun': recovery.message_count}
    assert lost['breaks'][0].endswith('the end is missing')
    times = [time for _, _, time, _ in messages(tmp_path / 'recovered')]
    assert times == [(number + 1) * 1_000 for number in range(recovery.message_count)]
    content = yaml.safe_load((tmp_path / 'recovered/metadata.yaml').read_text())
    information = content['rosbag2_bagfile_information']
    assert information['custom_data'] == {'mesh': 'door.stl'}
    assert information['ros_distro'] == 'jazzy'
    metadata = information['topics_with_message_count'][0]['topic_metadata']
    latched, other = metadata['offered_qos_profiles']
    assert (latched['depth'], latched['durability']) == (1, 'transient_local')
    assert (other['depth'], other['reliability']) == (7, 'best_effort')
    assert metadata['type_description_hash'] == standard(BOOL)[1]


@pytest.mark.parametrize('told', [
    'a: 2024-13-45', '{a: ' * 600 + '1' + '}' * 600, 'custom_data: [1]', 'a: &a [*a]', '- 1',
])  # fmt: skip
def test_odd_metadata_in_a_file_do_not_keep_it_from_being_recovered(tmp_path, told):
    with RunWriter(tmp_path / 'run') as run:
        run.add_topic('/gun', BOOL, standard(BOOL))
        run.write('/gun', b'\0\1\0\0\1', 1, 1)
        run._writer.add_metadata('rosbag2', {'serialized_metadata': told})
    recovery, _ = recover(run.path, tmp_path / 'recovered')
    assert recovery.counts == {'/gun': 1}


def gun_file(path, count, chunk_bytes, compression='zstd'):
    """A file of so many triggers, 1000 ns apart, and its chunks."""
    on, text = np.random.default_rng(8).integers(2, size=count), standard(BOOL)[0].encode()
    with path.open('wb') as stream:
        kind = CompressionType[compression.upper()]
        writer = Writer(stream, chunk_size=chunk_bytes, compression=kind)
        writer.start(profile='ros2')
        schema = writer.register_schema(BOOL, 'ros2msg', text)
        channel = writer.register_channel('/gun', 'cdr', schema)
        for row, flag in enumerate(on.tolist()):
            writer.add_message(channel, 1000 * row, b'\0\1\0\0' + bytes([flag]), 1000 * row)
        writer.finish()
    with path.open('rb') as stream:
        return make_reader(stream).get_summary().chunk_indexes


@pytest.mark.parametrize('compression', ['zstd', 'lz4', 'none'])
def test_the_beginning_of_a_cut_chunk_is_read(tmp_path, compression):
    """Recorders with large chunks leave most of a cut file in the last one."""
    path = tmp_path / 'run.mcap'
    (chunk,) = gun_file(path, 20_000, 10**7, compression)
    os.truncate(path, chunk.chunk_start_offset + int(0.6 * chunk.chunk_length))
    recovery, _ = recover(path, tmp_path / 'recovered')
    read = [time for _, _, time, _ in messages(tmp_path / 'recovered')]
    assert 2_000 < recovery.message_count < 20_000
    assert read == list(range(0, 1000 * len(read), 1000))


def test_a_file_cut_at_any_byte_gives_back_all_its_whole_chunks(tmp_path):
    """The power goes; no more comes back either than there was, up to the next chunk's end."""
    ends = [
        (chunk.chunk_start_offset + chunk.chunk_length, chunk.message_end_time // 1000 + 1)
        for chunk in gun_file(tmp_path / 'run.mcap', 300, 1400)
    ]
    assert len(ends) > 6
    content = (tmp_path / 'run.mcap').read_bytes()
    borders = [end + step for end, _ in ends[::4] for step in (-1, 0, 1)]
    for cut in [*borders, *range(10, len(content), len(content) // 7)]:
        file = tmp_path / f'{cut}.mcap'
        file.write_bytes(content[:cut])
        try:
            recovered = recover(file, tmp_path / f'recovered_{cut}')[0].message_count
        except RecordingError:
            recovered = 0
        assert recovered >= max((count for end, count in ends if end <= cut), default=0)
        assert recovered <= next((count for end, count in ends if end > cut), 300)


def test_a_flipped_bit_costs_one_chunk(tmp_path):
    written = straight_pass(4_000)
    folder = write_pose_bag(tmp_path / 'pass', written)
    path = folder / 'pass_0.mcap'
    with path.open('rb') as stream:
        chunk = make_reader(stream).get_summary().chunk_indexes[0]
    content = bytearray(path.read_bytes())
    content[chunk.chunk_start_offset + chunk.chunk_length // 2] ^= 0x10
    path.write_bytes(content)
    with pytest.raises(RecordingError, match='is damaged'):
        read_recording(folder)
    recovery, lost = recover(folder, tmp_path / 'recovered')
    assert lost['damaged_chunks'] == 1
    assert 2_000 < recovery.message_count < 4_002
    read = read_recording(tmp_path / 'recovered', None, '/atomizer/state')
    assert set(read.stamps_ns.tolist()) < set(written.stamps_ns.tolist())


def test_nothing_to_recover(tmp_path, shared_data):
    RunWriter(tmp_path / 'empty').abandon()
    for source, words in (
        (tmp_path / 'none', 'does not exist'), (tmp_path, r'holds no \.mcap file'),
        (shared_data / 'bags/evo_ROS_example.bag', 'not a valid MCAP file'),
        (tmp_path / 'empty', 'nothing to recover'),
    ):  # fmt: skip
        with pytest.raises(RecordingError, match=words):
            recover(source, tmp_path / 'recovered')
    assert not (tmp_path / 'recovered').exists()

"""Poses and triggers out of bags of every kind, and the one line for bags that do not serve."""

import re
import shutil
import sqlite3
import sys
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import paint_deposition as pd
import refusals
from files.recorded import POSE, START_NS, Messages, pose_entries, straight_pass, write_bag
from paint_deposition.errors import RecordingError
from paint_deposition.files.recordings.bag_files import open_bag
from paint_deposition.files.recordings.bags import write_pose_bag
from paint_deposition.files.recordings.mcap_run import RunWriter
from paint_deposition.files.recordings.messages import STATE_TEXT, STATE_TYPE, standard
from paint_deposition.motion.transforms import Rigid


def same(read: pd.Trajectory, written: pd.Trajectory) -> bool:
    poses, trigger = ('stamps_ns', 'positions_m', 'quaternions_xyzw'), ('stamps_ns', 'flow')
    return read.frame_id == written.frame_id and all(
        np.array_equal(getattr(read, name), getattr(written, name))
        for name in (*poses, *(f'trigger_{name}' for name in trigger))
    )


refusal = partial(refusals.refusal, RecordingError, pd.read_recording)


@pytest.mark.parametrize('storage', ['ros1', 'sqlite3', 'mcap'])
def test_every_storage_and_spelling_of_the_topic(tmp_path, storage):
    written = straight_pass(triggers=False)
    entries = pose_entries(written, 'atomizer/pose', ros1=storage == 'ros1')
    name = 'made.bag' if storage == 'ros1' else 'made'
    path = write_bag(tmp_path / name, entries, storage)
    for topic in ('atomizer/pose', '/atomizer/pose', None):
        assert same(pd.read_recording(path, topic), written)


def test_topics_of_other_types_and_without_messages_are_no_candidates(tmp_path):
    """rosbags cannot parse the events' type; only the types that are read have to be parsed."""
    written, messages = straight_pass(triggers=False), Messages()
    event = 'MSG: example_interfaces/srv/AddTwoInts_Event\nint64 a\n---\nint64 sum\n', ''
    with RunWriter(tmp_path / 'run') as run:
        run.add_topic('/add/_service_event', 'example_interfaces/srv/Add_Event', event)
        run.write('/add/_service_event', b'\0\1\0\0', START_NS, START_NS)
        for topic in ('/empty', '/p'):
            run.add_topic(topic, POSE, standard(POSE))
        for topic, stamp, message in pose_entries(written, '/p'):
            run.write(topic, bytes(messages.serialised(message)), stamp, stamp)
    assert same(pd.read_recording(tmp_path / 'run'), written)


def test_states_come_as_they_were_sent_whichever_topic_was_received_first(tmp_path):
    """To a recorder that was stopped a state may come before poses that were sent before it."""
    motion = straight_pass(triggers=False)
    messages = Messages(state_types={STATE_TYPE: STATE_TEXT})
    stamps = motion.stamps_ns.tolist()
    with RunWriter(tmp_path / 'run', {'serial': '1'}) as run:
        for topic, kind in ('/p', POSE), ('/s', STATE_TYPE):
            run.add_topic(topic, kind, standard(kind))

        def state(row, flow):
            of = messages.store.types[STATE_TYPE]
            return of(messages.header(stamps[row]), flow > 0.0, flow, 0.0, 0.0, 0.0, 0, 0.0, 0.0)

        def write(topic, message, sent_ns, logged_ns):
            run.write(topic, bytes(messages.serialised(message)), logged_ns, sent_ns)

        write('/s', state(0, 1.0), stamps[0] - 1, stamps[0] - 1)
        write('/s', state(10, 0.0), stamps[30] - 1, stamps[-1])
        for row, (topic, sent_ns, pose) in enumerate(pose_entries(motion, '/p')):
            write(topic, pose, sent_ns, sent_ns if row < 20 else stamps[-1] + row)
    assert pd.read_recording(tmp_path / 'run', None, '/s').trigger_rows.tolist() == [0, 30]


@pytest.mark.parametrize('storage', ['sqlite3', 'mcap'])
def test_where_the_stamps_start_again_states_keep_their_place(tmp_path, storage):
    written, messages = straight_pass(triggers=False), Messages()
    entries = pose_entries(written)
    entries += [(topic, at + 10**9, pose) for topic, at, pose in entries]
    state = messages.state(START_NS, True, 1.0)
    entries += [('/s', START_NS + at, state) for at in (1, 10**9 - 1)]
    bag = write_bag(tmp_path / 'run', sorted(entries, key=lambda entry: entry[1]), storage)
    for path in bag, next(bag.glob(f'*.{"mcap" if storage == "mcap" else "db3"}')):
        assert pd.read_recording(path, None, '/s').trigger_rows.tolist() == [1, len(written)]


def test_a_bool_counts_from_its_log_time_and_a_state_from_its_stamp(tmp_path):
    written, messages = straight_pass(triggers=False), Messages()
    entries = pose_entries(written, delay_ns=3_000_000)
    entries += [('/gun', START_NS + at, messages.trigger(at == 700)) for at in (700, 900)]
    # Logged late: only its own stamp says when the flow changed.
    states = [(70, True, 0.8, 60.0), (90, False, 0.8), (95, True, np.nan, 64.0)]
    for k, (at, *state) in enumerate(states):
        entries.append(('/state', START_NS + 5_000 + k, messages.state(START_NS + at, *state)))
    folder = write_bag(tmp_path / 'two_triggers', sorted(entries, key=lambda entry: entry[1]))
    gun = pd.read_recording(folder, None, 'gun')
    assert gun.trigger_stamps_ns.tolist() == [START_NS + 700, START_NS + 900]
    assert gun.trigger_flow.tolist() == [1.0, 0.0]
    state = pd.read_recording(folder, None, '/state')
    assert state.trigger_stamps_ns.tolist() == [START_NS + 70, START_NS + 90, START_NS + 95]
    assert state.trigger_flow.tolist() == [0.8, 0.0, 1.0]
    # While it sprayed; a flow that is not known is no setting, nor is what is not filled.
    assert state.settings == {'flow': 0.8, 'voltage_kv': 62.0}
    unused = pd.read_recording(folder)
    assert len(unused.trigger_stamps_ns) == 0
    assert unused.notes == (
        f'recording {folder}: /state (paint_msgs/msg/AtomizerState) and /gun (std_msgs/msg/Bool) '
        'are not used, the gun sprays whenever poses flow; add `state_topic: /state` '
        '(--state-topic) if that is the trigger',
    )
    assert gun.notes == ()


@pytest.mark.parametrize('sourced', [True, False])
def test_states_of_an_older_recorder_are_read_without_ros(tmp_path, monkeypatch, sourced):
    """Its sqlite3 bags hold no definitions; those of other messages have to be installed."""
    types = {STATE_TYPE: STATE_TEXT, 'cell_msgs/msg/Valve': 'bool open\n'}
    written, made = straight_pass(triggers=False), Messages(state_types=types)
    header = made.header(START_NS)
    state = made.store.types[STATE_TYPE](header, True, 0.8, 0.0, 0.0, 0.0, 0, 0.0, 0.0)
    valve = made.store.types['cell_msgs/msg/Valve'](True)
    entries = [*pose_entries(written), ('/state', START_NS, state), ('/valve', START_NS, valve)]
    folder = write_bag(tmp_path / 'old', entries, 'sqlite3', made)
    with sqlite3.connect(folder / 'old.db3') as database:
        database.execute('DELETE FROM message_definitions')
    if not sourced:
        monkeypatch.setitem(sys.modules, 'ament_index_python.packages', None)
    assert pd.read_recording(folder, None, '/state').trigger_flow.tolist() == [0.8]
    said = 'cell_msgs/msg/Valve is not installed; source the workspace that defines it'
    assert said in refusal(folder, None, '/valve.open')


def test_a_state_that_sprays_with_flow_0_is_noted(tmp_path):
    entries = pose_entries(straight_pass(triggers=False))
    entries.insert(1, ('/state', START_NS + 1, Messages().state(START_NS, True, 0.0, 60.0)))
    recorded = pd.read_recording(write_bag(tmp_path / 'run', entries), None, '/state')
    assert recorded.trigger_flow.tolist() == [0.0]
    assert 'trigger /state says spraying with flow 0, which lays no paint' in recorded.notes[0]


def test_poses_without_stamps_and_a_bool_on_another_clock_are_refused(tmp_path):
    written, hour_ns = straight_pass(triggers=False), 3_600 * 10**9
    entries = pose_entries(written, delay_ns=hour_ns)
    entries += [('/gun', START_NS + hour_ns, Messages().trigger(True))]
    folder = write_bag(tmp_path / 'other_clock', sorted(entries, key=lambda entry: entry[1]))
    assert len(pd.read_recording(folder)) == len(written)
    assert '3.6e+03 s off its own stamps' in refusal(folder, None, '/gun')
    messages = Messages()
    entries = [('/p', START_NS + k, messages.pose(0, (0, 0, 0), (0, 0, 0, 1))) for k in range(3)]
    assert 'all 3 poses on /p' in refusal(write_bag(tmp_path / 'unstamped', entries))


@pytest.mark.parametrize(
    ('bag', 'arguments', 'says'),
    [
        ('evo_ROS_example.bag', (), 'name a pose topic; .*ORB-SLAM S-PTAM groundtruth'),
        ('evo_ROS_example.bag', ('/truth',), 'topics: ORB-SLAM S-PTAM groundtruth'),
        ('evo_ROS_example.bag', ('S-PTAM', '/gun'), 'no topic /gun; it has no state topic'),
        ('evo_ROS_example.bag', ('S-PTAM', 'ORB-SLAM'), 'not paint_msgs/msg/AtomizerState or std'),
        ('evo_nav2_turtlebot.mcap', ('tf',), '/tf in .* is tf2_msgs/msg/TFMessage, not geom'),
        ('rosbag2_topics_and_services.mcap', (), 'it has no PoseStamped topic'),
        ('evo_none.mcap', (), 'evo_none.mcap: no such file; give a bag, a table'),
        ('../README.md', (), 'is not a bag; give a ROS 1 .bag, a rosbag2 folder, or an .mcap'),
        ('..', (), 'is not a rosbag2 folder'),
    ],
)
def test_what_real_bags_do_not_have(shared_data, bag, arguments, says):
    assert re.search(says, refusal(shared_data / 'bags' / bag, *arguments))


def test_messages_that_nodes_leave_out_are_left_out_counted_and_refused_if_strict(tmp_path):
    """A pose that nothing places, states without stamp or possible flow; one frame is none."""
    written, messages = straight_pass(20, triggers=False, frame_id='part'), Messages()
    entries = pose_entries(written)
    for row, frame in ((3, ''), (5, 'nowhere'), (7, '/part')):
        pose = written.positions_m[row], written.quaternions_xyzw[row]
        entries[row] = (*entries[row][:2], messages.pose(written.stamps_ns[row], *pose, frame))
    states = [(0, True, 1.0), (START_NS, True, -1.0), (START_NS, True, np.inf),
              (START_NS + 1, True, 0.5)]  # fmt: skip
    entries += [('/state', START_NS + k, messages.state(*state)) for k, state in enumerate(states)]
    path = write_bag(tmp_path / 'odd', entries)
    read = pd.read_recording(path, state_topic='/state')
    rows = np.delete(np.arange(20), 5)
    assert np.array_equal(read.stamps_ns, written.stamps_ns[rows])
    assert np.array_equal(read.positions_m, written.positions_m[rows])
    assert read.trigger_flow.tolist() == [0.5]
    said = ' '.join(read.warnings)
    assert "1 poses in frame 'nowhere', of which 'part' is not known at their time (" in said
    assert '3 states on /state, the first of them an atomizer state without a stamp' in said
    with pytest.raises(RecordingError, match='leave out --strict'):
        pd.read_recording(path, state_topic='/state', strict=True)


def test_poses_of_several_frames_are_brought_to_the_part(tmp_path):
    """As the nodes bring them: by the transforms, or by where the part is said to stand."""
    written, messages = straight_pass(20, triggers=False, frame_id='part'), Messages()
    place = [0.5, 0.1, -0.2, 0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)]
    seen = Rigid.of(place).applied(written.positions_m, written.quaternions_xyzw)
    entries = pose_entries(written)
    for row in range(8, 20):
        pose = seen[0][row], seen[1][row]
        entries[row] = (*entries[row][:2], messages.pose(written.stamps_ns[row], *pose, 'cell'))
    bare = write_bag(tmp_path / 'bare', entries)
    static = messages.transforms((START_NS, 'cell', 'part', place))
    placed = write_bag(tmp_path / 'placed', [('/tf_static', START_NS, static), *entries])
    for read in (pd.read_recording(bare, part_pose=place), pd.read_recording(placed)):
        assert (len(read), read.frame_id, read.warnings) == (20, 'part', ())
        assert np.allclose(read.positions_m, written.positions_m, atol=1e-12)
        assert np.allclose(read.quaternions_xyzw, written.quaternions_xyzw, atol=1e-12)
    assert len(pd.read_recording(bare)) == 8
    # However many are of a frame that nothing connects with the part.
    poses = [(0, 'cell'), *((row, 'nowhere') for row in range(1, 19)), (19, 'cell')]
    for row, frame in poses:
        pose = messages.pose(written.stamps_ns[row], seen[0][row], seen[1][row], frame)
        entries[row] = (*entries[row][:2], pose)
    few = write_bag(tmp_path / 'few', [('/tf_static', START_NS, static), *entries])
    read = pd.read_recording(few)
    assert read.stamps_ns.tolist() == written.stamps_ns[[0, 19]].tolist()
    assert np.allclose(read.positions_m, written.positions_m[[0, 19]], atol=1e-12)


def test_an_unfinished_file_says_how_to_recover_it(tmp_path):
    folder = write_pose_bag(tmp_path / 'pass', straight_pass(500))
    file = folder / 'pass_0.mcap'
    content = file.read_bytes()
    file.write_bytes(content[: len(content) // 2])
    assert refusal(file).endswith(f'run: paint recover {file}')
    assert refusal(folder).endswith(f'run: paint recover {folder}')
    file.write_bytes(content)
    (folder / 'metadata.yaml').unlink()
    assert refusal(folder).endswith(f'run: paint recover {folder}')


def test_a_part_of_a_split_bag_is_not_taken_for_the_whole(tmp_path):
    """A recorder that is killed has not named its last file; a single file may be named."""
    folder = write_pose_bag(tmp_path / 'pass', straight_pass(500))
    shutil.copy(folder / 'pass_0.mcap', folder / 'pass_1.mcap')
    said = f'metadata.yaml does not name pass_1.mcap); run: paint recover {folder}'
    assert refusal(folder).endswith(said)
    metadata = folder / 'metadata.yaml'
    both = re.sub(r'(\s*- )pass_0.mcap', r'\1pass_0.mcap\1pass_1.mcap', metadata.read_text())
    metadata.write_text(both)
    (warning,) = pd.read_recording(folder / 'pass_1.mcap', frame_id='door').warnings
    assert warning.startswith('pass_1.mcap is one of the 2 files of a split bag; give its folder')


def test_a_file_has_the_custom_data_of_its_folder_alone(tmp_path):
    """Not that of a folder which it was only put into; there, all of its messages count."""
    told = {'trigger_topic': '/atomizer/state', 'messages_of_the_part': '/atomizer/pose=7'}
    plan = write_pose_bag(tmp_path / 'plan', straight_pass(), told)
    own = pd.read_recording(plan / 'plan_0.mcap')
    assert (len(own), len(own.trigger_flow)) == (7, 2)
    shutil.copy(plan / 'plan_0.mcap', plan / 'other.mcap')
    other = pd.read_recording(plan / 'other.mcap')
    assert (len(other), len(other.trigger_flow)) == (50, 0)


def test_damaged_metadata_and_other_files_under_a_bags_name_are_no_traceback(tmp_path):
    told = {'messages_of_the_part': '/atomizer/pose=seven'}
    folder = write_pose_bag(tmp_path / 'run', straight_pass(5), told)
    assert 'run_0.mcap is damaged (invalid literal' in refusal(folder / 'run_0.mcap')
    # A cut ROS 1 bag is damaged likewise.
    for name in ('a.mcap', 'a.db3', 'a.bag'):
        path = tmp_path / name
        path.write_bytes(b'x' * 1000)
        assert f'{path} is damaged' in refusal(path)
        assert path.suffix != '.bag' or refusal(path).endswith(f'run: rosbag reindex {path}')
        path.write_bytes(b'')
        assert f'{path} is empty' in refusal(path)


def test_a_folder_of_several_recordings_asks_for_one(tmp_path):
    for name in ('monday', 'tuesday'):
        folder = write_pose_bag(tmp_path / name, straight_pass(5))
        shutil.copy(folder / f'{name}_0.mcap', tmp_path)
    text = refusal(tmp_path)
    assert 'name one of them: monday_0.mcap tuesday_0.mcap' in text


@pytest.mark.slow
def test_no_flipped_bit_goes_unnoticed(tmp_path):
    """Chunks carry checksums: a damaged file is refused or reads exactly as it was written."""
    written = straight_pass(400)
    content = (write_pose_bag(tmp_path / 'pass', written) / 'pass_0.mcap').read_bytes()
    damaged = tmp_path / 'damaged.mcap'
    rng = np.random.default_rng(11)
    refused = 0
    for position in rng.choice(len(content), 25, replace=False):
        flipped = bytearray(content)
        flipped[position] ^= 1 << int(rng.integers(8))
        damaged.write_bytes(flipped)
        try:
            assert same(pd.read_recording(damaged, None, '/atomizer/state'), written)
        except RecordingError:
            refused += 1
    assert refused > 8


def test_flows_of_their_own_are_written_as_states_and_read_back(tmp_path):
    half = replace(straight_pass(5), trigger_flow=np.array([0.5, 0.0]))
    bag = write_pose_bag(tmp_path / 'half', half)
    assert same(pd.read_recording(bag, state_topic='/atomizer/state'), half)
    with open_bag(bag) as opened:
        assert opened.find('/atomizer/state').type == STATE_TYPE

"""Triggers in any message of a bag, of types that only the bag defines."""

from dataclasses import replace

import numpy as np
import pytest

from files.recorded import Messages, pose_entries, straight_pass, write_bag
from paint_deposition.errors import RecordingError
from paint_deposition.files.motion_files import read_recording
from paint_deposition.files.recordings.bags import write_pose_bag

IO = 'cell_msgs/msg/Io'
TYPES = {
    'cell_msgs/msg/Valve': 'bool open\nfloat64 pressure_bar\nstring label\n',
    IO: 'int32[] states\nfloat64 level\nuint8 word\ncell_msgs/Valve[2] valves\n',
    'cell_msgs/msg/Stamped': 'std_msgs/Header header\nint16 brush\n',
}
PASS = straight_pass(triggers=False)
# The gun opens with the 10th pose and closes with the 40th.
ON = np.zeros(len(PASS), dtype=bool)
ON[10:40] = True


@pytest.fixture(scope='module')
def messages():
    return Messages(state_types=TYPES)


def io_message(messages, on: bool):
    types = messages.store.types
    valve = types['cell_msgs/msg/Valve']
    return types[IO](
        np.array([7, 0, 3, 5 if on else 0], np.int32), 23.8 if on else 0.4, 1 if on else 0,
        [valve(False, 0.0, 'off'), valve(on, 3.1 if on else np.nan, 'needle')],
    )  # fmt: skip


@pytest.fixture(scope='module')
def bag(messages, tmp_path_factory):
    """The pass, and the cell's signals at every pose, logged as the pose is stamped."""
    types = messages.store.types
    entries = pose_entries(PASS)
    for stamp, on in zip(PASS.stamps_ns.tolist(), ON.tolist(), strict=True):
        brush = types['cell_msgs/msg/Stamped'](messages.header(stamp), 2 if on else 0)
        entries += [
            ('/io', stamp, io_message(messages, on)),
            ('/brush', stamp + 7_000_000_000, brush),
            ('/valve/pressure', stamp, types['std_msgs/msg/Float64'](3.0 if on else 0.0)),
            ('/closed', stamp, types['std_msgs/msg/Int32'](0 if on else 1)),
        ]
    folder = tmp_path_factory.mktemp('cell') / 'run'
    return write_bag(folder, entries, 'sqlite3', messages)


def openings(trajectory) -> np.ndarray:
    """The flow at each pose."""
    rows = np.searchsorted(trajectory.trigger_stamps_ns, PASS.stamps_ns, side='right') - 1
    return trajectory.trigger_flow[rows] > 0.0


@pytest.mark.parametrize(
    ('trigger', 'said'),
    [
        ('/io.states[3]', 'trigger /io.states[3] is 0 to 5: the gun is on where it is above 0'),
        ('/io.level > 12', 'trigger /io.level is 0.4 to 23.8: the gun is on where it is above 12'),
        ('/io.valves[1].open', 'trigger /io.valves[1].open is 0 to 1'),
        ('/valve/pressure', 'trigger /valve/pressure is 0 to 3'),
        ('/closed < 1', 'the gun is on where it is below 1'),
    ],
)
def test_a_number_in_any_field_opens_the_gun(trigger, said, bag):
    read = read_recording(bag, None, trigger)
    assert np.array_equal(openings(read), ON)
    (note,) = read.notes
    assert said in note


def test_values_that_are_no_number_are_left_out_and_counted(bag):
    read = read_recording(bag, state_topic='/io.valves[1].pressure_bar')
    assert len(read.trigger_flow) == ON.sum()
    assert '20 values that are no number are left out' in read.notes[0]


@pytest.mark.parametrize(
    ('trigger', 'words'),
    [
        ('/io', 'is cell_msgs/msg/Io; name one of its fields: /io.states[0] /io.states[1]'),
        ('/io.state[3]', "no number or Bool at .state[3]; did you mean '/io.states[3]'?"),
        ('/io.valves[1].label', 'no number or Bool at .valves[1].label'),
        ('/oi.word', 'has no topic /oi.word'),
        ('/io.level > 1e', "'1e' is no number"),
    ],
)
def test_a_field_that_is_not_there_is_refused_with_those_there_are(trigger, words, bag):
    with pytest.raises(RecordingError) as refused:
        read_recording(bag, state_topic=trigger)
    assert words in str(refused.value)


def test_the_run_of_a_part_keeps_the_order_in_which_its_states_came(tmp_path):
    stamps = PASS.stamps_ns[[0, 10]]
    told = replace(PASS, trigger_stamps_ns=stamps, trigger_flow=np.array([0.5, 1.0]))
    for custom_data, rows in ({'serial': '1'}, [0, 10]), ({}, []):
        bag = write_pose_bag(tmp_path / f'run_{len(rows)}', told, custom_data)
        read = read_recording(bag, state_topic='/atomizer/state')
        assert read.trigger_stamps_ns.tolist() == stamps.tolist()
        assert read.trigger_rows.tolist() == rows

"""Brushes in files: models, tables, robot programs and bags name them alike."""

from pathlib import Path

import pytest
import yaml

from brushes import SET_POINTS, two_brushes
from files.recorded import START_NS, Messages, pose_entries, straight_pass, write_bag
from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.errors import ModelError, RecordingError
from paint_deposition.files.model_file import read_model, write_model
from paint_deposition.files.motion_files import read_recording
from paint_deposition.files.provenance import model_digest

MODEL = two_brushes(effects=(EFFECTS['edge_build'].typical(),))
HEAD = 'x_m,y_m,z_m,qx,qy,qz,qw'
POSE = '0,0,0,1,0,0,0'


def test_brushes_are_written_and_read_back_without_loss(tmp_path: Path):
    path = tmp_path / 'model.yaml'
    write_model(path, MODEL)
    assert read_model(path) == MODEL
    content = yaml.safe_load(path.read_text())
    assert 'planar' not in content
    assert content['brushes'] == {
        brush.number: {'planar': brush.planar.model_dump(), **SET_POINTS[brush.number]}
        for brush in MODEL.brushes
    }
    assert all('#' in line for line in path.read_text().splitlines() if ': ' in line)
    other = MODEL.of_brushes(
        [*MODEL.brushes[:1], MODEL.brushes[1].model_copy(update={'solids': 0.5})],
        effects=MODEL.effects,
    )
    assert model_digest(other) != model_digest(MODEL) == model_digest(read_model(path))


@pytest.mark.parametrize(
    ('text', 'message'),
    [
        ('brushes: {}', 'brushes is empty; give a brush by its number, or planar'),
        ('brushes: {0: {planar: {}}}', 'brushes: 0 is not a brush number; give 1, 2 and so on'),
        ('brushes: {1: 3}', 'brushes, 1 is 3; expected the keys '),
        ('brushes: {1: {planer: {}}}', "brushes, 1: unknown key 'planer'; did you mean 'planar'?"),
        ('brushes: {1: {planar: {}, solids: 45}}', 'brushes, 1: solids is 45; expected a number'),
        ('brushes: {1: {planar: {K2: 2}}}', 'brushes, 1: planar: K2 is 2; expected a number 0 '),
        ('brushes: {1: {solids: 0.4}}', 'brushes, 1: planar is missing; calibrate the brush, or'),
        ('planar: {}\nbrushes: {1: {planar: {}}}', 'planar and brushes are both given; keep one'),
    ],
)
def test_what_is_no_brush_is_refused_in_one_line(tmp_path: Path, text, message):
    path = tmp_path / 'model.yaml'
    path.write_text(text)
    with pytest.raises(ModelError) as refused:
        read_model(path)
    assert str(refused.value).startswith(f'{path}: {message}')


def test_a_table_of_poses_names_the_brush_from_its_row_on(tmp_path: Path):
    path = tmp_path / 'poses.csv'
    path.write_text(
        f't,{HEAD},gun,brush\n0,{POSE},1,2\n0.1,{POSE},1,3\n0.2,{POSE},0,0\n0.3,{POSE},1,2\n'
    )
    read = read_recording(path)
    assert read.trigger_flow.tolist() == [1.0, 1.0, 0.0, 1.0]
    assert read.trigger_brush.tolist() == [2, 3, 0, 2]
    assert 'gun by gun, brush by brush' in read.notes[0]
    # Without a trigger the gun sprays throughout, with these brushes.
    path.write_text(f't,{HEAD},brush\n0,{POSE},2\n0.1,{POSE},3\n')
    assert [(flow, brush) for _, flow, brush in read_recording(path).triggers] == [(1, 2), (1, 3)]
    path.write_text(f't,{HEAD},brush\n0,{POSE},2\n0.1,{POSE},2.5\n')
    with pytest.raises(RecordingError, match=r'line 3: brush is 2\.5; give the number of a brush'):
        read_recording(path)


def test_a_programmed_table_takes_the_brush_of_each_move(tmp_path: Path):
    path = tmp_path / 'passes.csv'
    path.write_text(
        f'{HEAD},speed_m_per_s,spraying,brush\n'
        '0,0,0,1,0,0,0,1,0,0\n0.5,0,0,1,0,0,0,1,1,4\n1,0,0,1,0,0,0,1,1,9\n2,0,0,1,0,0,0,1,0,9\n'
    )
    assert read_recording(path).triggers == [
        (0, 1.0, 4), (500_000_000, 1.0, 9), (1_000_000_000, 0.0, 9)
    ]  # fmt: skip


def test_states_recorded_before_they_had_a_brush_are_of_the_only_one(tmp_path: Path):
    messages = Messages()
    assert 'brush' not in messages.store.fielddefs['paint_msgs/msg/AtomizerState'][1]
    entries = pose_entries(straight_pass(triggers=False))
    entries.insert(1, ('/state', START_NS + 1, messages.state(START_NS, True, 0.8)))
    bag = write_bag(tmp_path / 'old', entries)
    assert read_recording(bag, None, '/state').triggers == [(START_NS, 0.8, 0)]

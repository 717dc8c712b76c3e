"""Another part comes into the cell: a new film, a new run, and nothing of the old one lost."""

import json
import shutil
import time
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from paint_msgs.srv import ChangePart
from rcl_interfaces.msg import SetParametersResult
from rclpy.lifecycle import TransitionCallbackReturn

import paint_deposition as pd
from brushes import two_brushes
from nodes.cell import PANEL_M, offline_um, parameters, saved_um, two_passes, write_panel
from paint_deposition.errors import PaintError
from paint_deposition.files.recordings.bag_files import open_bag
from paint_deposition.film.common_film import LiveFilms
from paint_deposition.model.eq1_pattern import Brush
from paint_deposition.nodes.node import ERROR, OK
from paint_deposition.nodes.topics import AdaptiveSubscription
from paint_deposition.nodes.web_view import WebView

LATER_NS = 60_000_000_000
OPEN = two_passes(poses=300)
# The gun is off when the part leaves.
MOTION = replace(
    OPEN, trigger_flow=np.append(OPEN.trigger_flow, 0.0),
    trigger_stamps_ns=np.append(OPEN.trigger_stamps_ns, OPEN.stamps_ns[-1]),
)  # fmt: skip
WITHOUT_TRIGGER = two_passes(poses=300, trigger=False)


def later(motion: pd.Trajectory) -> pd.Trajectory:
    return replace(
        motion,
        stamps_ns=motion.stamps_ns + LATER_NS,
        trigger_stamps_ns=motion.trigger_stamps_ns + LATER_NS,
    )


@pytest.fixture
def begin(onlooker, asked):
    """`begin(**fields)`: the future of the simulator's answer, whoever spins."""
    return partial(asked, onlooker(), ChangePart, '/deposition_simulator/change_part')


@pytest.fixture
def change(onlooker, call):
    """`change(**fields)`: the answer of the simulator."""
    return partial(call, onlooker(), ChangePart, '/deposition_simulator/change_part')


@pytest.fixture
def wider(tmp_path):
    """The mesh of another part."""
    return str(write_panel(tmp_path / 'wider.stl', scale=1.3))


def test_a_film_goes_on_from_the_recording_of_its_part_after_a_crash(
    record, simulator, robot, painted, change, wider, executor, wait_until
):
    """Poses are sent while there is no simulator, too."""
    recorder, node = record(), simulator()
    source = robot(node, recorder)
    assert change(serial='7').success
    wait_until(lambda: recorder.run.folder.name == '7', what='the run')
    source.send(MOTION, slice(0, 100))
    painted(node, 100)
    executor.remove_node(node)
    node.destroy_node()
    source.send(MOTION, slice(100, 150))
    sent_s, counts = time.monotonic(), recorder.run.counts
    wait_until(lambda: counts.get('/atomizer/pose') == 150 and time.monotonic() > sent_s + 1.0)
    run = str(recorder.run.folder)
    with pytest.raises(PaintError, match=r'is of .*panel\.stl with the part_pose none: give'):
        simulator(resume_from=run, mesh_file=wider)
    again = simulator(resume_from=run)
    wait_until(lambda: source.is_subscribed_by(again), what='the next simulator')
    source.send(MOTION, slice(150, None))
    assert np.array_equal(painted(again, len(MOTION)), offline_um(again, MOTION))
    assert (again.parts.part.serial, again.film.counts.rejected) == ('7', 0)
    wait_until(lambda: counts['/atomizer/pose'] == len(MOTION), what='all in the same run')


def test_each_part_has_its_film_and_its_run(
    simulator, robot, record, painted, change, wider, onlooker, wait_until, tmp_path
):
    """In one folder, if simulator and recorder have the same `output_directory`."""
    folder = tmp_path / 'films'
    node = simulator(part_pose=[0.0] * 6 + [1.0], part_parent_frame='cell')
    recorder = record(output_directory=str(folder), name='before')
    viewer = onlooker('part', 'thickness/stats')
    source = robot(node, recorder)
    motions, films = (MOTION, later(MOTION)), []
    for number, (motion, mesh) in enumerate(zip(motions, (node.mesh_file, wider), strict=True)):
        answer = change(serial=f'47-{number}', type='door', mesh_file=mesh)
        assert (answer.success, answer.run) == (True, f'47-{number}'), answer.message
        before = [str(folder / '47-0' / f'film.{end}') for end in ('ply', 'csv', 'json')]
        assert list(answer.paths) == (before if number else [])
        assert node.film.snapshot().film_um.max() == 0.0
        wait_until(lambda n=number: recorder.run.folder.name == f'47-{n}', what='the run')
        source.send(motion)
        films.append(painted(node, len(MOTION)))
        assert np.array_equal(films[-1], offline_um(node, motion))
        wait_until(lambda: recorder.run.counts.get('/atomizer/pose', 0) == len(MOTION))
    assert np.ptp(node.points.positions_m[:, 0]) == pytest.approx(1.3 * PANEL_M)
    wait_until(lambda: viewer.shows('part', lambda p: p.serial == '47-1'), what='the part')
    part = viewer.newest('part')
    assert (part.type, part.coat, part.mesh_file) == ('door', 1, wider)
    now = '47-1', len(MOTION)
    wait_until(lambda: viewer.shows('thickness/stats', lambda s: (s.run, s.poses_received) == now))
    recorder.close()
    node.close()
    for number, (motion, film) in enumerate(zip(motions, films, strict=True)):
        run = folder / f'47-{number}'
        recorded = pd.read_recording(run, None, '/atomizer/state')
        assert np.array_equal(recorded.stamps_ns, motion.stamps_ns)
        with open_bag(run) as bag:
            messages = {topic.name: topic.message_count for topic in bag.topics}
        # Where the part stands was published once, before the first of them.
        assert messages['/part'] == messages['/part_pose'] == 1
        # The second begins with the state in which the gun was left.
        assert messages['/atomizer/state'] == len(motion.triggers) + number
        assert messages['/thickness/field']
        told = (run / 'metadata.yaml').read_text()
        assert [w in told for w in (f'serial: 47-{number}', 'mesh_id', 'sha256')] == [1, 1, 0]
        assert saved_um(run / 'film.csv') == pytest.approx(film, rel=1e-7)
        figures = json.loads((run / 'film.json').read_text())
        described = {'serial': f'47-{number}', 'type': 'door', 'coat': 1}
        assert figures['part'].items() >= described.items()
        assert figures['poses']['received'] == len(MOTION)


def test_the_gun_and_its_brush_stay(simulated, painted, change, wider, wait_until, tmp_path):
    """Closed before a change, closed after it; the brush must be in a model that is set."""
    brushes = two_brushes()
    pd.write_model(tmp_path / 'brushes.yaml', brushes)
    other = pd.DepositionModel(brushes=[Brush(number=1, planar=brushes.planar)])
    pd.write_model(tmp_path / 'other.yaml', other)
    node, source = simulated(model_file=str(tmp_path / 'brushes.yaml'), repaint=False)
    source.send_state(WITHOUT_TRIGGER.stamps_ns[0], 1.0, brush=2)
    source.send(WITHOUT_TRIGGER)
    painted(node, len(WITHOUT_TRIGGER))
    assert change(serial='1', mesh_file=wider).success
    node.set_parameters(parameters(model_file=str(tmp_path / 'other.yaml')))
    wait_until(lambda: not node.repainting, what='the end of the trial')
    assert 'brush 2 is not in the model' in node.model_problem
    assert node.tasks['film']()[2]['model'] == str(tmp_path / 'brushes.yaml')
    source.send(later(WITHOUT_TRIGGER))
    assert painted(node, len(WITHOUT_TRIGGER)).max() > 1.0
    source.send_state(later(WITHOUT_TRIGGER).stamps_ns[-1], 0.0)
    assert change(serial='2').success
    source.send(later(later(WITHOUT_TRIGGER)))
    assert painted(node, len(WITHOUT_TRIGGER)).max() == 0.0


def test_meshes_are_read_once_for_each_shape_they_have(
    simulator, closed, change, wider, wait_until, tmp_path
):
    """Read ahead, or of a part that has left; one that was exported anew is read again."""
    node = simulator()
    page = closed(WebView, mesh_file=node.mesh_file, max_edge_length_m=0.05, port=0)
    first, third = node.mesh_file, str(write_panel(tmp_path / 'third.stl', reverse=True))
    prepared = change(mesh_file=third, prepare=True)
    assert (prepared.success, node.mesh_file) == (True, first)
    assert 'third.stl is prepared: Surface(' in prepared.message

    def ready() -> str:
        return node.parts.status()[2]['meshes prepared']

    assert ready() == third
    for serial, mesh, kept in (
        ('1', third, [first]), ('2', wider, [first, third]), ('3', first, [third, wider]),
    ):  # fmt: skip
        assert change(serial=serial, mesh_file=mesh).success
        assert ready().split() == kept
    # Under the name of the part in the cell, and of one that was there before.
    narrow = Path(first).read_bytes()
    shutil.copy(wider, first)
    assert change(serial='4').success
    wait_until(lambda: node.surface.mesh_id in page._mesh_ids, what='the page')
    assert np.ptp(node.points.positions_m[:, 0]) == pytest.approx(1.3 * PANEL_M)
    Path(first).write_bytes(narrow)
    assert change(serial='5', mesh_file=wider).success
    assert change(serial='6', mesh_file=first).success
    assert np.ptp(node.points.positions_m[:, 0]) == pytest.approx(PANEL_M)


def test_a_further_coat_lies_on_the_first(simulated, painted, change, tmp_path):
    node, source = simulated()
    assert 'coat: the part in the cell has no serial' in change(serial='A-1', coat=True).message
    assert change(serial='A-1').success
    source.send(MOTION)
    once = painted(node, len(MOTION))
    assert "serial 'A-1' is the part in the cell: set coat: true" in change(serial='A-1').message
    assert "coat: the part in the cell is 'A-1' of " in change(serial='A-2', coat=True).message
    same_mesh = node.mesh_file.replace('/panel', '/../' + tmp_path.name + '/panel')
    coat = change(serial='A-1', coat=True, mesh_file=same_mesh)
    assert (coat.success, coat.run) == (True, 'A-1_coat_2'), coat.message
    source.send(later(MOTION))
    assert painted(node, 2 * len(MOTION)) == pytest.approx(2.0 * once, rel=1e-5, abs=1e-6)
    assert change(serial='A-2').success
    files = [tmp_path / 'films' / run / 'film.json' for run in ('A-1', 'A-1_coat_2')]
    figures = [json.loads(file.read_text()) for file in files]
    assert [one['part']['coat'] for one in figures] == [1, 2]
    assert figures[1]['mean_um'] == pytest.approx(2.0 * figures[0]['mean_um'], rel=0.1)
    done_before = change(serial='A-1')
    assert not done_before.success
    assert 'A-1 already exists: a part has one run for each coat' in done_before.message


def test_what_cannot_be_is_refused_and_the_part_stays(simulated, painted, change, tmp_path):
    """A pose that is refused after the change costs no film."""
    node, source = simulated(part_parent_frame='cell')
    assert change(serial='1').success
    source.send(MOTION)
    film = painted(node, len(MOTION))
    for fields, message in (
        ({'serial': ''}, "serial '': use at most 200 letters"),
        ({'serial': '../4711'}, "serial '../4711': use at most 200"),
        ({'serial': '..'}, "serial '..': use at most"),
        ({'serial': '2', 'mesh_file': 'nowhere.stl'}, 'nowhere.stl: no such mesh file'),
        ({'serial': '2', 'part_pose': [0.0, 0.0, 0.0]}, 'part_pose'),
        ({'prepare': True}, 'prepare needs a mesh_file'),
    ):
        answer = change(**fields)
        assert not answer.success
        assert message in answer.message
    assert np.array_equal(node.film.snapshot().film_um, film)
    assert not (tmp_path / 'films').exists()
    refused = SetParametersResult(successful=False, reason='not now')
    node.add_on_set_parameters_callback(lambda changes: refused)
    answer = change(serial='2', part_pose=[0.0] * 6 + [1.0])
    assert (answer.success, answer.run) == (False, '2')
    assert 'it stands where the part before did: not now' in answer.message
    assert saved_um(tmp_path / 'films/1/film.csv') == pytest.approx(film, rel=1e-7)


def test_a_film_is_kept_until_it_is_on_disk(simulated, painted, change, tmp_path):
    """The node stays as it is; the part changes all the same, and the answer says both."""
    folder = tmp_path / 'films'
    node, source = simulated(part_parent_frame='cell')
    assert change(serial='1').success
    source.send(MOTION)
    film = painted(node, len(MOTION))
    folder.write_text('in the way, as a disk that is full')
    node.trigger_deactivate()
    for _ in range(2):
        assert node.trigger_cleanup() == TransitionCallbackReturn.FAILURE
    assert node.configured
    unsaved = 'films of 1 former parts are not saved'
    assert unsaved in node.parts.status()[1]
    node.trigger_activate()
    second = change(serial='2')
    assert (second.success, second.run, second.paths) == (True, '2', [])
    assert f'{unsaved}, and kept' in second.message
    assert node.parts.status()[0] == ERROR
    folder.unlink()
    source.send(later(MOTION))
    painted(node, len(MOTION))
    third = change(serial='3')
    assert [Path(path).parent.name for path in third.paths] == 3 * ['1'] + 3 * ['2']
    assert saved_um(folder / '1/film.csv') == pytest.approx(film, rel=1e-7)
    assert node.parts.status()[0] == OK
    # Who shuts the node down is told of the film that is lost.
    source.send(later(later(MOTION)))
    painted(node, len(MOTION))
    shutil.rmtree(folder)
    folder.write_text('in the way')
    assert node.trigger_shutdown() == TransitionCallbackReturn.FAILURE
    assert not node.configured
    assert 'films of 1 former parts are not saved' in node.tasks['state']()[1]


@pytest.mark.parametrize(('pose', 'frame'), [([], 'part'), ([0.0] * 6 + [1.0], 'cell')])
def test_a_change_that_fails_is_none(simulated, painted, begin, wait_until, tmp_path, pose, frame):
    """Pose and poses that came meanwhile are left to the old part."""
    node, source = simulated(part_pose=pose, part_parent_frame='cell')
    large, broken = write_panel(tmp_path / 'large.stl', scale=8.0), tmp_path / 'broken.stl'
    broken.write_text('no mesh')
    # The broken mesh is looked at after the large one.
    begin(prepare=True, mesh_file=str(large))
    aside = [0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]
    future = begin(serial='1', mesh_file=str(broken), part_pose=aside)
    wait_until(lambda: node.parts.changing, what='the request')
    assert node.trigger_deactivate() == TransitionCallbackReturn.FAILURE
    refused = node.reset()
    assert not refused.success
    assert refused.message == 'the part is being changed: call again after it'
    source.send(MOTION, frame_id=frame)
    wait_until(future.done, what='the answer')
    assert not future.result().success
    assert list(node.values['part_pose']) == pose
    film, expected = painted(node, len(MOTION)), offline_um(node, MOTION)
    assert np.abs(film - expected).max() <= 1e-6 * expected.max()


def test_each_run_is_of_its_part_though_the_gun_stays_open_while_a_mesh_is_read(
    simulator, robot, painted, change, begin, record, wider, wait_until, tmp_path
):
    """Two states are sent early, the robot's clock is ahead, the part between has no poses."""
    ahead_ns = time.time_ns() + 60 * LATER_NS - WITHOUT_TRIGGER.stamps_ns[0]
    moved = replace(WITHOUT_TRIGGER, stamps_ns=WITHOUT_TRIGGER.stamps_ns + ahead_ns)
    node = simulator(max_edge_length_m=0.015, part_parent_frame='cell')
    recorder = record(output_directory=str(tmp_path / 'films'), name='before')
    source = robot(node, recorder)
    half = len(moved) // 2
    for row, flow in ((0, 1.0), (half + 50, 0.0), (half + 90, 0.5)):
        source.send_state(moved.stamps_ns[row], flow)
    source.send(moved, slice(0, half))
    film = painted(node, half)
    before = SimpleNamespace(points=node.points, surface=node.surface)
    assert change(serial='0').success
    future = begin(serial='1', mesh_file=wider, part_pose=[0.0] * 6 + [1.0])
    wait_until(lambda: node.parts.changing, what='the request')
    source.send(moved, slice(half, None), frame_id='cell')
    wait_until(future.done, what='the change')
    second = painted(node, len(moved) - half)
    wait_until(lambda: recorder.run.counts.get('/atomizer/pose') == half, what='the run')
    recorder.close()
    for run, live, of in (('before', film, before), ('1', second, node)):
        motion = pd.read_recording(tmp_path / 'films' / run, state_topic='/atomizer/state')
        assert len(motion) == half
        assert np.array_equal(offline_um(of, motion), live)
    assert second.max() > 1.0


def test_a_pose_during_a_reset_is_of_the_run_that_begins(simulated, painted, change, monkeypatch):
    (node, source), reset = simulated(), LiveFilms.reset
    assert change(serial='1').success
    source.send(WITHOUT_TRIGGER, slice(0, 10))
    painted(node, 10)

    def meanwhile(film: LiveFilms) -> None:
        reset(film)
        source.send(WITHOUT_TRIGGER, slice(10, 11))

    monkeypatch.setattr(LiveFilms, 'reset', meanwhile)
    node.reset()
    painted(node, 1)
    assert node.parts.part.run == '1_reset_1'
    # The recorder goes by that.
    assert node.parts.part.last_sent_ns < node.inputs[0].sent_ns


@pytest.mark.parametrize('placed', [True, False])
def test_poses_that_wait_are_of_their_part(simulator, robot, painted, begin, wait_until, placed):
    """The change waits for them; without a transform they are refused on their own part."""
    node = simulator()
    # A cell in which transforms may come.
    transforms = AdaptiveSubscription(node, PoseStamped, 'tf_of_another_kind', print, depth=1)
    node.frame.tf_topics.append(transforms)
    source = robot(node)
    source.send(MOTION, frame_id='cell')
    wait_until(lambda: len(node.inputs[0].tf_queue) == len(MOTION), what='poses that wait')
    future = begin(serial='1')
    wait_until(lambda: node.parts.changing, what='the request')
    source.send(later(MOTION))
    if placed:
        node.frame.tree.place('part', 'cell', [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
    wait_until(future.done, what='the change')
    answer = future.result()
    assert answer.success, answer.message
    if placed:
        figures = json.loads(Path(answer.paths[2]).read_text())
        assert figures['poses']['received'] == len(MOTION)
        assert saved_um(answer.paths[1]) == pytest.approx(offline_um(node, MOTION), rel=1e-7)
    else:
        assert not answer.paths
    assert np.array_equal(painted(node, len(MOTION)), offline_um(node, later(MOTION)))

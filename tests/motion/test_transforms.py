"""Where the part is: in the frame of the poses, by touched points, along a tree of frames."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from paint_deposition.errors import RecordingError
from paint_deposition.motion.transforms import (
    LONGEST_GAP_NS,
    FrameTree,
    NoTransform,
    Rigid,
    is_frame,
)
from paint_deposition.planning.part_places import locate
from paint_deposition.request import is_pose


def random_poses(count: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(3)
    return rng.normal(size=(count, 3)), Rotation.random(count, random_state=4).as_quat()


def test_transforms_agree_with_scipy_one_by_one_and_chained():
    positions, quaternions = random_poses(20)
    quaternions *= 1.003  # screening is to see what was recorded
    turn = Rotation.random(random_state=9)
    place = Rigid.of([0.3, -2.0, 1.1, *turn.as_quat()])
    moved, turned = place.applied(positions, quaternions)
    assert np.allclose(moved, turn.apply(positions) + np.array([0.3, -2.0, 1.1]), atol=1e-14)
    expected = (turn * Rotation.from_quat(quaternions)).as_matrix()
    assert np.allclose(Rotation.from_quat(turned).as_matrix(), expected, atol=1e-14)
    assert np.allclose(np.linalg.norm(turned, axis=1), 1.003, atol=1e-14)
    a = Rigid.of([1.0, 0.0, -2.0, *Rotation.random(random_state=1).as_quat()])
    b = Rigid.of([0.2, 0.5, 0.0, *Rotation.random(random_state=2).as_quat()])
    poses = random_poses(5)
    assert np.allclose((a @ a.inverse()).values, [0, 0, 0, 0, 0, 0, 1], atol=1e-15)
    chained, stepwise = (a @ b).applied(*poses), a.applied(*b.applied(*poses))
    assert np.allclose(chained[0], stepwise[0], atol=1e-14)
    assert np.allclose(chained[1], stepwise[1], atol=1e-14)
    # So the film of a node, which takes poses one by one, is that of the offline command.
    positions, quaternions = random_poses(50)
    place = Rigid.of([0.3, -2.0, 1.1, *Rotation.random(random_state=9).as_quat()]).inverse()
    together = place.applied(positions, quaternions)
    alone = [place.applied(*pose) for pose in zip(positions, quaternions, strict=True)]
    assert np.array_equal(together[0], [position for position, _ in alone])
    assert np.array_equal(together[1], [quaternion for _, quaternion in alone])


def test_seven_numbers_are_a_pose_and_frames_the_same_with_or_without_a_slash():
    place = [0.0] * 6
    assert is_pose([*place, 1.009])
    for bad in ([*place, 1.02], [0, 0, 0, 0, 0, 1], [np.nan, *place[1:], 1.0]):
        assert not is_pose(bad)
    for one, other in (('/part', 'part'), ('part', '/part'), ('', 'part')):
        assert is_frame(one, other)
    assert not is_frame('base_link', 'part')


POSE = Rigid.of([2.1, -0.4, 0.9, *Rotation.from_euler('ZYX', [1.9, 0.3, -0.2]).as_quat()])
POINTS = {
    'P1': np.array([0.0, 0.0, 0.0]), 'P2': np.array([1.1, 0.0, 0.02]),
    'P3': np.array([1.05, 0.1, 0.7]), 'P4': np.array([0.1, 0.08, 0.65]),
    'P5': np.array([0.5, -0.05, 0.3]),
}  # fmt: skip


def touched(noise_m: float = 0.0, *names: str) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(2)
    at = {name: POINTS[name] for name in names or POINTS}
    moved = POSE.applied(np.array(list(at.values())), np.tile([0.0, 0, 0, 1], (len(at), 1)))[0]
    return dict(zip(at, moved + noise_m * rng.normal(size=moved.shape), strict=True))


def apart(pose: Rigid) -> tuple[float, float]:
    """How far from where the part stands [m, rad]."""
    off = POSE.inverse() @ pose
    turned = Rotation.from_quat(off.quaternion_xyzw).magnitude()
    return float(np.linalg.norm(off.translation_m)), float(turned)


@pytest.mark.parametrize('names', [(), ('P1', 'P2', 'P4')])
def test_exact_points_give_the_pose(names):
    place = locate(touched(0.0, *names), POINTS)
    assert max(apart(Rigid.of(place['part_pose']))) < 1e-12
    assert place['rms_m'] < 1e-12
    assert list(place['residuals_m']) == list(names or POINTS)
    assert place['warnings'] == []


def test_noise_of_a_probe_shows_in_the_residuals_and_points_that_fix_no_pose_are_refused():
    """0.3 mm on each axis: about 0.3 mm times the root of 3, less what the fit takes."""
    place = locate(touched(0.3e-3), POINTS)
    assert apart(Rigid.of(place['part_pose']))[0] < 1e-3
    assert 0.2e-3 < place['rms_m'] < 0.6e-3
    assert place['rms_m'] ** 2 == pytest.approx(
        np.mean(np.square([*place['residuals_m'].values()]))
    )
    assert place['warnings'] == []
    with pytest.raises(RecordingError, match='2 points in common'):
        locate({'P1': POINTS['P1'], 'P2': POINTS['P2'], 'Q': POINTS['P3']}, POINTS)
    line = {f'L{k}': np.array([0.3 * k, 0.1 * k, 0.001 * (k == 1)]) for k in range(4)}
    with pytest.raises(RecordingError, match='lie on a line'):
        locate(line, line)


@pytest.mark.parametrize(
    'spoilt',
    [
        lambda name, at: at + np.array([0.0, 0.03 * (name == 'P3'), 0.0]),
        lambda name, at: at * [1.0, -1.0, 1.0],
        lambda name, at: 1000.0 * at,
    ],
)
def test_points_that_do_not_fit_are_warned_of(spoilt):
    """A point off by 30 mm, a mirrored frame, millimetres among metres."""
    points = {name: spoilt(name, at) for name, at in touched(0.1e-3).items()}
    place = locate(points, POINTS)
    (warning,) = place['warnings']
    worst = max(place['residuals_m'], key=place['residuals_m'].get)
    assert warning.startswith(f'the points do not fit, {worst} is off by')


STEP_NS = 100_000_000
CAMERA = [0.3, -0.2, 0.7, *Rotation.from_euler('xyz', [0.3, 0.5, 0.7]).as_quat()]


def on_conveyor(stamp_ns: int) -> list[float]:
    """Goes along x at 0.2 m/s and turns evenly."""
    turn = Rotation.from_euler('z', 0.6e-9 * stamp_ns)
    return [0.2e-9 * stamp_ns, 0.3, 0.5, *turn.as_quat()]


@pytest.fixture(params=[False, True])
def tree(request):
    tree = FrameTree(live=request.param)
    tree.fix('camera', '/world', CAMERA)
    for row in range(11):
        tree.add('part', 'world', row * STEP_NS, on_conveyor(row * STEP_NS))
    return tree


@pytest.mark.parametrize('stamp', [3 * STEP_NS, 3 * STEP_NS + 37_000_000])
def test_a_pose_is_the_product_along_the_tree_at_its_time(tree, stamp):
    expected = Rigid.of(on_conveyor(stamp)).inverse() @ Rigid.of(CAMERA)
    found = tree.lookup('/camera', 'part', stamp)
    assert np.allclose(found.values, expected.values, atol=1e-12)
    assert np.allclose((found @ tree.lookup('part', 'camera', stamp)).translation_m, 0.0)
    assert tree.moving_between('camera', 'part') == {'part'}


@pytest.mark.parametrize(
    ('frame', 'stamp', 'may_come', 'words'),
    [
        ('world', 11 * STEP_NS, True, 'the newest of tf is of 1.000 s'),
        ('world', -STEP_NS, False, 'the first of tf is of 0.000 s'),
        ('base', 0, True, "no transforms connect 'base' to 'part'"),
    ],
)
def test_what_is_not_known_is_refused_and_may_come(tree, frame, stamp, may_come, words):
    with pytest.raises(NoTransform) as refused:
        tree.lookup(frame, 'part', stamp)
    assert words in str(refused.value)
    assert refused.value.may_come == may_come


def test_nothing_is_guessed_across_a_gap(tree):
    after = 10 * STEP_NS + LONGEST_GAP_NS
    tree.add('part', 'world', after, on_conveyor(after))
    tree.lookup('world', 'part', after - 1)
    tree.add('part', 'world', 2 * after + 1, on_conveyor(after))
    with pytest.raises(NoTransform, match='tf has none for 3'):
        tree.lookup('world', 'part', after + 1)


def test_where_the_user_places_a_part_goes_before_transforms_and_each_parent_at_its_time(tree):
    tree.place('part', 'world', CAMERA)
    assert np.allclose(tree.lookup('camera', 'part').values, [0, 0, 0, 0, 0, 0, 1])
    tree.place('part', 'world', [])
    assert tree.moving_between('camera', 'part') == {'part'}
    tree.add('part', 'gripper', 12 * STEP_NS, CAMERA)
    before = tree.lookup('part', 'world', 11 * STEP_NS)
    assert before.values == pytest.approx(on_conveyor(10 * STEP_NS))
    tree.fix('gripper', 'world', CAMERA)
    handed = Rigid.of(CAMERA) @ Rigid.of(CAMERA)
    assert tree.lookup('part', 'world', 12 * STEP_NS).values == pytest.approx(handed.values)


def test_a_live_stream_that_begins_again_forgets_what_was_before_one_late_transform_nothing():
    for steps, begins in (((50, 51, 0, 1, 2), 3), ((50, 51, 30, 52, 31), None)):
        tree, stamps = FrameTree(live=True), [STEP_NS * step for step in steps]
        restarted = [tree.add('part', 'world', stamp, on_conveyor(stamp)) for stamp in stamps]
        assert restarted == [row == begins for row in range(5)]
        assert tree.stamps_ns('part') == (stamps[2:] if begins else sorted(stamps))

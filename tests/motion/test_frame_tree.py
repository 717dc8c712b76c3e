"""Where frames are in one another: along the tree, over time, and where nothing is known."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from paint_deposition.motion.frame_tree import LONGEST_GAP_NS, FrameTree, NoTransform
from paint_deposition.motion.part_frame import Rigid

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
    assert tree.connected('world') == ['camera']


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


def test_where_the_user_places_a_part_goes_before_transforms(tree):
    tree.place('part', 'world', CAMERA)
    assert np.allclose(tree.lookup('camera', 'part').values, [0, 0, 0, 0, 0, 0, 1])
    tree.place('part', 'world', [])
    assert tree.moving_between('camera', 'part') == {'part'}


def test_a_live_stream_that_begins_again_forgets_what_was_before():
    tree = FrameTree(live=True)
    for start in (50 * STEP_NS, 0):
        restarted = [tree.add('part', 'world', start + s, on_conveyor(s)) for s in (0, STEP_NS)]
        assert restarted == [start == 0, False]
    assert tree.stamps_ns('part') == [0, STEP_NS]


def test_a_part_that_is_handed_over_has_each_parent_at_its_time(tree):
    tree.add('part', 'gripper', 12 * STEP_NS, CAMERA)
    assert tree.lookup('part', 'world', 11 * STEP_NS).values == pytest.approx(
        on_conveyor(10 * STEP_NS)
    )
    tree.fix('gripper', 'world', CAMERA)
    handed = Rigid.of(CAMERA) @ Rigid.of(CAMERA)
    assert tree.lookup('part', 'world', 12 * STEP_NS).values == pytest.approx(handed.values)

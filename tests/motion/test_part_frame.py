"""Poses brought to the part: the transform itself, and that it is a rigid one."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from paint_deposition.motion.part_frame import Rigid, is_frame, is_pose


def random_poses(count: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(3)
    return rng.normal(size=(count, 3)), Rotation.random(count, random_state=4).as_quat()


def test_transforms_agree_with_scipy_and_keep_the_norm_of_quaternions():
    positions, quaternions = random_poses(20)
    quaternions *= 1.003  # screening is to see what was recorded
    turn = Rotation.random(random_state=9)
    place = Rigid.of([0.3, -2.0, 1.1, *turn.as_quat()])
    moved, turned = place.applied(positions, quaternions)
    assert np.allclose(moved, turn.apply(positions) + np.array([0.3, -2.0, 1.1]), atol=1e-14)
    expected = (turn * Rotation.from_quat(quaternions)).as_matrix()
    assert np.allclose(Rotation.from_quat(turned).as_matrix(), expected, atol=1e-14)
    assert np.allclose(np.linalg.norm(turned, axis=1), 1.003, atol=1e-14)


def test_one_pose_comes_out_as_among_others():
    """So the film of a node, which takes poses one by one, is that of the offline command."""
    positions, quaternions = random_poses(50)
    place = Rigid.of([0.3, -2.0, 1.1, *Rotation.random(random_state=9).as_quat()]).inverse()
    together = place.applied(positions, quaternions)
    alone = [place.applied(*pose) for pose in zip(positions, quaternions, strict=True)]
    assert np.array_equal(together[0], [position for position, _ in alone])
    assert np.array_equal(together[1], [quaternion for _, quaternion in alone])


def test_the_inverse_undoes_and_products_chain():
    a = Rigid.of([1.0, 0.0, -2.0, *Rotation.random(random_state=1).as_quat()])
    b = Rigid.of([0.2, 0.5, 0.0, *Rotation.random(random_state=2).as_quat()])
    poses = random_poses(5)
    assert np.allclose((a @ a.inverse()).values, [0, 0, 0, 0, 0, 0, 1], atol=1e-15)
    chained, stepwise = (a @ b).applied(*poses), a.applied(*b.applied(*poses))
    assert np.allclose(chained[0], stepwise[0], atol=1e-14)
    assert np.allclose(chained[1], stepwise[1], atol=1e-14)


@pytest.mark.parametrize(
    ('values', 'good'),
    [
        ([0, 0, 0, 0, 0, 0, 1.009], True), ([0, 0, 0, 0, 0, 0, 1.02], False),
        ([0, 0, 0, 0, 0, 1], False), ([np.nan, 0, 0, 0, 0, 0, 1], False),
    ],
)  # fmt: skip
def test_seven_numbers_with_a_unit_quaternion_are_a_pose(values, good):
    assert is_pose(values) is good


def test_frames_are_the_same_with_or_without_a_slash():
    assert is_frame('/part', 'part')
    assert is_frame('part', '/part')
    assert is_frame('', 'part')
    assert not is_frame('base_link', 'part')

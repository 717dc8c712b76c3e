"""A six-axis arm of our own: `arm.urdf`, and its tip by the product of exponentials.

The arm stands upright: base, shoulder, elbow and a wrist whose three axes meet. The URDF gives
each joint in the frame of the one before; the poses come from the axes of the whole arm at rest.
"""

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

# With `base_link` on the floor and `tool0` at the bell.
URDF = Path(__file__).with_name('arm.urdf')
# Joint: place of its axis at rest [m], direction of the axis.
AXES = {
    'shoulder_pan': ((0.0, 0.0, 0.40), (0, 0, 1)), 'shoulder_lift': ((0.15, 0.0, 0.40), (0, 1, 0)),
    'elbow': ((0.15, 0.0, 1.10), (0, 1, 0)), 'forearm_roll': ((0.65, 0.0, 1.20), (1, 0, 0)),
    'wrist_bend': ((0.95, 0.0, 1.20), (0, 1, 0)), 'wrist_roll': ((1.05, 0.0, 1.20), (1, 0, 0)),
}  # fmt: skip
JOINTS = tuple(AXES)
# At rest the bell looks along +x: its z, by a quarter turn about y.
TIP_M = np.array([1.20, 0.0, 1.20])
TIP = Rotation.from_matrix([[0, 0, 1], [0, 1, 0], [-1, 0, 0]])


def tip_poses(joints_rad: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions (N, 3) and quaternions (N, 4) of the bell in `base_link` for joints (N, 6)."""
    position = np.tile(TIP_M, (len(joints_rad), 1))
    turn = Rotation.from_quat(np.tile(TIP.as_quat(), (len(joints_rad), 1)))
    # From the wrist inward, each joint turns what hangs on it about its axis at rest.
    for (place_m, axis), angle in reversed(
        list(zip(AXES.values(), np.asarray(joints_rad).T, strict=True))
    ):
        about = Rotation.from_rotvec(np.outer(angle, axis))
        position = about.apply(position - np.array(place_m)) + np.array(place_m)
        turn = about * turn
    return position, turn.as_quat()


def sweep(count: int = 151) -> np.ndarray:
    """Joints (N, 6) of a pass: the arm swings to the side, the wrist sways a little."""
    share = np.linspace(-1.0, 1.0, count)
    columns = {
        'shoulder_pan': 0.25 * share, 'shoulder_lift': 0.1 + 0.02 * share, 'elbow': -0.05 * share,
        'forearm_roll': 0.1 * share**2, 'wrist_bend': 0.03 * share - 0.1,
        'wrist_roll': 0.3 * share,
    }  # fmt: skip
    return np.stack([columns[name] + 0.0 * share for name in JOINTS], axis=1)

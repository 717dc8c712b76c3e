"""The kinematic chain of a robot: where its tip is, and how its joints move it."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Arm:
    """J joints from a base to a tip."""

    joints: tuple[str, ...]  # their names
    # (J + 1, 4, 4) each joint at zero in the moved frame of the one before it, the first in the
    # base; the last is the tip in the frame of the last joint.
    frames: np.ndarray
    axes: np.ndarray  # (J, 3) unit axis of each joint in its frame
    slides: np.ndarray  # (J,) bool, whether it moves along its axis instead of turning about it
    lower: np.ndarray  # (J,) limits [rad or m], infinite where there are none, and upper (J,)
    upper: np.ndarray
    fastest: np.ndarray  # (J,) greatest speeds [rad/s or m/s], infinite where none is known

    def __len__(self) -> int:
        return len(self.joints)

    def room(self, values: np.ndarray) -> np.ndarray:
        """(..., J) distance of joints (..., J) from the nearer limit, as a share of the range."""
        nearer = np.minimum(values - self.lower, self.upper - values)
        span = self.upper - self.lower
        return np.where(np.isfinite(span), nearer / span, 1.0)

    def tips(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions (..., 3) [m] and axes (..., 3, 3) of the tip for joints (..., J)."""
        position, axes, _, _ = self._chain(np.asarray(values, dtype=float))
        return position, axes

    def jacobians(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Positions and axes of the tip, and its velocity (..., 6, J) per speed of each joint.

        The rows are the velocity of the tip and its rate of turn, in the base's frame.
        """
        position, axes, along, origin = self._chain(np.asarray(values, dtype=float))
        turning = np.cross(along, position[..., np.newaxis, :] - origin)
        slides = self.slides[:, np.newaxis]
        moved = np.where(slides, along, turning)
        turned = np.where(slides, 0.0, along)
        return position, axes, np.concatenate([moved, turned], axis=-1).swapaxes(-1, -2)

    def _chain(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Tip as in ``tips``; axes (..., J, 3) and places (..., J, 3) of the joints."""
        shape = values.shape[:-1]
        position, turn = np.zeros((*shape, 3)), np.broadcast_to(np.eye(3), (*shape, 3, 3))
        along, origin = np.empty((*values.shape, 3)), np.empty((*values.shape, 3))
        for j, frame in enumerate(self.frames):
            position = position + turn @ frame[:3, 3]
            turn = turn @ frame[:3, :3]
            if j == len(self):
                break
            along[..., j, :], origin[..., j, :] = turn @ self.axes[j], position
            value = values[..., j]
            if self.slides[j]:
                position = position + value[..., np.newaxis] * along[..., j, :]
            else:
                # (..., 3, 3) rotations about the axis (Rodrigues).
                x, y, z = self.axes[j]
                cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
                sin, cos = np.sin(value)[..., None, None], np.cos(value)[..., None, None]
                turn = turn @ (np.eye(3) + sin * cross + (1.0 - cos) * (cross @ cross))
        return position, turn, along, origin

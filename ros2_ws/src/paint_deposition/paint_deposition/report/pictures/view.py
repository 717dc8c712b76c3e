"""From where a picture shows a part: from the gun's side, gravity down."""

from dataclasses import dataclass

import numpy as np

from paint_deposition.part.orientation import downhill_axis

# A view this close to an axis of the mesh is along it and has the mesh's coordinates.
SNAP_COSINE = 0.9


@dataclass(frozen=True)
class View:
    """Directions of a picture in the mesh frame, unit vectors: right, up, and to the viewer."""

    right: np.ndarray
    up: np.ndarray
    toward: np.ndarray
    labels: tuple[str, str]  # names of the axes to the right and up

    @staticmethod
    def of_front(outward: np.ndarray, down: np.ndarray) -> 'View':
        """Along the mean normal, gravity downward; along the mesh's axes where it nearly is."""
        toward, down = _snapped(outward), _snapped(down)
        up = -down + (down @ toward) * toward
        if np.linalg.norm(up) < 0.1:  # a part seen from straight above, a hood: its front below
            up = -_snapped(downhill_axis(outward, down))
            up = up - (up @ toward) * toward
        up /= np.linalg.norm(up)
        right = np.cross(up, toward)
        return View(right, up, toward, (_name(right, 'right'), _name(up, 'up')))

    def from_the_right(self) -> 'View':
        """The same part seen from the right of this picture."""
        return View(
            -self.toward, self.up, self.right, (_name(self.toward, 'away'), self.labels[1])
        )

    def from_above(self) -> 'View':
        """The same part seen from the top of this picture, its front below."""
        return View(
            self.right, -self.toward, self.up, (self.labels[0], _name(self.toward, 'away'))
        )

    def flat(self, points_m: np.ndarray) -> np.ndarray:
        """(..., 2) where points (..., 3) lie in the picture [m]."""
        return np.stack([points_m @ self.right, points_m @ self.up], axis=-1)


def _snapped(direction: np.ndarray) -> np.ndarray:
    largest = np.abs(direction).argmax()
    if abs(direction[largest]) < SNAP_COSINE:
        return direction
    return np.sign(direction[largest]) * np.eye(3)[largest]


def _name(direction: np.ndarray, otherwise: str) -> str:
    along = np.isclose(np.abs(direction), 1.0, atol=1e-9)
    return f'{"xyz"[along.argmax()] if along.any() else otherwise} [m]'

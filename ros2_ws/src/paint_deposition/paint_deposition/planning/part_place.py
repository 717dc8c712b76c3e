"""Where a part may stand so that a robot drives a whole motion over it."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.ndimage import minimum_filter

from paint_deposition.errors import PlanError
from paint_deposition.motion.part_frame import Rigid
from paint_deposition.motion.trajectory import Trajectory
from paint_deposition.planning.driving import RobotCell


@dataclass(frozen=True)
class PartPlaces:
    """What a robot can do with the part at each place of a grid, all poses alike but for x and y.

    Attributes:
        cell: the robot, with the part where it was said to stand.
        x_m, y_m: (X,) and (Y,) places of the part in the robot's base.
        reached: (Y, X) share of the motion that is followed.
        speed: (Y, X) share of the planned speed at the slowest moment; 0 where not all is reached.
        room: (Y, X) least distance of a joint from its limits, as a share of its range.
    """

    cell: RobotCell
    x_m: np.ndarray
    y_m: np.ndarray
    reached: np.ndarray
    speed: np.ndarray
    room: np.ndarray

    @property
    def good(self) -> np.ndarray:
        """(Y, X) bool, places from which the robot is as fast as it can be from any."""
        return self.speed >= min(1.0, self.speed.max())

    @property
    def amid(self) -> np.ndarray:
        """(Y, X) bool, those all of whose neighbours were tried and are good too."""
        return minimum_filter(self.good, 3, mode='constant', cval=False)

    @property
    def best(self) -> tuple[int, int]:
        """Row and column of the place to choose: amid good ones if it can, with most room."""
        score = np.where(self.amid if self.amid.any() else self.good, self.room, -1.0)
        return divmod(int(score.argmax()), len(self.x_m))

    @property
    def part_pose(self) -> tuple[float, ...]:
        """Pose of the part at the best place: x y z [m] and qx qy qz qw."""
        row, column = self.best
        return _placed(self.cell.part, self.x_m[column], self.y_m[row]).values

    @property
    def sentence(self) -> str:
        """The answer in a sentence."""
        whole, count = int((self.reached == 1.0).sum()), self.reached.size
        if not whole:
            row, column = divmod(int(self.reached.argmax()), len(self.x_m))
            return (
                f'from none of {count} places the robot drives the whole motion; from '
                f'({self.x_m[column]:.2f}, {self.y_m[row]:.2f}) m it follows '
                f'{100 * self.reached.max():.0f} % of it'
            )
        row, column = self.best
        return (
            f'from {whole} of {count} places the robot drives the whole motion, from '
            f'{int((self.speed == 1.0).sum())} of them as fast as planned; at '
            f'({self.x_m[column]:.2f}, {self.y_m[row]:.2f}) m it keeps '
            f"{100 * self.room[row, column]:.0f} % of a joint's range from the limits"
            + (
                ''
                if self.amid[row, column]
                else '; not all places beside it were tried and are as good'
            )
        )

    def to_dict(self) -> dict[str, Any]:
        """The figures by name."""
        arrays = ('x_m', 'y_m', 'reached', 'speed', 'room')
        return {
            'sentence': self.sentence,
            'part_pose': self.part_pose if self.speed.max() > 0.0 else None,
            **{name: getattr(self, name).tolist() for name in arrays},
        }


def part_places(
    trajectory: Trajectory,
    cell: RobotCell,
    x_m: np.ndarray,
    y_m: np.ndarray,
    free_roll: bool = False,
    progress: Callable[[str, float], None] = lambda what, share: None,
) -> PartPlaces:
    """Try a motion, in the part's frame, with the part at each place of a grid.

    ``cell.part`` gives the height and the turn of the part.

    Raises:
        PlanError: the grid is empty.
    """
    if not len(x_m) or not len(y_m):
        raise PlanError('the grid of places is empty; give FROM TO with FROM below TO')
    shape = len(y_m), len(x_m)
    reached, speed, room = np.zeros(shape), np.zeros(shape), np.zeros(shape)
    for number, (row, column) in enumerate(np.ndindex(shape)):
        progress('places', number / reached.size)
        part = _placed(cell.part, x_m[column], y_m[row])
        tried = replace(cell, part=part).reachability(trajectory, free_roll)
        reached[row, column], speed[row, column], room[row, column] = tried
    return PartPlaces(cell, x_m, y_m, reached, speed, room)


def _placed(part: Rigid, x_m: float, y_m: float) -> Rigid:
    return replace(part, translation_m=np.array([x_m, y_m, part.translation_m[2]]))

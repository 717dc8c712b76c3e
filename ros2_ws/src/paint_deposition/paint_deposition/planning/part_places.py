"""Where a part stands in the frame of a robot, by touched points, and where it may stand."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.ndimage import minimum_filter
from scipy.spatial.transform import Rotation

from paint_deposition.errors import PaintError, RecordingError
from paint_deposition.motion.trajectory import Trajectory
from paint_deposition.motion.transforms import Rigid, at_part, is_frame
from paint_deposition.planning.driving import RobotCell
from paint_deposition.planning.joints import fastest_way, ways_of


def locate(
    touched_m: Mapping[str, np.ndarray], points_m: Mapping[str, np.ndarray]
) -> dict[str, Any]:
    """The pose that brings points of the part to where they were touched, by least squares.

    Both are (3,) [m] by name, in the robot's and in the part's frame; points without a partner are
    left out. Returned are ``part_pose``, x y z [m] and qx qy qz qw; by point, ``residuals_m``, how
    far it is from where the pose puts it, with their RMS ``rms_m``; and ``warnings``.

    Raises:
        RecordingError: fewer than three points are in common, or they lie on a line.
    """
    names = [name for name in touched_m if name in points_m]
    if len(names) < 3:
        raise RecordingError(
            f'{len(names)} points in common ({" ".join(names) or "none"}); touched are '
            f'{" ".join(touched_m)}, listed are {" ".join(points_m)}; give three or more that '
            'have the same names'
        )
    touched = np.array([touched_m[name] for name in names])
    points = np.array([points_m[name] for name in names])
    for what, positions in (('touched', touched), ('listed', points)):
        spread = np.linalg.svd(positions - positions.mean(axis=0), compute_uv=False)
        # Points nearer to a line than this share of their spread leave the turn about it open.
        if not spread[1] > 0.03 * spread[0]:
            raise RecordingError(
                f'the {what} points {" ".join(names)} lie on a line, so that the part may be '
                'turned about it; add a point beside it'
            )
    middle, about = touched.mean(axis=0), points.mean(axis=0)
    turn, _ = Rotation.align_vectors(touched - middle, points - about)
    apart = np.linalg.norm(turn.apply(points - about) + middle - touched, axis=1)
    rms = float(np.sqrt(np.mean(apart**2)))
    warnings = []
    # A misfit above this is warned of [m].
    if rms > 0.002:
        worst = names[int(np.argmax(apart))]
        warnings.append(
            f'the points do not fit, {worst} is off by {apart.max() * 1e3:.1f} mm: touch it '
            'again, and check its name, the units of both tables and that both frames are '
            'right-handed'
        )
    return {
        'part_pose': [*(middle - turn.apply(about)).tolist(), *turn.as_quat().tolist()],
        'rms_m': rms,
        'residuals_m': dict(zip(names, apart.tolist(), strict=True)),
        'warnings': warnings,
    }


@dataclass(frozen=True)
class PartPlaces:
    """What a robot can do with the part at each place of a grid of x and y, its turn unchanged."""

    cell: RobotCell  # the robot, with the part where it was said to stand
    x_m: np.ndarray  # (X,) places of the part in the robot's base, and y_m (Y,)
    y_m: np.ndarray
    reached: np.ndarray  # (Y, X) share of the motion that is followed
    # (Y, X) share of the planned speed at the slowest moment; 0 where not all is reached.
    speed: np.ndarray
    room: np.ndarray  # (Y, X) least distance of a joint from its limits, as a share of its range

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
        alone = (
            ''
            if self.amid[row, column]
            else '; not all places beside it were tried and are as good'
        )
        return (
            f'from {whole} of {count} places the robot drives the whole motion, from '
            f'{int((self.speed == 1.0).sum())} of them as fast as planned; at '
            f'({self.x_m[column]:.2f}, {self.y_m[row]:.2f}) m it keeps '
            f"{100 * self.room[row, column]:.0f} % of a joint's range from the limits{alone}"
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
    """Look where a part may stand so that the robot drives a motion over it.

    Accelerations are not looked at.

    Args:
        trajectory: the motion, in the frame of the part, ``part`` or without a name, or in that of
            the robot's base with the part at ``cell.part``.
        cell: the robot, with height and turn of the part.
        x_m, y_m: places of the part to try in the robot's base, (K,) and (I,) [m].
        free_roll: the tool may be turned about its own axis, as where the pattern is round.
        progress: called with what is being done and the share of it that is done, 0 to 1.

    Raises:
        PaintError: the grid is empty.
    """
    if not is_frame(trajectory.frame_id, 'part'):
        trajectory = at_part(trajectory, cell.part.values, 'part')
    if not len(x_m) or not len(y_m):
        raise PaintError('the grid of places is empty; give FROM TO with FROM below TO')
    arm, shape = cell.arm, (len(y_m), len(x_m))
    reached, speed, room = np.zeros(shape), np.zeros(shape), np.zeros(shape)
    # So many poses are enough for a motion that is only tried.
    times_s = np.linspace(0.0, trajectory.duration_s, 150)
    for number, (row, column) in enumerate(np.ndindex(shape)):
        progress('places', number / reached.size)
        at = row, column
        tried = replace(cell, part=_placed(cell.part, x_m[column], y_m[row]))
        positions_m, turns = tried.poses(trajectory, times_s)
        _, ways, followed = ways_of(arm, positions_m, turns, free_roll)
        reached[at] = followed.max(initial=0) / len(times_s)
        if reached[at] == 1.0:
            joints = ways[fastest_way(arm, ways, followed, times_s)]
            speeds = np.abs(np.diff(joints, axis=0)) / times_s[1] / arm.fastest
            speed[at], room[at] = min(1.0, 1.0 / speeds.max()), arm.room(joints).min()
    return PartPlaces(cell, x_m, y_m, reached, speed, room)


def _placed(part: Rigid, x_m: float, y_m: float) -> Rigid:
    return replace(part, translation_m=np.array([x_m, y_m, part.translation_m[2]]))

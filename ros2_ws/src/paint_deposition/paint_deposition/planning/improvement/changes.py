"""What an improved programme changes, pass by pass, in the robot's terms."""

from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from paint_deposition.motion.path_builder import spray_path
from paint_deposition.planning.improvement.programme import Programme, speed_along

# Speeds that differ by less are told as one; so many stretches at most.
ALIKE, MOST_STRETCHES = 0.06, 6
# The new speed is sampled so often along a pass.
SAMPLES = 60
# Shifts of a trigger by less are not told [m].
LEAST_SHIFT_M = 0.002
LEAST_PASS_M = 0.05


@dataclass(frozen=True)
class Stretch:
    """A part of a pass with a mean speed before and after.

    Attributes:
        begin_m, end_m: coordinates along the axis of the part that the pass follows.
        before_m_per_s, after_m_per_s: mean speeds; before is NaN where the gun was closed.
    """

    begin_m: float
    end_m: float
    before_m_per_s: float
    after_m_per_s: float


@dataclass(frozen=True)
class PassChange:
    """What changes in a pass.

    Attributes:
        number: of the pass, from 1. axis: 'x', 'y' or 'z', which it follows most.
        stretches: in running order.
        opens_earlier_m, closes_later_m: along the path; negative is the other way; 0 where the
            pass does not begin or end with the gun.
        opens_earlier_s, closes_later_s: the same at the speed of the new programme.
        flow: relative to the calibrated one, before and after.
    """

    number: int
    axis: str
    stretches: tuple[Stretch, ...]
    opens_earlier_m: float
    closes_later_m: float
    opens_earlier_s: float
    closes_later_s: float
    flow: tuple[float, float]

    @property
    def sentence(self) -> str:
        """The change in a line."""
        said = [self._speed(stretch) for stretch in self.stretches]
        if abs(self.opens_earlier_m) >= LEAST_SHIFT_M:
            side = 'earlier' if self.opens_earlier_m > 0.0 else 'later'
            said.append(f'opens {_ms(self.opens_earlier_s)} {side} ({_mm(self.opens_earlier_m)})')
        if abs(self.closes_later_m) >= LEAST_SHIFT_M:
            side = 'later' if self.closes_later_m > 0.0 else 'earlier'
            said.append(f'closes {_ms(self.closes_later_s)} {side} ({_mm(self.closes_later_m)})')
        if abs(self.flow[1] - self.flow[0]) > 5e-4:
            said.append(f'flow {self.flow[0]:.3f} to {self.flow[1]:.3f}')
        return f'pass {self.number}: ' + '; '.join(said)

    def _speed(self, stretch: Stretch) -> str:
        return (
            f'{stretch.before_m_per_s:.3f} to {stretch.after_m_per_s:.3f} m/s between '
            f'{self.axis} = {stretch.begin_m:.2f} and {stretch.end_m:.2f} m'
        )

    def to_dict(self) -> dict[str, Any]:
        """The figures by name, with the sentence."""
        return {**asdict(self), 'sentence': self.sentence}


def changes(given: Programme, improved: Programme) -> tuple[PassChange, ...]:
    """The changes of all passes; a pass is a straight stretch with the gun open."""
    turns = _turns_m(given)
    found: list[PassChange] = []
    for before, after in zip(given.openings, improved.openings, strict=True):
        inside = turns[(turns > after.on_m + LEAST_PASS_M) & (turns < after.off_m - LEAST_PASS_M)]
        ends = [after.on_m, *inside.tolist(), after.off_m]
        for first, last in pairwise(ends):
            axis, stretches = _stretches(given, improved, first, last)
            earlier = before.on_m - after.on_m if first == after.on_m else 0.0
            later = after.off_m - before.off_m if last == after.off_m else 0.0
            found.append(
                PassChange(
                    len(found) + 1, axis, stretches, earlier, later,
                    earlier / stretches[0].after_m_per_s, later / stretches[-1].after_m_per_s,
                    (before.flow, after.flow),
                )
            )  # fmt: skip
    return tuple(found)


def _turns_m(programme: Programme) -> np.ndarray:
    """Travel at which strokes begin."""
    trajectory = programme.trajectory()
    path, _ = spray_path(trajectory)
    turn = 1 + np.flatnonzero(np.diff(path.stroke))
    return programme.travel_at_m(path.stamp_ns[turn]) - path.from_turn_m[turn]


def _stretches(
    given: Programme, improved: Programme, first_m: float, last_m: float
) -> tuple[str, tuple[Stretch, ...]]:
    """The pass between two places of the path, in stretches of about even new speed."""
    places = np.linspace(first_m, last_m, SAMPLES + 1)
    speed = speed_along(improved, places)
    cuts = _cuts(speed)
    ends = places[[0, *cuts, SAMPLES]]
    at = given.positions_at_m(ends)
    axis = int(np.abs(at[-1] - at[0]).argmax())
    before, after = speed_along(given, ends), speed_along(improved, ends)
    coordinate = at[:, axis].tolist()
    return 'xyz'[axis], tuple(
        Stretch(a, b, float(old), float(new))
        for a, b, old, new in zip(coordinate[:-1], coordinate[1:], before, after, strict=True)
    )


def _cuts(speed: np.ndarray) -> list[int]:
    """Where to cut so that the speed is about even in each stretch: neighbours merged in turn."""
    slowness = 1.0 / speed
    ends = list(range(len(speed) + 1))

    def cost(a: int, b: int) -> float:
        inside = slowness[a:b]
        return float(np.sum((inside / slowness.mean() - inside.mean() / slowness.mean()) ** 2))

    while len(ends) > 2:
        rises = [
            cost(ends[k - 1], ends[k + 1])
            - cost(ends[k - 1], ends[k])
            - cost(ends[k], ends[k + 1])
            for k in range(1, len(ends) - 1)
        ]
        least = int(np.argmin(rises))
        length = ends[least + 2] - ends[least]
        enough = rises[least] > ALIKE**2 * length
        if enough and len(ends) - 1 <= MOST_STRETCHES:
            break
        del ends[least + 1]
    return ends[1:-1]


def _ms(seconds: float) -> str:
    return f'{abs(seconds) * 1e3:.0f} ms'


def _mm(metres: float) -> str:
    return f'{abs(metres) * 1e3:.0f} mm'

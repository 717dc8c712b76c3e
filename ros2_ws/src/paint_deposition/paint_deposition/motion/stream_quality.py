"""Whether a recorded stream of samples will do: rate, gaps, repeats, lag, unit and speed."""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from paint_deposition.motion.trajectory import DEFAULT_MAX_POSE_GAP_S, gap_ns

# Intervals whose median is the stream's rhythm.
REMEMBERED = 250
# Equal values over a longer time are a robot that stands still [ns].
LONGEST_REPEAT_NS = 50_000_000
# Such a share of repeats is the habit of a driver; fewer are chance.
LEAST_SHARE = 0.2


class StreamSteps:
    """Steps from pose to pose of a stream, in the order in which they were received.

    Attributes:
        longest_ns: longest interval between two stamps.
        long: intervals of more than 1.5 times the median of those before: with a steady stream,
            lost poses.
        jumps: steps that no robot makes: two guns on one topic, or stamps of two clocks.
        fastest_m_per_s: speed that the worst of these would take, 0 where there is none.
    """

    def __init__(self) -> None:
        self.longest_ns = self.long = self.jumps = 0
        self.fastest_m_per_s = 0.0
        self._last_ns: int | None = None
        self._recent: deque[int] = deque(maxlen=REMEMBERED)
        # Of the last pose with a place.
        self._placed_ns: np.ndarray = np.empty(0, dtype=np.int64)
        self._placed_m: np.ndarray = np.empty((0, 3))

    @property
    def typical_ns(self) -> float:
        """Median of the last intervals; 0 before there are any."""
        return float(np.median(self._recent)) if self._recent else 0.0

    def add_stamps(self, stamps_ns: np.ndarray) -> None:
        """Take stamps (N,) int64; a stamp that does not move forward begins anew."""
        typical_ns = self.typical_ns
        for stamp_ns in stamps_ns.tolist():
            step_ns = 0 if self._last_ns is None else stamp_ns - self._last_ns
            self._last_ns = stamp_ns
            if step_ns > 0:
                self.longest_ns = max(self.longest_ns, step_ns)
                typical_ns = typical_ns or step_ns
                self.long += step_ns > 1.5 * typical_ns
                self._recent.append(step_ns)

    def add_places(self, stamps_ns: np.ndarray, positions_m: np.ndarray) -> None:
        """Take finite positions (N, 3) [m] at stamps (N,) int64; going back begins anew."""
        stamps_ns = np.concatenate([self._placed_ns, stamps_ns])
        positions_m = np.concatenate([self._placed_m, positions_m])
        self._placed_ns, self._placed_m = stamps_ns[-1:], positions_m[-1:]
        step_s = np.diff(stamps_ns) * 1e-9
        step_m = np.linalg.norm(np.diff(positions_m, axis=0), axis=1)
        # Painting robots move their TCP at 3 m/s at most; stamps that tremble make any step of a
        # slow gun of less than 50 mm look fast.
        far = (step_s > 0.0) & (step_m > np.fmax(0.05, 10.0 * step_s))
        self.jumps += int(np.count_nonzero(far))
        fastest = step_m[far] / step_s[far]
        self.fastest_m_per_s = float(np.max(fastest, initial=self.fastest_m_per_s))


class RepeatedSamples:
    """Finds the samples of a stream that repeat the one before them under a later stamp.

    A loop that is faster than the robot sends each sample two or three times: speeds of zero and
    of thrice. Equal samples between two that differ are repeats if they last no longer than
    ``LONGEST_REPEAT_NS``. They are found as soon as they are known as a habit, from what came
    before alone, so that a live stream and its recording lose the same ones.

    Attributes:
        count: repeats that were found.
    """

    def __init__(self) -> None:
        self.count = 0
        self._last: list[float] = []
        self._last_ns = self._since_ns = 0
        self._waiting = self._seen = self._moved = 0

    def are_new(self, stamps_ns: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Whether the samples, (N,) int64 and (N, K), are no repeats: (N,) of bool."""
        new = np.ones(len(values), dtype=bool)
        samples = zip(stamps_ns.tolist(), values.tolist(), strict=True)
        for row, (stamp_ns, value) in enumerate(samples):
            if value != self._last:
                stood = self._last_ns - self._since_ns > LONGEST_REPEAT_NS
                self._seen += 0 if stood else self._waiting
                self._moved += 1
                self._last, self._since_ns, self._waiting = value, stamp_ns, 0
            elif stamp_ns > self._last_ns:
                self._waiting += 1
                soon = stamp_ns - self._since_ns <= LONGEST_REPEAT_NS
                share = LEAST_SHARE * (self._seen + self._moved)
                # So many repeats, and such a share of the samples, are the driver's habit; fewer
                # are chance.
                is_habit = self._seen >= 20 and self._seen >= share
                new[row] = not (soon and is_habit)
            self._last_ns = stamp_ns
        self.count += int(np.count_nonzero(~new))
        return new


# Fewer samples a second blur the speed of the gun and cut its corners.
LEAST_HZ = 10.0
# A recorder may repeat a sample or a stamp now and then; more than this share is a fault.
MANY_REPEATED = 0.05
# No part is further away: the unit is another one [m].
FARTHEST_PART_M = 50.0


@dataclass(frozen=True)
class StreamQuality:
    """Figures of one stream, from its stamps.

    ``new_rate_hz`` is that of the samples which differ, by the median of their intervals;
    ``lag_s`` and its range, which holds 90 % of them, are from stamp to arrival in the recorder,
    None where that is not recorded.
    """

    poses: int
    duration_s: float
    mean_rate_hz: float
    gaps: int
    longest_gap_s: float
    repeated_stamps: int
    backward_stamps: int
    repeated_samples: int
    new_rate_hz: float
    lag_s: float | None = None
    lag_range_s: tuple[float, float] | None = None

    @staticmethod
    def of(
        stamps_ns: np.ndarray,
        values: np.ndarray,
        log_times_ns: np.ndarray | None = None,
        max_gap_s: float = DEFAULT_MAX_POSE_GAP_S,
    ) -> 'StreamQuality':
        """Judge samples (N,) int64 and (N, K) as recorded, and when they arrived (N,) int64."""
        repeats = RepeatedSamples()
        new_ns = np.diff(stamps_ns[repeats.are_new(stamps_ns, values)])
        steps_ns = np.diff(stamps_ns)
        forward_ns = new_ns[new_ns > 0]
        duration_s = 1e-9 * float(stamps_ns[-1] - stamps_ns[0]) if len(stamps_ns) else 0.0
        lag = lag_range = None
        if log_times_ns is not None and len(stamps_ns):
            low, lag, high = 1e-9 * np.percentile(log_times_ns - stamps_ns, [5, 50, 95])
            lag, lag_range = float(lag), (float(low), float(high))
        return StreamQuality(
            len(stamps_ns), duration_s, len(steps_ns) / duration_s if duration_s > 0.0 else 0.0,
            int(np.count_nonzero(steps_ns > gap_ns(max_gap_s))),
            float(steps_ns.max(initial=0)) * 1e-9, int(np.count_nonzero(steps_ns == 0)),
            int(np.count_nonzero(steps_ns < 0)), repeats.count,
            1e9 / float(np.median(forward_ns)) if len(forward_ns) else 0.0, lag, lag_range,
        )  # fmt: skip

    def faults(self, name: str) -> list[str]:
        """What makes the stream of this name blur or distort a film, with the remedy."""
        faults = [*self.repeats(name)]
        if 0.0 < self.new_rate_hz < LEAST_HZ * (1.0 - 1e-3):
            faults.append(
                f'{name}: only {self.new_rate_hz:.3g} samples a second: between them the gun '
                f'moves {100.0 / self.new_rate_hz:.0f} cm at 1 m/s, its corners are cut and its '
                f'speed is blurred; record {LEAST_HZ:g} a second or more, by EGM (250) or with a '
                'higher polling_rate of RWS'
            )
        return faults

    def repeats(self, name: str) -> Iterator[str]:
        """The fault of a driver that sends samples again, if it is one."""
        if self.repeated_samples > MANY_REPEATED * self.poses:
            yield (
                f'{name}: {self.repeated_samples} of {self.poses} samples repeat the one before '
                'them under a new stamp, as of a driver that asks more often than the robot '
                f'answers; they are dropped, and {self.new_rate_hz:.3g} a second are left'
            )


def looks_like_mm(positions_m: np.ndarray) -> bool:
    """Whether most positions (N, 3) are too far away for metres."""
    if not len(positions_m):
        return False
    return bool(np.median(np.abs(positions_m).max(axis=1)) > FARTHEST_PART_M)

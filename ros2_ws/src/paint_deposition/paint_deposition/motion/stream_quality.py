"""Whether a recorded stream of samples will do: its rate, gaps, repeats, lag and unit."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from paint_deposition.motion.path_builder import DEFAULT_MAX_POSE_GAP_S, gap_ns
from paint_deposition.motion.stream_figures import RepeatedSamples

# Fewer samples a second blur the speed of the gun and cut its corners.
LEAST_HZ = 10.0
# A recorder may repeat a sample now and then; more than this share is a fault.
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
        """Of samples (N,) int64 and (N, K) as recorded, and of when they arrived (N,) int64."""
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
        return [*self.repeats(name), *self.slowness(name)]

    def repeats(self, name: str) -> Iterator[str]:
        """The fault of a driver that sends samples again, if it is one."""
        if self.repeated_samples > MANY_REPEATED * self.poses:
            yield (
                f'{name}: {self.repeated_samples} of {self.poses} samples repeat the one before '
                'them under a new stamp, as of a driver that asks more often than the robot '
                f'answers; they are dropped, and {self.new_rate_hz:.3g} a second are left'
            )

    def slowness(self, name: str) -> Iterator[str]:
        """The fault of too few samples, if it is one."""
        if 0.0 < self.new_rate_hz < LEAST_HZ * (1.0 - 1e-3):
            yield (
                f'{name}: only {self.new_rate_hz:.3g} samples a second: between them the gun '
                f'moves {100.0 / self.new_rate_hz:.0f} cm at 1 m/s, its corners are cut and its '
                f'speed is blurred; record {LEAST_HZ:g} a second or more, by EGM (250) or with a '
                'higher polling_rate of RWS'
            )


def looks_like_mm(positions_m: np.ndarray) -> bool:
    """Whether most positions (N, 3) are too far away for metres."""
    if not len(positions_m):
        return False
    return bool(np.median(np.abs(positions_m).max(axis=1)) > FARTHEST_PART_M)

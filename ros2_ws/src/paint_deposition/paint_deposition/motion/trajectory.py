"""A recorded motion of the atomizer: poses, and the trigger with flow and brush over time."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field

import numpy as np

from paint_deposition.errors import RecordingError

# The brush of a motion that names none: the only one.
ONLY_BRUSH = 0
# Earlier than any stamp [ns].
BEFORE_ALL_NS = -(2**62)

# A flow that is so many times the calibrated one is in another unit.
MOST_FLOW = 100.0
SPRAYS_NOTHING = (
    'says spraying with flow 0, which lays no paint: give 1 for the calibrated flow, or NaN where '
    'it is not measured'
)


def relative_flow(spraying: bool, flow: float = math.nan) -> float:
    """Flow relative to the calibrated one, 0 while the gun is off; NaN is unknown and taken as 1.

    Raises RecordingError for a flow that is negative, or more than any gun has.
    """
    if not spraying:
        return 0.0
    if math.isnan(flow):
        return 1.0
    if not 0.0 <= flow <= MOST_FLOW:
        raise RecordingError(f'atomizer flow is {flow:g}: give 1 for the calibrated flow, or NaN')
    return float(flow)


@dataclass
class PoseCounts:
    """What became of the poses of a stream."""

    received: int = 0
    repeated_stamps: int = 0
    backward_stamps: int = 0
    not_finite: int = 0
    not_unit_quaternions: int = 0
    restarts: int = 0
    gaps: int = 0
    longest_gap_ns: int = 0
    late_triggers: int = 0
    repeated_samples: int = 0

    @property
    def rejected(self) -> int:
        """Poses that were dropped."""
        stamps = self.repeated_stamps + self.backward_stamps + self.repeated_samples
        return stamps + self.not_finite + self.not_unit_quaternions

    @staticmethod
    def of_guns(counts: Sequence['PoseCounts']) -> 'PoseCounts':
        """The counts of several guns together, and the longest of their gaps."""
        total = {name: sum(vars(each)[name] for each in counts) for name in vars(counts[0])}
        total['longest_gap_ns'] = max(each.longest_gap_ns for each in counts)
        return PoseCounts(**total)

    def to_dict(self) -> dict[str, int]:
        """All counts by name, for diagnostics and statistics."""
        return asdict(self) | {'rejected': self.rejected}


@dataclass(frozen=True)
class Trajectory:
    """Atomizer poses as recorded, in the mesh's frame, not yet screened.

    Attributes:
        stamps_ns: (N,) int64 header stamps; screening drops what does not move forward.
        positions_m: (N, 3) TCP [m].
        quaternions_xyzw: (N, 4) orientation of the tool, scalar last as in ROS.
        frame_id: frame of the poses, '' where the recording does not say.
        trigger_stamps_ns: (M,) int64 times at which the flow changes; empty: always spraying.
        trigger_flow: (M,) from that time on, relative to the calibrated one; 0 is gun off, as it
            is before the first of them.
        trigger_brush: (M,) int number of the brush from that time on; empty: 0, the only one.
        frames: (N,) frame of each pose, where they are in several; else empty.
        trigger_rows: (M,) int number of poses that came before each change; empty: all changes
            came before the poses. It matters where a stream of poses begins again.
        notes, warnings: remarks for the user, and what is likely wrong, a line each.
        source: the file it came from, for messages.
        settings: of the process while the gun sprayed, by name; empty where not recorded.
        read_in: frame of the poses before they were brought to that of the part.

    Raises:
        RecordingError: the arrays do not have these shapes.
    """

    stamps_ns: np.ndarray
    positions_m: np.ndarray
    quaternions_xyzw: np.ndarray
    frame_id: str = ''
    trigger_stamps_ns: np.ndarray = field(default_factory=lambda: np.empty(0, np.int64))
    trigger_flow: np.ndarray = field(default_factory=lambda: np.empty(0))
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    source: str = 'trajectory'
    settings: Mapping[str, float] = field(default_factory=dict)
    trigger_brush: np.ndarray = field(default_factory=lambda: np.empty(0, np.int64))
    trigger_rows: np.ndarray = field(default_factory=lambda: np.empty(0, np.int64))
    frames: tuple[str, ...] = ()
    read_in: str = ''

    def __repr__(self) -> str:
        return f'Trajectory({len(self)} poses over {self.duration_s:.1f} s)'

    def __post_init__(self) -> None:
        count = len(self.stamps_ns)
        shapes = (np.shape(self.positions_m), np.shape(self.quaternions_xyzw))
        if shapes != ((count, 3), (count, 4)):
            raise RecordingError(
                f'{count} stamps go with positions {shapes[0]} and quaternions {shapes[1]}; '
                f'expected ({count}, 3) and ({count}, 4)'
            )
        changes = len(self.trigger_stamps_ns)
        for what, column, may_lack in (
            ('flow values', self.trigger_flow, False),
            ('brushes', self.trigger_brush, True),
            ('numbers of poses before', self.trigger_rows, True),
        ):
            if len(column) != changes and not (may_lack and not len(column)):
                raise RecordingError(
                    f'{changes} trigger stamps go with {len(column)} {what}; give one a stamp'
                    f'{", or none" if may_lack else ""}'
                )

    @property
    def triggers(self) -> list[tuple[int, float, int]]:
        """Time [ns], flow and brush of each change of the trigger."""
        brush = self.trigger_brush if len(self.trigger_brush) else np.zeros(len(self.trigger_flow))
        columns = (self.trigger_stamps_ns, self.trigger_flow, brush.astype(np.int64))
        return list(zip(*(column.tolist() for column in columns), strict=True))

    @property
    def brushes(self) -> set[int]:
        """Numbers of the brushes that spray."""
        if not len(self.trigger_flow):
            return {ONLY_BRUSH}
        return {brush for _, flow, brush in self.triggers if flow > 0.0}

    def __len__(self) -> int:
        return len(self.stamps_ns)

    @property
    def duration_s(self) -> float:
        """Time from the first to the last pose [s]."""
        return float(self.stamps_ns[-1] - self.stamps_ns[0]) * 1e-9 if len(self) else 0.0


DEFAULT_MAX_POSE_GAP_S = 0.25
# A century [ns]: no longer gap is told from it, and sums of stamps and gaps fit 64 bits.
MOST_GAP_NS = 3_155_760_000_000_000_000


def gap_ns(max_pose_gap_s: float) -> int:
    """The longest interval between poses that is no gap [ns], from seconds above 0."""
    if not (math.isfinite(max_pose_gap_s) and max_pose_gap_s > 0.0):
        raise RecordingError(f'max_pose_gap_s is {max_pose_gap_s}; give seconds above 0, 0.25 say')
    return round(min(max_pose_gap_s * 1e9, MOST_GAP_NS))

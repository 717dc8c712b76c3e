"""The spray path: a recorded motion cut into the sub-steps over which the film is integrated."""

from dataclasses import dataclass, fields, replace

import numpy as np


@dataclass(frozen=True)
class SprayPath:
    """Sub-steps of the motion in time order, one row each; the nodes of the film integral.

    Attributes:
        stamp_ns: (M,) int64 middle of the sub-step.
        time_s: (M,) the same since the motion began [s], NaN where that is not known.
        dwell_s: (M,) its duration, the quadrature weight [s].
        flow: (M,) flow relative to the calibrated one; 0 is gun off.
        position_m: (M, 3) TCP [m].
        rotation: (M, 3, 3) tool axes x, y, z as columns.
        velocity_m_per_s: (M, 3) of the TCP [m/s].
        pattern_shift_m: (M, 2) displacement of the pattern on the model plane, tool x, y [m].
        stroke: (M,) int, number of the straight stroke; a new one starts where a turn of the path
            shows, up to 40 mm behind it.
        spray_pass: (M,) int, number of the spraying pass, -1 before the first.
        passes_before: (M,) int, spraying passes of the same gun before that one.
        open_flow: (M,) flow of the opening that runs or ran last; 1 before the first.
        since_on_s, since_off_s: (M,) time since the trigger last opened and closed, inf if never
            [s].
        until_on_s, until_off_s: (M,) time until it next does within the stroke, inf if not.
        from_turn_m, to_turn_m: (M,) distance along the path from the last turn and to the next.
        brush: (M,) int, number of the brush of the opening that runs or ran last; 0 is the only
            one, and before the first.
    """

    stamp_ns: np.ndarray
    time_s: np.ndarray
    dwell_s: np.ndarray
    flow: np.ndarray
    position_m: np.ndarray
    rotation: np.ndarray
    velocity_m_per_s: np.ndarray
    pattern_shift_m: np.ndarray
    stroke: np.ndarray
    spray_pass: np.ndarray
    passes_before: np.ndarray
    open_flow: np.ndarray
    since_on_s: np.ndarray
    since_off_s: np.ndarray
    until_on_s: np.ndarray
    until_off_s: np.ndarray
    from_turn_m: np.ndarray
    to_turn_m: np.ndarray
    brush: np.ndarray

    @staticmethod
    def of(
        stamp_ns: np.ndarray, dwell_s: np.ndarray, flow: np.ndarray, position_m: np.ndarray,
        rotation: np.ndarray, velocity_m_per_s: np.ndarray,
    ) -> 'SprayPath':  # fmt: skip
        """The motion alone, as one endless pass without turns and trigger changes."""
        count = len(flow)
        numbers, never = np.zeros(count, np.int64), np.full(count, np.inf)
        return SprayPath(
            stamp_ns, np.full(count, np.nan), dwell_s, flow, position_m, rotation,
            velocity_m_per_s, np.zeros((count, 2)), numbers, numbers, numbers,
            np.ones(count), never, never, never, never, never, never, numbers,
        )  # fmt: skip

    def __len__(self) -> int:
        return len(self.stamp_ns)

    @property
    def speed_m_per_s(self) -> np.ndarray:
        """(M,) speed of the TCP [m/s]."""
        return np.linalg.norm(self.velocity_m_per_s, axis=1)

    @property
    def spraying_time_s(self) -> float:
        """Time sprayed, weighted by the relative flow [s]: K1 times this was emitted."""
        return float(np.sum(self.dwell_s * self.flow))

    def with_flow_scaled(self, factor: float | np.ndarray) -> 'SprayPath':
        """The same motion at another flow, times a factor or (M,) factors.

        The flow of the opening is scaled too: what still flows after a closing tails off from it.
        """
        return self.with_(flow=factor * self.flow, open_flow=factor * self.open_flow)

    def select(self, rows: slice | np.ndarray) -> 'SprayPath':
        """The chosen rows, by mask, slice or indices."""
        return SprayPath(*(getattr(self, item.name)[rows] for item in fields(self)))

    def with_(self, **columns: np.ndarray) -> 'SprayPath':
        """A copy with some columns replaced."""
        return replace(self, **columns)

    @staticmethod
    def empty() -> 'SprayPath':
        """No sub-steps."""
        none, whole = np.empty(0), np.empty(0, np.int64)
        vectors, axes = np.empty((0, 3)), np.empty((0, 3, 3))
        return SprayPath.of(whole, none, none, vectors, axes, vectors)

    @staticmethod
    def joined(paths: list['SprayPath']) -> 'SprayPath':
        """Paths one after the other."""
        return SprayPath(
            *(np.concatenate([getattr(p, item.name) for p in paths]) for item in fields(SprayPath))
        )

    @staticmethod
    def of_guns(paths: list['SprayPath']) -> 'SprayPath':
        """Paths of several guns on one part, gun after gun; strokes and passes numbered through.

        A gun alone keeps its path as it is.
        """
        numbered = []
        strokes = passes = 0
        for path in paths:
            number = np.where(path.spray_pass < 0, -1, path.spray_pass + passes)
            numbered.append(path.with_(stroke=path.stroke + strokes, spray_pass=number))
            strokes = int(numbered[-1].stroke.max(initial=strokes - 1)) + 1
            passes = int(number.max(initial=passes - 1)) + 1
        return SprayPath.joined(numbered)

"""The film of a motion that still goes on, by way of ``FilmIntegrator``."""

import copy
from bisect import bisect_right, insort
from collections import Counter
from collections.abc import Iterable
from dataclasses import replace
from operator import attrgetter

import numpy as np

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import ModelError, RecordingError
from paint_deposition.film.integrator import FilmIntegrator, Precision
from paint_deposition.motion.path_builder import PathBuilder
from paint_deposition.motion.pose_stream import (
    DEFAULT_POSE_MEMORY,
    MotionLog,
    PoseBatch,
    TriggerChange,
)
from paint_deposition.motion.trajectory import (
    BEFORE_ALL_NS,
    DEFAULT_MAX_POSE_GAP_S,
    ONLY_BRUSH,
    PoseCounts,
    Trajectory,
)
from paint_deposition.part.points import SurfacePoints
from paint_deposition.part.surface import Surface

# A trigger change that is older than the newest pose by more is from a restarted stream, and none
# is told so long ahead of its pose [ns].
STREAM_RESTART_NS = 1_000_000_000
# That wait for poses; no gun is switched so often within the time that poses may be missing.
MOST_CHANGES = 100_000
_STAMP = attrgetter('stamp_ns')


class LiveFilm:
    """Passes poses and trigger changes on to the integrator, and logs them to replay them later.

    A pose waits until one is newer by the trigger's latency, measured by their stamps, so that a
    trigger change that arrives a little late still takes effect at its own stamp. The film does
    not depend on how the poses were batched, and equals that of an offline run to the last bit.

    Without any trigger change the gun always sprays. The first change implies that the gun was
    off before it, as in a recording: the film painted until then is discarded. A model of several
    brushes paints nothing before a change that names a brush.

    Args:
        points: where the film is wanted.
        model: the deposition model with its effects.
        precision, occluder: as for ``FilmIntegrator``.
        max_pose_gap_s: a longer time between two poses is gun off [s].
        trigger_latency_s: how late a trigger change may arrive, by the stamps of the poses [s].
        pose_memory: number of poses to log, so that another model can repaint them.
    """

    def __init__(
        self,
        points: SurfacePoints,
        model: DepositionModel,
        *,
        precision: Precision = 'single',
        occluder: Surface | None = None,
        max_pose_gap_s: float = DEFAULT_MAX_POSE_GAP_S,
        trigger_latency_s: float = 0.1,
        pose_memory: int = DEFAULT_POSE_MEMORY,
    ) -> None:
        self.max_pose_gap_s = max_pose_gap_s
        self.trigger_latency_s = trigger_latency_s
        self._limit_poses = pose_memory
        self._integrator = FilmIntegrator(points, model, precision, occluder)
        # Brushes of all trigger changes, including those carried over a reset.
        self._brushes: set[int] = set()
        self._clear()

    @property
    def model(self) -> DepositionModel:
        """The model that paints."""
        return self._integrator.model

    @property
    def counts(self) -> PoseCounts:
        """What became of the poses since the last reset."""
        return self._builder.screen.counts

    @property
    def newest_ns(self) -> int | None:
        """Stamp of the newest pose that was kept."""
        return self._builder.screen.newest_ns

    @property
    def _settled_ns(self) -> int:
        """Stamp before which late trigger changes are no longer waited for."""
        return (self.newest_ns or 0) - round(self.trigger_latency_s * 1e9)

    @property
    def flow(self) -> float | None:
        """Relative flow at the newest pose; None: there was no trigger change yet."""
        if not self._changes:
            return None
        return self._current_change.flow if self._current_change else 0.0

    @property
    def brush(self) -> int:
        """Number of the brush at the newest pose; 0 is the only one."""
        return self._current_change.brush if self._current_change else ONLY_BRUSH

    @property
    def _current_change(self) -> TriggerChange | None:
        """The trigger change in effect at the newest pose."""
        changes, newest = self._changes, self.newest_ns
        passed = len(changes) if newest is None else bisect_right(changes, newest, key=_STAMP)
        return changes[passed - 1] if passed else None

    @property
    def carried_over(self) -> list[TriggerChange]:
        """What a film that goes on with the motion begins with: the change in effect at the newest
        pose, and those stamped after it.
        """
        passed = bisect_right(self._changes, self._reached_ns, key=_STAMP)
        return self._changes[max(passed - 1, 0) :]

    def reset(self, keeping_trigger_of: 'LiveFilm | None' = None) -> None:
        """Clear the film; the gun stays on or off as in another film, by default in this one.

        Raises:
            ModelError: the model does not have the brush that the gun sprays with.
        """
        before = keeping_trigger_of or self
        carried, reached_ns = before.carried_over, before._reached_ns
        brushes = {change.brush for change in carried if change.flow > 0.0}
        self.model.require_brushes(brushes)
        self._brushes = brushes
        self._clear(reached_ns)
        for change in carried:
            self._take_change(change)

    def _clear(self, reached_ns: int = BEFORE_ALL_NS) -> None:
        self._integrator.reset()
        self._builder = PathBuilder(
            self.max_pose_gap_s, self.model.max_step_m, self.model.needs_whole_strokes
        )
        # Without a trigger the gun sprays, but with several brushes it must be known which.
        if len(self.model.brushes) > 1:
            self._builder.add_trigger(BEFORE_ALL_NS, 0.0)
        self.log = MotionLog(self._limit_poses)
        self._changes: list[TriggerChange] = []
        # Of the newest pose that was kept, or of the first change of a stream about to restart.
        self._reached_ns = reached_ns
        self._snapshot: FilmIntegrator | None = None

    def add_trigger(self, change: TriggerChange) -> None:
        """Add a trigger change, early, in time or late.

        Raises:
            ModelError: its brush is not in the model; the change is ignored.
            RecordingError: too many wait for poses; the change is ignored.
        """
        if len(self._changes) >= MOST_CHANGES:
            raise RecordingError(
                f'over {MOST_CHANGES} states are stamped ahead of the poses: send poses, or set '
                'the clocks'
            )
        if change.flow > 0.0:
            self.model.require_brushes({*self._brushes, change.brush})
            self._brushes.add(change.brush)
        if not self._changes and self.log.complete and self.log.poses:
            log = self.log
            self._clear()
            self._take_change(change)
            self.replay(log.events())
            return
        if self._reached_ns - change.stamp_ns > STREAM_RESTART_NS:
            self._changes, self._reached_ns = [], change.stamp_ns
        self._take_change(change)

    def add_poses(self, batch: PoseBatch) -> None:
        """Add poses, and paint those that no longer wait for the trigger."""
        if not len(batch):
            return
        self.log.add(batch)
        before_ns = self.newest_ns
        self._builder.add_poses(batch)
        if self.newest_ns is not None and self.newest_ns != before_ns:
            self._reached_ns = self.newest_ns
        self._integrator.add(self._builder.take(self._settled_ns))
        self._snapshot = None

    def replay(self, events: Iterable[TriggerChange | PoseBatch]) -> None:
        """Add logged poses and trigger changes."""
        for event in events:
            if isinstance(event, TriggerChange):
                self.add_trigger(event)
            else:
                self.add_poses(event)

    def snapshot(self) -> FilmIntegrator:
        """The film of everything received so far, as if all strokes ended here; a copy."""
        if self._snapshot is None:
            self._snapshot = self._integrator.fork()
            self._snapshot.add(copy.deepcopy(self._builder).take(finish=True))
        return self._snapshot

    def require_brushes_in(self, model: DepositionModel) -> None:
        """Refuse by ModelError a model that lacks a brush that was used."""
        always_on = len(self.model.brushes) <= 1 and self.flow is None
        model.require_brushes({ONLY_BRUSH} if always_on else self._brushes)

    def switch_model(self, model: DepositionModel) -> None:
        """Paint with another model, which has the brushes used, from here on; the film stays."""
        self.require_brushes_in(model)
        builder = self._builder
        self._integrator.add(builder.take(self._settled_ns, finish=True))
        self._integrator.use(model)
        builder.max_step_m = model.max_step_m
        builder.whole_strokes = model.needs_whole_strokes
        self._snapshot = None

    def warm_up(self) -> None:
        """Compile the model and compute all it needs, before there is any motion."""
        far_away = np.full((2, 3), 1e3)
        builder = PathBuilder()
        builder.add_poses(PoseBatch.of([0, 1_000_000], far_away, np.eye(4)[[3, 3]]))
        unpainted = self._integrator.fork()
        path = builder.take(finish=True)
        unpainted.add(path.with_(brush=np.full(len(path), self.model.brush)))
        _ = unpainted.gauge_um

    def _take_change(self, change: TriggerChange) -> None:
        self.log.add(change)
        self._builder.add_trigger(change.stamp_ns, change.flow, change.brush)
        # Keep the changes that are in effect from the newest pose on.
        insort(self._changes, change, key=_STAMP)
        passed = bisect_right(self._changes, self._reached_ns, key=_STAMP)
        del self._changes[: max(0, passed - 1)]
        self._snapshot = None


def without_refused_states(
    motion: Trajectory, model: DepositionModel, strict: bool = False
) -> Trajectory:
    """A recorded motion without the states that ``LiveFilm`` refuses, with a warning for each
    brush.

    Raises:
        ModelError: the model has none of the brushes that spray, or, if ``strict``, not all.
    """
    taken: set[int] = set()
    refused: dict[int, str] = {}
    for brush in (brush for _, flow, brush in motion.triggers if flow > 0.0):
        if brush not in taken | refused.keys():
            try:
                model.require_brushes({*taken, brush})
                taken.add(brush)
            except ModelError as error:
                refused[brush] = str(error)
    if strict or not taken:
        try:
            model.require_brushes(motion.brushes)
        except ModelError as error:
            raise ModelError(f'{motion.source}: {error}') from None
    if not refused:
        return motion
    states = motion.triggers
    kept = np.array([flow == 0.0 or brush in taken for _, flow, brush in states])
    counts = Counter(brush for _, flow, brush in states if flow > 0.0)
    warnings = (
        f'{motion.source}: {counts[brush]} states left out: {reason}'
        for brush, reason in refused.items()
    )
    rows = motion.trigger_rows
    return replace(
        motion, trigger_stamps_ns=motion.trigger_stamps_ns[kept],
        trigger_flow=motion.trigger_flow[kept], trigger_brush=motion.trigger_brush[kept],
        trigger_rows=rows[kept] if len(rows) else rows, warnings=(*motion.warnings, *warnings),
    )  # fmt: skip

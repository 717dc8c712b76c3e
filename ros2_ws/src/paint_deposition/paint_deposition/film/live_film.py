"""The film of a motion that is still under way: feeds ``FilmIntegrator``, which paints."""

import copy
from bisect import bisect_right, insort
from collections.abc import Iterable
from dataclasses import replace
from operator import attrgetter

import numpy as np

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.film.integrator import FilmIntegrator, Precision
from paint_deposition.film.interpolated_brushes import (
    uses_set_points,
    with_brushes_of,
    with_set_points,
)
from paint_deposition.model.brush import BETWEEN
from paint_deposition.motion.path_builder import DEFAULT_MAX_POSE_GAP_S, PathBuilder
from paint_deposition.motion.pose_stream import (
    DEFAULT_LIMIT_POSES,
    MotionLog,
    PoseBatch,
    TriggerChange,
)
from paint_deposition.motion.trajectory import PoseCounts
from paint_deposition.motion.trigger import ONLY_BRUSH
from paint_deposition.part.points import SurfacePoints
from paint_deposition.part.visibility import Occluder

DEFAULT_TRIGGER_LATENCY_S = 0.1
# A trigger change so much older than the newest pose is from a stream that begins again [ns].
ANOTHER_STREAM_NS = 1_000_000_000
# Earlier than any stamp [ns].
BEFORE_ALL_NS = -(2**62)
_STAMP = attrgetter('stamp_ns')


class LiveFilm:
    """Gives poses and trigger changes to the integrator as they come, and can do so again.

    Poses wait until one is newer by the trigger's latency, measured by their stamps: a change of
    the trigger that comes a little later than the poses around it still cuts where it belongs.
    However the poses were batched, the film is the same to the last bit, and the same as that of
    an offline run.

    Without any trigger change the gun always sprays; once one was seen, the gun was off before
    it, as in a recording. What was painted up to then is taken back. With a model of several
    brushes nothing is painted before a change that names one.

    Args:
        points: where the film is wanted.
        model: the deposition model with its effects.
        precision, occluder: as for ``FilmIntegrator``.
        max_pose_gap_s: a longer time between two poses is gun off [s].
        trigger_latency_s: how much later than poses of its time a trigger change may come [s].
        limit_poses: poses to remember, so that they can be painted with another model.
    """

    def __init__(
        self,
        points: SurfacePoints,
        model: DepositionModel,
        *,
        precision: Precision = 'single',
        occluder: Occluder | None = None,
        max_pose_gap_s: float = DEFAULT_MAX_POSE_GAP_S,
        trigger_latency_s: float = DEFAULT_TRIGGER_LATENCY_S,
        limit_poses: int = DEFAULT_LIMIT_POSES,
    ) -> None:
        self.max_pose_gap_s = max_pose_gap_s
        self.trigger_latency_s = trigger_latency_s
        self._limit_poses = limit_poses
        self._integrator = FilmIntegrator(points, model, precision, occluder)
        self._carried: list[TriggerChange] = []
        # Of all changes that were taken, and of those carried over a reset.
        self._brushes: set[int] = set()
        self._clear()

    @property
    def model(self) -> DepositionModel:
        """The model that paints."""
        return self._integrator.model

    @property
    def counts(self) -> PoseCounts:
        """What became of the poses since the last reset."""
        return self._builder.counts

    @property
    def newest_ns(self) -> int | None:
        """Stamp of the newest pose that was kept."""
        return self._builder.newest_ns

    @property
    def _settled_ns(self) -> int:
        """Up to here no trigger change is waited for any more."""
        return (self.newest_ns or 0) - round(self.trigger_latency_s * 1e9)

    @property
    def flow(self) -> float | None:
        """Relative flow at the newest pose; None: no trigger was ever seen."""
        if not (self._changes or self._carried):
            return None
        return self._set_now.flow if self._set_now else 0.0

    @property
    def brush(self) -> int:
        """Number of the brush at the newest pose; 0 is the only one."""
        return self._set_now.brush if self._set_now else ONLY_BRUSH

    @property
    def _set_now(self) -> TriggerChange | None:
        """What holds at the newest pose."""
        changes, newest = self._changes or self._carried, self.newest_ns
        passed = len(changes) if newest is None else bisect_right(changes, newest, key=_STAMP)
        return changes[passed - 1] if passed else None

    @property
    def _sprays_without_trigger(self) -> bool:
        """Not where nothing says with which brush."""
        return len(self.model.brushes) <= 1

    def reset(self) -> None:
        """Back to bare metal; the gun stays as it is, on or off, if the motion goes on."""
        self.carry_on(self)

    def carry_on(self, before: 'LiveFilm') -> None:
        """Begin bare, with the gun as the motion left it that was painted elsewhere before.

        Raises:
            ModelError: the model does not have the brush that it sprays with.
        """
        carried = before._changes or before._carried
        # A brush between the calibrated ones is made anew from its set-points.
        sprayed = {change.brush for change in carried if change.flow > 0.0}
        brushes = {brush for brush in sprayed if brush < BETWEEN}
        self.model.require_brushes(brushes)
        self._carried, self._brushes = carried, brushes
        self._integrator.use(with_brushes_of(self.model, before.model))
        self._clear()

    def _clear(self) -> None:
        self._integrator.reset()
        self._builder = PathBuilder(
            self.max_pose_gap_s, self.model.max_step_m, self.model.needs_whole_strokes
        )
        if not self._sprays_without_trigger:
            self._builder.add_trigger(BEFORE_ALL_NS, 0.0)
        self.log = MotionLog(self._limit_poses)
        self._changes: list[TriggerChange] = []
        self._now: FilmIntegrator | None = None

    def add_trigger(self, change: TriggerChange) -> None:
        """Take a change of the trigger, early, in time or late.

        Raises:
            ModelError: its brush is not in the model, or its set-points lie outside the calibrated
                ones; the change is not taken.
        """
        if change.flow > 0.0:
            change = self._with_its_brush(change)
            self.model.require_brushes({*self._brushes, change.brush})
            self._brushes.add(change.brush)
        self._carry_on(change.stamp_ns)
        if not self._changes and self.log.complete and self.log.poses:
            self._begin_again(change)
            return
        newest = self.newest_ns
        if newest is not None and newest - change.stamp_ns > ANOTHER_STREAM_NS:
            self._changes = []
        self._take_change(change)

    def add_poses(self, batch: PoseBatch) -> None:
        """Take poses and paint what is old enough."""
        if not len(batch):
            return
        self._carry_on(int(batch.stamps_ns[0]))
        self.log.add(batch)
        self._builder.add_poses(batch.stamps_ns, batch.positions_m, batch.quaternions_xyzw)
        self._integrator.add(self._builder.take(self._settled_ns))
        self._now = None

    def follow(self, events: Iterable[TriggerChange | PoseBatch]) -> None:
        """Take what was logged."""
        for event in events:
            if isinstance(event, TriggerChange):
                self.add_trigger(event)
            else:
                self.add_poses(event)

    def up_to_date(self) -> FilmIntegrator:
        """The film of everything received; the film that is painted on stays as it is.

        Strokes under way count as ending here.
        """
        if self._now is None:
            self._now = self._integrator.fork()
            self._now.add(copy.deepcopy(self._builder).take(finish=True))
        return self._now

    def use(self, model: DepositionModel) -> None:
        """Paint with another model from here on; what was painted before stays.

        Raises:
            ModelError: the model does not have a brush that was used.
        """
        model = with_brushes_of(model, self.model)
        always_on = self._sprays_without_trigger and self.flow is None
        model.require_brushes({ONLY_BRUSH} if always_on else self._brushes)
        builder = self._builder
        self._integrator.add(builder.take(self._settled_ns, finish=True))
        self._integrator.use(model)
        builder.max_step_m = model.max_step_m
        builder.whole_strokes = model.needs_whole_strokes
        self._now = None

    def warm_up(self) -> None:
        """Compile and compute all that the model needs, before there is any motion."""
        away = PathBuilder()
        away.add_poses([0, 1_000_000], np.full((2, 3), 1e3), np.tile([0.0, 0.0, 0.0, 1.0], (2, 1)))
        unpainted = self._integrator.fork()
        path = away.take(finish=True)
        unpainted.add(path.with_(brush=np.full(len(path), self.model.brush)))
        _ = unpainted.gauge_um

    def _with_its_brush(self, change: TriggerChange) -> TriggerChange:
        """The change with the number that stands for its set-points, where those choose."""
        if not uses_set_points(self.model, change.brush, change.set_points):
            return change
        model, number = with_set_points(self.model, change.set_points)
        if model is not self.model:
            self._integrator.use(model)
        return replace(change, brush=number)

    def _begin_again(self, first_change: TriggerChange) -> None:
        log = self.log
        self._clear()
        self._take_change(first_change)
        self.follow(log.events())

    def _carry_on(self, stamp_ns: int) -> None:
        """After a reset, keep the trigger of a motion that goes on, drop that of an older one."""
        carried, self._carried = self._carried, []
        if carried and stamp_ns >= carried[0].stamp_ns:
            for change in carried:
                self.add_trigger(change)

    def _take_change(self, change: TriggerChange) -> None:
        self.log.add(change)
        self._builder.add_trigger(change.stamp_ns, change.flow, change.brush)
        # Kept are the changes that count from the newest pose on.
        insort(self._changes, change, key=_STAMP)
        passed = bisect_right(self._changes, self.newest_ns or 0, key=_STAMP)
        del self._changes[: max(0, passed - 1)]
        self._now = None

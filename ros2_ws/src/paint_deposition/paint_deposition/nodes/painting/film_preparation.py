"""Films that are prepared in a thread while the node paints: repainted, or caught up."""

from __future__ import annotations

import tempfile
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from pathlib import Path

import numba
import numpy as np

from paint_deposition.film.common_film import LiveFilms
from paint_deposition.film.live_film import LiveFilm
from paint_deposition.motion.part_frame import PART_POSE_TOPIC
from paint_deposition.motion.pose_stream import BATCH_POSES, MotionLog, PoseBatch, TriggerChange
from paint_deposition.motion.trajectory import Trajectory
from paint_deposition.nodes.painting.atomizer_input import AtomizerInput
from paint_deposition.nodes.runtime.topics import of_gun
from paint_deposition.part.facing import facing
from paint_deposition.part.surface import Surface

# So few poses are left to the thread that paints on: it must not be held up.
REST_POSES = 250
# A recorder writes a chunk when it is half a second old, and looks ten times a second: after so
# long the file holds what came before the first live pose.
WAIT_S = 1.5


def paint_in_one_thread() -> None:
    """Let this thread paint alone; others, one that repaints say, still share their work.

    Motion comes in pieces of milliseconds: threads that wait for the next one would take more of
    the processor than the painting.
    """
    numba.set_num_threads(1)


def index_facing(surface: Surface) -> None:
    """Make what is looked up along a gun's axis, a second's work for a large part."""
    facing(surface, np.zeros((1, 3)), np.eye(3)[2:])


class Preparation:
    """Films under preparation; ``done`` when they are ready, or never will be."""

    def __init__(self, name: str) -> None:
        self._aborted = threading.Event()
        self._prepared: Future[LiveFilms] = Future()
        threading.Thread(target=self._run, name=name, daemon=True).start()

    @property
    def done(self) -> bool:
        return self._prepared.done()

    def abort(self) -> None:
        """Stop as soon as possible; a compilation under way still ends first."""
        self._aborted.set()

    def _run(self) -> None:
        try:
            self._prepared.set_result(self._prepare())
        except BaseException as error:  # it is raised again where the films are taken over
            self._prepared.set_exception(error)

    def _prepare(self) -> LiveFilms:
        raise NotImplementedError

    def _follow(self, film: LiveFilm, events: Iterator[TriggerChange | PoseBatch]) -> None:
        for event in events:
            if self._aborted.is_set():
                return
            film.follow([event])


class Repainting(Preparation):
    """The motion so far painted again with other models, which are compiled first.

    Args:
        current: the films to take over from, one for each gun; they are painted on meanwhile.
        make: makes the bare new ones; called in the thread.
        from_start: whether to paint the motion so far, too.
    """

    def __init__(
        self, current: LiveFilms, make: Callable[[], LiveFilms], from_start: bool = True
    ) -> None:
        self._logs = [gun.log for gun in current.guns]
        self._make = make
        self._from_start = from_start
        super().__init__('repainting')

    def take_over(self, current: LiveFilms) -> LiveFilms | None:
        """The films, brought up to date; call it once ``done``.

        Returns:
            The films to paint on: the new ones, or ``current`` with the new ones' models where
            the motion so far is not painted again. None: the motion is another one by now, begin
            again.

        Raises:
            Exception: whatever went wrong in the thread.
        """
        films = self._prepared.result()
        if not self._from_start or not self._complete:
            for gun, prepared in zip(current.guns, films.guns, strict=True):
                gun.use(prepared.model)
            return current
        if any(gun.log is not log for gun, log in zip(current.guns, self._logs, strict=True)):
            return None
        for film, gun in zip(films.guns, current.guns, strict=True):
            if gun.log.poses or gun.log.changes:
                film.follow(_not_in(film, gun.log))
            else:  # a reset: the gun stays as it was before
                film.carry_on(gun)
        return films

    @property
    def _complete(self) -> bool:
        return all(log.complete for log in self._logs)

    def _prepare(self) -> LiveFilms:
        films = self._make()
        films.warm_up()
        if self._from_start:
            for film, log in zip(films.guns, self._logs, strict=True):
                while log.poses - film.log.poses > REST_POSES and self._complete:
                    self._follow(film, _not_in(film, log))
                    if self._aborted.is_set():
                        break
        return films


def _not_in(film: LiveFilm, log: MotionLog) -> Iterator[TriggerChange | PoseBatch]:
    """What a film that follows a log has not followed yet."""
    return log.events(film.log.poses, film.log.changes)


class CatchingUp(Preparation):
    """What a running recording has of a run in which the node was restarted, painted.

    Args:
        folder: of the recording.
        inputs: of the guns; they hold what comes live, and their ``release`` continues the film.
        make: makes bare films; called in the thread.
        resolved: the full name of a topic.
        frame_id, part_pose: the part's frame, and its pose or [].

    Attributes:
        folder: the same.
        summary: what was painted, once ``done``.
    """

    def __init__(
        self,
        folder: str,
        inputs: Sequence[AtomizerInput],
        make: Callable[[], LiveFilms],
        resolved: Callable[[str], str],
        frame_id: str,
        part_pose: Sequence[float],
    ) -> None:
        self.folder = Path(folder)
        self.summary = ''
        self._inputs, self._make, self._resolved = inputs, make, resolved
        self._frame_id, self._part_pose = frame_id, list(part_pose)
        for source in inputs:
            source.hold()
        super().__init__('catching up')

    def result(self) -> LiveFilms:
        """The films with all that came before the first pose that is held.

        Raises:
            PaintError: the recording cannot be read.
        """
        return self._prepared.result()

    def _prepare(self) -> LiveFilms:
        films = self._make()
        if self._aborted.wait(WAIT_S):
            return films
        names = [source.name for source in self._inputs]
        with tempfile.TemporaryDirectory() as place:
            motions = self._read(names, Path(place) / 'run')
        said = []
        for film, motion, source in zip(films.guns, motions, self._inputs, strict=True):
            poses, states = source.held_stamps()
            first_ns = min(poses, default=np.iinfo(np.int64).max)
            missed = motion.stamps_ns < first_ns
            count = int(np.count_nonzero(missed))
            words = f'{count} poses{f" of {source.name}" if source.name else ""}'
            if poses and count:
                apart_ms = (first_ns - int(motion.stamps_ns[missed][-1])) * 1e-6
                words += f', {apart_ms:.0f} ms before the first live one'
            said.append(words)
            self._follow(film, _events(motion, missed, set(states)))
        self.summary = '; '.join(said)
        return films

    def _read(self, names: Sequence[str], place: Path) -> list[Trajectory]:
        # Libraries that only a node loads which catches up.
        from paint_deposition.files.motion_files import read_recording
        from paint_deposition.files.recordings.bag_files import open_bag
        from paint_deposition.files.recordings.mcap_recovery import recover

        topics = [
            (self._resolved(of_gun(name, 'atomizer/pose')),
             self._resolved(of_gun(name, 'atomizer/state')))
            for name in names
        ]  # fmt: skip
        wanted = {topic for pair in topics for topic in pair}
        wanted |= {self._resolved(PART_POSE_TOPIC), '/tf', '/tf_static'}
        run = recover(self.folder, place, topics=wanted).folder
        with open_bag(run) as bag:
            there = {states for _, states in topics if bag.find(states) is not None}
        return [
            read_recording(
                run,
                pose_topic=poses,
                state_topic=states if states in there else None,
                frame_id=self._frame_id,
                part_pose=self._part_pose or None,
            )
            for poses, states in topics
        ]


def _events(
    motion: Trajectory, rows: np.ndarray, without_ns: set[int]
) -> Iterator[PoseBatch | TriggerChange]:
    """The poses of these rows (N,), each change before the poses that it holds for.

    Changes of the stamps ``without_ns`` are left out.
    """
    stamps = motion.stamps_ns[rows]
    poses = PoseBatch(stamps, motion.positions_m[rows], motion.quaternions_xyzw[rows])
    start = 0
    for number, (stamp_ns, flow, brush) in enumerate(motion.triggers):
        if stamp_ns not in without_ns:
            end = max(start, int(np.searchsorted(stamps, stamp_ns)))
            yield from _batches(poses, start, end)
            yield TriggerChange(stamp_ns, flow, brush, motion.set_points_of(number))
            start = end
    yield from _batches(poses, start, len(poses))


def _batches(poses: PoseBatch, start: int, end: int) -> Iterator[PoseBatch]:
    for first in range(start, end, BATCH_POSES):
        yield poses.select(slice(first, min(first + BATCH_POSES, end)))

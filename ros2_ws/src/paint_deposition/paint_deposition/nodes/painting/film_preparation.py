"""Films that are painted again in a thread, with other models, while the node paints on."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future

import numba
import numpy as np

from paint_deposition.film.common_film import LiveFilms
from paint_deposition.film.live_film import LiveFilm
from paint_deposition.motion.pose_stream import MotionLog, PoseBatch, TriggerChange
from paint_deposition.part.facing import facing
from paint_deposition.part.surface import Surface

# So few poses are left to the thread that paints on: it must not be held up.
REST_POSES = 250


def paint_in_one_thread() -> None:
    """Let this thread paint alone; others, one that repaints say, still share their work.

    Motion comes in pieces of milliseconds: threads that wait for the next one would take more of
    the processor than the painting.
    """
    numba.set_num_threads(1)


def index_facing(surface: Surface) -> None:
    """Make what is looked up along a gun's axis, a second's work for a large part."""
    facing(surface, np.zeros((1, 3)), np.eye(3)[2:])


class Repainting:
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
        self._aborted = threading.Event()
        self._prepared: Future[LiveFilms] = Future()
        threading.Thread(target=self._run, name='repainting', daemon=True).start()

    @property
    def done(self) -> bool:
        """Whether the films are ready, or never will be."""
        return self._prepared.done()

    def abort(self) -> None:
        """Stop as soon as possible; a compilation under way still ends first."""
        self._aborted.set()

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

    def _run(self) -> None:
        try:
            self._prepared.set_result(self._prepare())
        except BaseException as error:  # it is raised again where the films are taken over
            self._prepared.set_exception(error)

    def _prepare(self) -> LiveFilms:
        films = self._make()
        films.warm_up()
        if self._from_start:
            for film, log in zip(films.guns, self._logs, strict=True):
                while log.poses - film.log.poses > REST_POSES and self._complete:
                    for event in _not_in(film, log):
                        if self._aborted.is_set():
                            return films
                        film.follow([event])
        return films


def _not_in(film: LiveFilm, log: MotionLog) -> Iterator[TriggerChange | PoseBatch]:
    """What a film that follows a log has not followed yet."""
    return log.events(film.log.poses, film.log.changes)

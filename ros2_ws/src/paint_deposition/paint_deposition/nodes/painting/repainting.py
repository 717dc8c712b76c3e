"""A motion painted again with other models while it goes on."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future

from paint_deposition.film.common_film import LiveFilms
from paint_deposition.film.live_film import LiveFilm
from paint_deposition.motion.pose_stream import MotionLog, PoseBatch, TriggerChange

# So few poses are left to the thread that paints on: it must not be held up.
REST_POSES = 250
# A thread that wants the interpreter gets it after so long; poses come every four milliseconds.
SWITCH_INTERVAL_S = 0.0005


class Repainting:
    """Prepares films in a thread: what must be compiled is, and the motion so far is painted.

    The films that it takes over from go on meanwhile. Compiling takes seconds, a long motion
    more; ``done`` tells when it is over.

    Args:
        current: the films to take over from, one for each gun.
        make: makes the bare new ones; called in the thread.
        from_start: whether to paint the motion so far, too.
    """

    def __init__(
        self, current: LiveFilms, make: Callable[[], LiveFilms], from_start: bool = True
    ) -> None:
        self._logs = [gun.log for gun in current.guns]
        self._make = make
        self._from_start = from_start
        self._given_up = threading.Event()
        self._prepared: Future[LiveFilms] = Future()
        sys.setswitchinterval(min(SWITCH_INTERVAL_S, sys.getswitchinterval()))
        threading.Thread(target=self._run, name='repainting', daemon=True).start()

    @property
    def done(self) -> bool:
        """Whether the films are ready, or never will be."""
        return self._prepared.done()

    def give_up(self) -> None:
        """Stop as soon as possible; a compilation under way still ends first."""
        self._given_up.set()

    def take_over(self, current: LiveFilms) -> LiveFilms | None:
        """The films, brought up to date; call it once ``done``.

        Returns:
            The films that go on: the new ones, or ``current`` with the new ones' models where the
            motion so far is not painted again. None: the motion is another one by now, begin
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
        for film, log in zip(films.guns, self._logs, strict=True):
            film.follow(_not_in(film, log))
        return films

    @property
    def _complete(self) -> bool:
        return all(log.complete for log in self._logs)

    def _run(self) -> None:
        try:
            films = self._make()
            films.warm_up()
            if self._from_start:
                for film, log in zip(films.guns, self._logs, strict=True):
                    self._paint(film, log)
            self._prepared.set_result(films)
        except BaseException as error:  # it is raised again where the films are taken over
            self._prepared.set_exception(error)

    def _paint(self, film: LiveFilm, log: MotionLog) -> None:
        while log.poses - film.log.poses > REST_POSES and self._complete:
            for event in _not_in(film, log):
                if self._given_up.is_set():
                    return
                film.follow([event])


def _not_in(film: LiveFilm, log: MotionLog) -> Iterator[TriggerChange | PoseBatch]:
    """What a film that follows a log has not followed yet."""
    return log.events(film.log.poses, film.log.changes)

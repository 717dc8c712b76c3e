"""A motion painted again with another model while it goes on."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable
from concurrent.futures import Future

from paint_deposition.film.live_film import LiveFilm
from paint_deposition.motion.motion_log import merged

# So few poses are left to the thread that paints on: it must not be held up.
REST_POSES = 250
# A thread that wants the interpreter gets it after so long; poses come every four milliseconds.
SWITCH_INTERVAL_S = 0.0005


class Repainting:
    """Prepares a film in a thread: what must be compiled is, and the motion so far is painted.

    The film that it takes over from goes on meanwhile. Compiling takes seconds, a long motion
    more; ``done`` tells when it is over.

    Args:
        current: the film to take over from.
        make: makes the bare new one; called in the thread.
        from_start: whether to paint the motion so far, too.
    """

    def __init__(
        self, current: LiveFilm, make: Callable[[], LiveFilm], from_start: bool = True
    ) -> None:
        self._log = current.log
        self._make = make
        self._from_start = from_start
        self._given_up = threading.Event()
        self._followed = 0
        self._prepared: Future[LiveFilm] = Future()
        sys.setswitchinterval(min(SWITCH_INTERVAL_S, sys.getswitchinterval()))
        threading.Thread(target=self._run, name='repainting', daemon=True).start()

    @property
    def done(self) -> bool:
        """Whether the film is ready, or never will be."""
        return self._prepared.done()

    def give_up(self) -> None:
        """Stop as soon as possible; a compilation under way still ends first."""
        self._given_up.set()

    def take_over(self, current: LiveFilm) -> LiveFilm | None:
        """The film, brought up to date; call it once ``done``.

        Returns:
            The film that goes on: the new one, or ``current`` with the new one's model where the
            motion so far is not painted again. None: the motion is another one by now, begin
            again.

        Raises:
            Exception: whatever went wrong in the thread.
        """
        film = self._prepared.result()
        if not self._from_start or not self._log.complete:
            current.use(film.model)
            return current
        if current.log is not self._log:
            return None
        film.follow(self._log.events[self._followed :])
        return film

    def _run(self) -> None:
        try:
            film = self._make()
            film.warm_up()
            if self._from_start:
                self._paint(film)
            self._prepared.set_result(film)
        except BaseException as error:  # it is raised again where the film is taken over
            self._prepared.set_exception(error)

    def _paint(self, film: LiveFilm) -> None:
        while not self._given_up.is_set() and self._log.complete:
            events = self._log.events[self._followed :]
            if self._log.poses - film.log.poses <= REST_POSES:
                return
            for event in merged(events):
                if self._given_up.is_set():
                    return
                film.follow([event])
            self._followed += len(events)

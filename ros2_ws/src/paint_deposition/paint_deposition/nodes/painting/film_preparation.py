"""Films that are painted again in a thread, with other models, while the node paints on."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future

from paint_deposition.film.common_film import LiveFilms

# So few poses are left to the thread that paints on: it must not be held up.
REST_POSES = 250


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
                film.follow(gun.log.events(film.log.poses, film.log.changes))
            else:  # a reset: the gun stays as it was before
                film.carry_on(gun)
        return films

    @property
    def _complete(self) -> bool:
        return all(log.complete for log in self._logs)

    def _run(self) -> None:
        try:
            films = self._make()
            films.warm_up()
            if self._from_start:
                self._follow(films)
            self._prepared.set_result(films)
        except BaseException as error:  # it is raised again where the films are taken over
            self._prepared.set_exception(error)

    def _follow(self, films: LiveFilms) -> None:
        for film, log in zip(films.guns, self._logs, strict=True):
            while log.poses - film.log.poses > REST_POSES and self._complete:
                for event in log.events(film.log.poses, film.log.changes):
                    if self._aborted.is_set():
                        return
                    film.follow([event])

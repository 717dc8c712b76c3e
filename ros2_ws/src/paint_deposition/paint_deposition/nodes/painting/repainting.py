"""Painting the motion so far again: with other models, or on the other side of the part."""

import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future

from paint_deposition.film.common_film import LiveFilms
from paint_deposition.film.live_film import LiveFilm
from paint_deposition.part.facing import facing, toward_the_gun
from paint_deposition.part.surface import Surface

POSES_CONSIDERED = 2000


class Repainting:
    """Compiles models in a thread and repaints the motion so far with them.

    Args:
        current: the films to replace, one for each gun; painting goes on in them meanwhile.
        make: creates the new, unpainted films; called in the thread.
        from_start: whether to repaint the motion so far.
    """

    def __init__(
        self, current: LiveFilms, make: Callable[[], LiveFilms], from_start: bool
    ) -> None:
        self._logs = [gun.log for gun in current.guns]
        self._make = make
        self._from_start = from_start
        self._aborted = threading.Event()
        self._prepared: Future[LiveFilms] = Future()
        threading.Thread(target=self._run, name='repainting', daemon=True).start()

    @property
    def done(self) -> bool:
        """Whether the thread has ended, with films or with an error."""
        return self._prepared.done()

    def abort(self) -> None:
        """Stop as soon as possible, but after a compilation under way."""
        self._aborted.set()

    def result(self, current: LiveFilms) -> LiveFilms | None:
        """The films to continue with, up to date; call it once ``done``.

        Returns:
            The new films, or ``current`` with the new models if the motion so far is not
            repainted. None if the motion was restarted meanwhile: repaint again.

        Raises:
            Exception: whatever was raised in the thread.
        """
        films = self._prepared.result()
        if not self._from_start or not self._complete:
            for gun, prepared in zip(current.guns, films.guns, strict=True):
                gun.switch_model(prepared.model)
            return current
        if any(gun.log is not log for gun, log in zip(current.guns, self._logs, strict=True)):
            return None
        for film, gun in zip(films.guns, current.guns, strict=True):
            film.replay(gun.log.events(film.log.poses, film.log.changes))
        return films

    @property
    def _complete(self) -> bool:
        return all(log.complete for log in self._logs)

    def _run(self) -> None:
        try:
            films = self._make()
            films.warm_up()
            if self._from_start:
                self._repaint(films)
            self._prepared.set_result(films)
        except BaseException as error:  # raised again by `result`
            self._prepared.set_exception(error)

    def _repaint(self, films: LiveFilms) -> None:
        for film, log in zip(films.guns, self._logs, strict=True):
            # The rest is for the thread of the executor, which must not be blocked.
            while log.poses - film.log.poses > 250 and self._complete:
                for event in log.events(film.log.poses, film.log.changes):
                    if self._aborted.is_set():
                        return
                    film.replay([event])


class OutwardSide:
    """Decides the outward side by the poses of the first gun that points at the part.

    An earlier gun may still overrule a later one, as long as its own poses have not decided: the
    side does not depend on whose poses arrive first.
    """

    def __init__(self, gun_count: int) -> None:
        self._undecided = list(range(gun_count))

    def orient(self, surface: Surface, guns: Sequence[LiveFilm]) -> Surface:
        """The surface with its outward side toward the guns, by their poses so far."""
        for number in tuple(self._undecided):
            poses = guns[number].log.first_poses(POSES_CONSIDERED)
            if poses is None:
                continue
            positions, axes = poses.finite_axes()
            front, back, _ = facing(surface, positions, axes)
            pointing = front + back
            # So many that point at the part, or so many in all, have decided.
            decided = pointing >= 50 or len(poses) >= POSES_CONSIDERED
            if decided:
                self._undecided.remove(number)
            if pointing:
                if decided:
                    self._undecided = [gun for gun in self._undecided if gun < number]
                return toward_the_gun(surface, positions, axes)
        return surface

"""The one film that several guns lay on a part, and the sum of several such films."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from paint_deposition.effects.base import Effect
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import ModelError
from paint_deposition.film.coats import TOTAL, Coats, sum_um
from paint_deposition.film.integrator import FilmIntegrator, after_film_effects, gauge_reading_um
from paint_deposition.film.live_film import LiveFilm
from paint_deposition.film.paint_used import PaintUsed
from paint_deposition.motion.trajectory import PoseCounts


@dataclass(frozen=True)
class CommonFilm:
    """What guns with an integrator each, at least one, laid on the same points.

    The shares are added in the order of the guns: the film does not depend on whose poses came
    first. What acts on the finished film, sag say, acts on the sum, as the first gun's model has
    it; see ``require_one_finish``.
    """

    guns: tuple[FilmIntegrator, ...]

    @cached_property
    def shares_um(self) -> tuple[np.ndarray, ...]:
        """(V,) what each gun had laid when this was first used, as it arrived [um]."""
        return tuple(gun.raw_um for gun in self.guns)

    @property
    def raw_um(self) -> np.ndarray:
        """(V,) film as it arrived, before effects on the film [um]."""
        first, *others = self.shares_um
        return sum(others, first)

    @property
    def film_um(self) -> np.ndarray:
        """(V,) film [um]."""
        return after_film_effects(self.raw_um, self._effects, self.guns[0].points)

    @property
    def gauge_um(self) -> np.ndarray:
        """(V,) what a gauge shows on that film [um]."""
        return gauge_reading_um(self.film_um, self._effects, self.guns[0].points)

    @property
    def used(self) -> PaintUsed:
        """Paint that left the guns."""
        return sum((gun.used for gun in self.guns), PaintUsed())

    @property
    def emitted_cm3(self) -> float:
        """See ``PaintUsed``."""
        return self.used.emitted_cm3

    def laid_cm3(self, areas_m2: np.ndarray) -> np.ndarray:
        """(G,) solids that each gun laid on vertices of (V,) these areas [m2], as in a share."""
        return np.array([float(np.sum(share_um * areas_m2)) for share_um in self.shares_um])

    @property
    def _effects(self) -> list[Effect]:
        return [effect for effect in self.guns[0].model.effects if not effect.is_neutral]

    def of_guns(self, rows: slice) -> 'CommonFilm':
        """What some of the guns laid."""
        return CommonFilm(self.guns[rows])


@dataclass(frozen=True)
class LayeredFilm:
    """What guns laid in coats: what acts on the finished film acts on each wet film by itself."""

    guns: CommonFilm
    coats: Coats

    def film_um(self, layer: str = TOTAL) -> np.ndarray:
        """(V,) film of a layer [um], see ``Coats.films_of``."""
        films = self.coats.films_of(layer)
        return sum_um((sign, self.guns.of_guns(rows).film_um) for sign, rows in films)

    def gauge_um(self, layer: str = TOTAL) -> np.ndarray:
        """(V,) what a gauge shows that sees this layer alone [um]."""
        first = self.guns.guns[0]
        return gauge_reading_um(self.film_um(layer), first.model.effects, first.points)


@dataclass(frozen=True)
class LiveFilms:
    """The films of one or more guns that paint the same points, each of a motion under way."""

    guns: tuple[LiveFilm, ...]

    @property
    def counts(self) -> PoseCounts:
        """What became of the poses of all guns since the last reset; the longest of their gaps."""
        return PoseCounts.of_guns([gun.counts for gun in self.guns])

    @property
    def newest_ns(self) -> int | None:
        """Stamp of the newest pose of any gun that was kept."""
        return max((gun.newest_ns for gun in self.guns if gun.newest_ns is not None), default=None)

    @property
    def complete(self) -> bool:
        """Whether all motion so far is remembered and can be painted again."""
        return all(gun.log.complete for gun in self.guns)

    def snapshot(self) -> CommonFilm:
        """The film of everything received so far; equal to the last one if nothing was."""
        return CommonFilm(tuple(gun.snapshot() for gun in self.guns))

    def reset(self) -> None:
        """Clear the film."""
        for gun in self.guns:
            gun.reset()

    def warm_up(self) -> None:
        """Compile the models and compute all they need, before there is any motion."""
        for gun in self.guns:
            gun.warm_up()


def require_one_finish(
    models: Mapping[str, DepositionModel], places: Sequence[str] = ('on_film', 'on_gauge')
) -> None:
    """Refuse models, by the name of their gun, that let different things happen to one film.

    Args:
        places: where effects are compared, methods of ``Effect``.

    Raises:
        ModelError: naming two guns and the effects on film or gauge in which they differ.
    """
    finishes = {
        gun: [e for e in model.effects if not e.is_neutral and e.acts(*places)]
        for gun, model in models.items()
    }
    (first, reference), *others = finishes.items()
    for gun, finish in others:
        if finish != reference:
            differ = ', '.join(dict.fromkeys(e.id for e in (*reference, *finish)))
            raise ModelError(
                f'the models of {first} and {gun} differ in what acts on the finished film, which '
                f'they share ({differ}): give both the same values of it, in the same order'
            )

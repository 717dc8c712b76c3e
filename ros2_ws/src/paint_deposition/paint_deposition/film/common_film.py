"""The film that several guns lay on a part, in one coat or in several."""

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, reduce
from itertools import accumulate, groupby

import numpy as np

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import ModelError, PaintError
from paint_deposition.film.integrator import FilmIntegrator, after_effects
from paint_deposition.film.live_film import LiveFilm
from paint_deposition.film.statistics import PaintUsed
from paint_deposition.motion.trajectory import PoseCounts

# What a layer is called that has all coats.
TOTAL = 'total'
# A layer as the sum of wet films: of each the sign, and its guns or the sub-steps of its path.
WetFilms = tuple[tuple[int, slice], ...]
ONE_FILM: WetFilms = ((1, slice(None)),)
# Also the name of a column.
NAME = re.compile(r'[^\W\d][\w-]*')


def sum_um(films: Iterable[tuple[int, np.ndarray]]) -> np.ndarray:
    """(V,) sum of films (V,) [um], each with its sign."""
    return reduce(np.add, (sign * film_um for sign, film_um in films))


@dataclass(frozen=True)
class Coats:
    """Coats in the order of painting, each laid by one gun or several."""

    names: tuple[str, ...]  # (C,) each once; '' is the only coat, of which nothing more is known
    on_wet: tuple[bool, ...]  # (C,) whether each was laid while the one before it was wet
    ends: tuple[int, ...]  # (C,) number of guns that laid it or a coat before it

    @staticmethod
    def of_guns(coats: Sequence[str], guns: int, on_wet: Collection[str] = ()) -> 'Coats':
        """The coats, by the name of that which each gun lays; without names the guns lay one.

        Args:
            on_wet: those laid while the one before was wet; of the first it means nothing.

        Raises:
            PaintError: a name that cannot be one, is there again after another, or is missing.
        """
        if not coats:
            return Coats(('',), (False,), (guns,))
        if len(coats) != guns:
            raise PaintError(
                f'{len(coats)} names of coats for {guns} motions: name the coat of each, in the '
                'order of painting'
            )
        names, counts = zip(*((name, len([*run])) for name, run in groupby(coats)), strict=True)
        for name in names:
            if not NAME.fullmatch(name) or name in (TOTAL, 'thickness'):
                raise PaintError(
                    f"no coat can be called '{name}'; give a letter, then letters, digits, _ and "
                    f"-, and neither '{TOTAL}' nor 'thickness'"
                )
            if names.count(name) > 1:
                raise PaintError(
                    f"coat '{name}' is painted, then another, then '{name}' again; give each coat "
                    'a name of its own'
                )
        wet = tuple(k > 0 and name in on_wet for k, name in enumerate(names))
        return Coats(names, wet, tuple(accumulate(counts)))

    def by_layer(self, layers: np.ndarray) -> dict[str, np.ndarray]:
        """(N,) masks of the readings of each layer, by its name with the coats in their order.

        The only coat without a name is seen by all of them.

        Args:
            layers: (N,) as readings name them: a coat, several as in 'base+clear', 'total' or ''.

        Raises:
            PaintError: a layer has a coat that there is not.
        """
        if self.names == ('',):
            return {TOTAL: np.ones(len(layers), dtype=bool)}
        called = {}
        for layer in dict.fromkeys(layers.tolist()):
            coats = self._coats_of(layer)
            one_of_many = len(coats) < len(self.names)
            called[layer] = '+'.join(self.names[k] for k in coats) if one_of_many else TOTAL
        names = np.array([called[layer] for layer in layers.tolist()])
        return {name: names == name for name in dict.fromkeys(called.values())}

    def films_of(self, layer: str) -> WetFilms:
        """The wet films, by their guns, whose sum a layer is.

        What a coat adds to a film that is still wet is the film with it less the film before it.
        """
        found: dict[tuple[int, int], int] = {}
        for k in self._coats_of(layer):
            first = k
            while self.on_wet[first]:
                first -= 1
            for stop, sign in ((k + 1, 1), (k, -1)):
                if stop > first:
                    found[first, stop] = found.get((first, stop), 0) + sign
        return tuple((sign, self.guns(*span)) for span, sign in found.items() if sign)

    def guns(self, first: int, stop: int) -> slice:
        """The guns that laid the coats from one number to before another."""
        return slice(self.ends[first - 1] if first else 0, self.ends[stop - 1])

    def _coats_of(self, layer: str) -> list[int]:
        """Numbers of the coats of a layer, from 0."""
        if layer.casefold() in ('', TOTAL):
            return [*range(len(self.names))]
        small = [name.casefold() for name in self.names]
        coats = [part.strip() for part in layer.split('+')]
        for coat in coats:
            if coat.casefold() not in small:
                raise PaintError(
                    f"layer '{layer}' has no coat of the part; its coats: "
                    f'{", ".join(self.names)}; base+clear names a sum, {TOTAL} all of them'
                )
        return sorted({small.index(coat.casefold()) for coat in coats})


@dataclass(frozen=True)
class CommonFilm:
    """What guns with an integrator each, at least one, laid on the same points.

    The shares are added in the order of the guns: the film does not depend on whose poses came
    first. What acts on the finished film, sag say, acts on the sum, as the first gun's model has
    it; see ``require_same_film_effects``.
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
        gun = self.guns[0]
        return after_effects('on_film', self.raw_um, gun.model.effects, gun.points)

    @property
    def gauge_um(self) -> np.ndarray:
        """(V,) what a gauge shows on that film [um]."""
        gun = self.guns[0]
        return after_effects('on_gauge', self.film_um, gun.model.effects, gun.points)

    @property
    def used(self) -> PaintUsed:
        """Paint that left the guns."""
        return sum((gun.used for gun in self.guns), PaintUsed())

    def laid_cm3(self, areas_m2: np.ndarray) -> np.ndarray:
        """(G,) solids that each gun laid on vertices of (V,) these areas [m2], as in a share."""
        return np.array([float(np.sum(share_um * areas_m2)) for share_um in self.shares_um])

    def layer_um(self, coats: Coats, layer: str = TOTAL) -> np.ndarray:
        """(V,) film of a layer [um], see ``Coats.films_of``.

        What acts on the finished film acts on each wet film by itself.
        """
        return sum_um(
            (sign, CommonFilm(self.guns[rows]).film_um) for sign, rows in coats.films_of(layer)
        )


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

    def snapshot(self) -> CommonFilm:
        """The film of everything received so far; equal to the last one if nothing was."""
        return CommonFilm(tuple(gun.snapshot() for gun in self.guns))

    def reset(self) -> None:
        """Clear the film; one that no pose has reached forgets no change of a gun."""
        for gun in self.guns if self.counts.received else ():
            gun.reset()


def require_same_film_effects(
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

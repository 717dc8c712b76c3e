"""Coats on a part: which guns lay a layer, and which of its coats were one wet film."""

import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import accumulate, groupby

import numpy as np

from paint_deposition.errors import PaintError

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
    """Coats in the order of painting, each laid by one gun or several.

    Attributes:
        names: (C,) each once; '' is the only coat, of which nothing more is known.
        on_wet: (C,) whether each was laid while the one before it was wet.
        ends: (C,) number of guns that laid it or a coat before it.
    """

    names: tuple[str, ...]
    on_wet: tuple[bool, ...]
    ends: tuple[int, ...]

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

    def guns_of(self, name: str) -> slice:
        """The guns that laid one of the coats."""
        k = self.names.index(name)
        return self._guns(k, k + 1)

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
        called = {layer: self._called(layer) for layer in dict.fromkeys(layers.tolist())}
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
        return tuple((sign, self._guns(*span)) for span, sign in found.items() if sign)

    def _guns(self, first: int, stop: int) -> slice:
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

    def _called(self, layer: str) -> str:
        coats = self._coats_of(layer)
        one_of_many = len(coats) < len(self.names)
        return '+'.join(self.names[k] for k in coats) if one_of_many else TOTAL

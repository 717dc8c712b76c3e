"""Everything that may be missing, as directions in which the readings would then deviate.

An effect explains by its law, whose sensitivities span the first directions, and by the error of
that law: a smooth relative error along the covariates that the effect itself names, in proportion
to the effect. An effect that names a free law also explains by any smooth curve over its own
covariate. Shapeless explanations stand for causes outside the library, and deviations of the
pattern for a footprint that is no two Gaussians.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from paint_deposition.effects.base import Effect
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.effects.learned.curves import CURVES
from paint_deposition.inference.diagnosis.sensitivities import Sensitivity, sensitivity
from paint_deposition.inference.diagnosis.smooth_laws import (
    NEGLIGIBLE,
    RandomLaw,
    curve_basis,
    footprint_basis,
    footprint_kinds,
    map_bases,
)
from paint_deposition.inference.fitting.least_squares import Fit
from paint_deposition.inference.fitting.smooth_fields import field_over_values, fields_over_parts
from paint_deposition.inference.fitting.study import Study

UNKNOWN, FOOTPRINT = 'unknown', 'footprint'
# Relative error of a law, as a standard deviation, and its length of correlation in standard
# deviations of the covariate.
LAW_ERROR, LAW_LENGTH = 0.3, 1.0
# The size of an effect is what it changes at this share of the points at the most.
LARGEST = 0.95
# Prior share of the law against a free law over the effect's own covariate.
LAW_SHARE = 0.7
# Free laws: size of a factor, of an addition [um], and lengths of correlation.
FREE_FACTOR, FREE_ADDITION_UM, FREE_LENGTHS = 0.05, 0.7, (1.0, 2.0)
# Share of all ups and downs of a free law that may go against its direction: noise bends it.
MOST_WRONG_WAY = 0.2
# Shapeless causes: size as a share of the film; over a covariate that an effect owns only what is
# too wiggly to be that effect's law.
FIELD_SHARE, PART_SHARE = 0.05, 0.5
WIGGLY, SMOOTH = 0.35, 1.0
FOOTPRINT_SHARE = 0.05
# Lengths of correlation over the part [m], and over the radius of the pattern in steps.
LENGTHS = {'place': (0.1, 0.25), 'footprint': (1.5, 4.0)}


@dataclass(frozen=True)
class Explanation:
    """One way in which a cause explains the readings.

    Attributes:
        cause: an effect's id, ``UNKNOWN`` or ``FOOTPRINT``.
        columns: (P, n) directions over the noise, for amplitudes of unit variance.
        sides: (n,) +1 or -1 where physics fixes the sign of an amplitude, else 0.
        share: prior share of this explanation among those of its cause.
        sensitivity: the law of an effect whose directions come first, or None.
        random: the law of any form whose amplitudes the directions are, or None.
        directions: in one of which that law must go to be this cause: it rises (1), falls (-1),
            or either (0); in none of them, if it is shapeless: then it would be an effect.
        description: in words, for a shapeless one.
    """

    cause: str
    columns: np.ndarray
    sides: np.ndarray
    share: float
    sensitivity: Sensitivity | None = None
    random: RandomLaw | None = None
    directions: tuple[int, ...] = ()
    description: str = ''

    def goes_right(self, amounts: np.ndarray) -> np.ndarray:
        """(...) whether laws with these amplitudes (..., n) go in a direction of their cause."""
        if self.random is None or not self.directions:
            return np.ones(amounts.shape[:-1], dtype=bool)
        steps = np.diff(amounts @ self.random.at_knots.T)
        up, down = np.maximum(steps, 0.0).sum(axis=-1), -np.minimum(steps, 0.0).sum(axis=-1)
        wrong = {1: down, -1: up, 0: np.minimum(up, down)}
        least = np.min([wrong[direction] for direction in self.directions], axis=0)
        return (least <= MOST_WRONG_WAY * (up + down)) == (self.cause != UNKNOWN)

    @property
    def learns(self) -> str:
        """Covariate of the learned law that it may become; '' if it cannot."""
        return self.random.basis.law.covariate if self.random else ''

    @property
    def law(self) -> np.ndarray:
        """(P, m) directions without the error of the law."""
        return self.columns if self.sensitivity is None else self.sensitivity.columns

    def select(self, rows: np.ndarray) -> 'Explanation':
        """The same for some of the readings; sensitivity and law stay those of all."""
        return replace(self, columns=self.columns[rows])


def explanations(
    study: Study, fit: Fit, candidates: Mapping[str, list[Effect]]
) -> list[Explanation]:
    """All explanations at a fitted model.

    Args:
        study: the readings.
        fit: where to linearise; effects that are part of its model explain nothing more.
        candidates: effects in the shapes to try, by id.
    """
    model = fit.model
    covariates = _covariates(study, model)
    roots = {
        name: field_over_values(values, LAW_LENGTH, NEGLIGIBLE)
        for name, values in covariates.items()
    }
    found: list[Explanation] = []
    for name, shapes in candidates.items():
        if model.effect(name) is None:
            found += _of_effect(study, fit, shapes, roots)
    owned: dict[str, tuple[int, ...]] = {}
    for effect in (type(shapes[0]) for shapes in candidates.values()):
        for name, direction in effect.covariates.items() if effect.free_law else ():
            owned[name] = (*owned.get(name, ()), direction)
    found += _shapeless(study, model, covariates, owned)
    basis = footprint_basis(study, model)
    kinds = [
        basis.random(FOOTPRINT_SHARE, length, among)
        for length in LENGTHS['footprint']
        for among in footprint_kinds()
    ]
    found += [of_random(FOOTPRINT, study, random, 1.0 / len(kinds)) for random in kinds]
    # A model has each learned law once.
    known = {type(effect) for effect in model.effects}
    return [
        replace(e, random=None) if e.random and e.random.basis.law in known else e for e in found
    ]


def law_errors(study: Study, fit: Fit, kept: frozenset[str]) -> np.ndarray:
    """(P, n) directions over the noise in which the laws of effects in a model may be off.

    Args:
        study: the readings.
        fit: of the model.
        kept: ids of the effects.
    """
    covariates = _covariates(study, fit.model)
    film = study.forward.predict_um(fit.model)
    found = [np.empty((len(study), 0))]
    for effect in (e for e in fit.model.effects if e.id in kept):
        others = tuple(e for e in fit.model.effects if e.id != effect.id)
        without = fit.model.model_copy(update={'effects': others})
        change = film - study.forward.predict_um(without)
        own = [name for name in effect.covariates if name in covariates]
        for name in own:
            scale = LAW_ERROR / np.sqrt(len(own))
            basis = None
            if effect.free_law and name in CURVES:
                basis = curve_basis(study, fit.model, name, effect.free_law)
            if basis is None:
                columns = (
                    scale
                    * change[:, np.newaxis]
                    * field_over_values(covariates[name], LAW_LENGTH, NEGLIGIBLE)
                )
            else:
                relative = change if effect.free_law == 'addition' else change / film
                size = scale * float(np.quantile(np.abs(relative), LARGEST))
                has = study.has(type(effect))[:, np.newaxis]
                columns = has * basis.random(size, LAW_LENGTH).change_um
            found.append(columns / study.sigma_um[:, np.newaxis])
    return np.hstack(found)


def _covariates(study: Study, model: DepositionModel) -> dict[str, np.ndarray]:
    """(P,) each, in standard deviations from its mean."""
    return {
        c.name: (c.values - c.values.mean()) / c.values.std()
        for c in study.covariates(model)
        if c.varies
    }


def of_random(
    cause: str,
    study: Study,
    random: RandomLaw,
    share: float,
    directions: tuple[int, ...] = (),
    description: str = '',
) -> Explanation:
    """A random law as an explanation, its directions over the noise of the study."""
    columns = random.change_um / study.sigma_um[:, np.newaxis]
    return Explanation(
        cause, columns, np.zeros(columns.shape[1]), share, random=random,
        directions=directions, description=description,
    )  # fmt: skip


def _of_effect(
    study: Study, fit: Fit, shapes: list[Effect], roots: dict[str, np.ndarray]
) -> Iterator[Explanation]:
    """By the law in each shape, its error included, and by free laws."""
    effect = type(shapes[0])
    own = [name for name in effect.covariates if name in roots]
    # A law of any form acts on all parts; an effect may be switched off on some.
    wanted = effect.free_law and study.has(effect).all()
    free = _free_laws(study, fit.model, effect) if wanted else []
    law_share = LAW_SHARE if free else 1.0
    for shape in shapes:
        law = sensitivity(study.forward, fit, shape, study.sigma_um)
        errors = [
            LAW_ERROR / np.sqrt(len(own)) * column[:, np.newaxis] * roots[name]
            for column in law.columns.T
            for name in own
        ]
        columns = np.hstack([law.columns, *errors])
        sides = np.concatenate([law.sides, np.zeros(columns.shape[1] - len(law.sides))])
        yield Explanation(effect.id, columns, sides, law_share / len(shapes), law)
    for random in free:
        direction = effect.covariates[random.basis.law.covariate]
        yield of_random(effect.id, study, random, (1.0 - law_share) / len(free), (direction,))


def _free_laws(study: Study, model: DepositionModel, effect: type[Effect]) -> list[RandomLaw]:
    size = FREE_ADDITION_UM if effect.free_law == 'addition' else FREE_FACTOR
    found = []
    for name in (name for name in effect.covariates if name in CURVES):
        basis = curve_basis(study, model, name, effect.free_law)
        if basis is None:
            continue
        within = effect.acts_within.get(name)
        among = None if within is None else basis.within(*within)
        if among is None or among.any():
            found += [basis.random(size, length, among) for length in FREE_LENGTHS]
    return found


def _shapeless(
    study: Study,
    model: DepositionModel,
    covariates: dict[str, np.ndarray],
    owned: Mapping[str, tuple[int, ...]],
) -> Iterator[Explanation]:
    """Random fields over the part, and over covariates, in proportion to the film."""
    film = FIELD_SHARE * study.forward.predict_um(model) / study.sigma_um
    campaign = study.campaign
    roots = fields_over_parts(
        campaign.experiment_of, campaign.positions_m, LENGTHS['place'], NEGLIGIBLE
    )
    maps = [
        basis.random(size, length)
        for kind, size in (('factor', FIELD_SHARE), ('addition', FREE_ADDITION_UM))
        for basis in map_bases(study, model, kind)
        for length in LENGTHS['place']
    ]
    share = PART_SHARE / (len(roots) + len(maps))
    for root in roots:
        yield _field(film[:, np.newaxis] * root, share, 'place on the part')
    for random in maps:
        yield of_random(UNKNOWN, study, random, share, description='place on the part')
    share = (1.0 - PART_SHARE) / max(len(covariates), 1)
    for name, values in covariates.items():
        length = WIGGLY if name in owned else SMOOTH
        basis = curve_basis(study, model, name) if name in CURVES else None
        if basis is None:
            yield _field(
                film[:, np.newaxis] * field_over_values(values, length, NEGLIGIBLE), share, name
            )
        else:
            random = basis.random(FIELD_SHARE, length)
            yield of_random(UNKNOWN, study, random, share, owned.get(name, ()), name)


def _field(columns: np.ndarray, share: float, description: str) -> Explanation:
    return Explanation(
        UNKNOWN, columns, np.zeros(columns.shape[1]), share, description=description
    )

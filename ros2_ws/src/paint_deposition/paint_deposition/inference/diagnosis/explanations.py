"""Everything that may be missing, as directions in which the readings would then deviate.

An effect explains by its law, whose sensitivities are the directions. What is outside the library
explains by any smooth law over any covariate. The laws of effects that a model has may be off: by
a smooth relative error along the covariates that the effect itself names.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from paint_deposition.effects.base import Effect
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.effects.learned_curves import CURVES
from paint_deposition.effects.learned_laws import LearnedFootprint, LearnedMap
from paint_deposition.inference.diagnosis.discrepancy import Footprints
from paint_deposition.inference.diagnosis.smooth_laws import (
    NEGLIGIBLE,
    RADII,
    RandomLaw,
    curve_basis,
    map_bases,
)
from paint_deposition.inference.fitting.forward import Forward
from paint_deposition.inference.fitting.least_squares import Fit
from paint_deposition.inference.fitting.random_effects import root_of_field
from paint_deposition.inference.fitting.study import Study
from paint_deposition.inference.readings.covariates import varies

# Amplitudes are stepped by this share of their typical size.
STEP = 0.25


def neutral_shapes(effect: type[Effect]) -> list[Effect]:
    """The effect at neutral amplitude, for a few values of its shape parameters."""
    info = effect.parameters()
    shapes = [name for name in info if info[name]['role'] == 'shape']
    grids = [np.geomspace(info[name]['low'], info[name]['high'], 7)[1:-1] for name in shapes]
    return [
        effect(**dict(zip(shapes, map(float, values), strict=True))) for values in product(*grids)
    ]


def candidates_beside(
    model: DepositionModel, library: Mapping[str, type[Effect]]
) -> dict[str, list[Effect]]:
    """The effects of a library that a model does not have, see ``neutral_shapes``, by id."""
    return {
        key: neutral_shapes(effect) for key, effect in library.items() if model.effect(key) is None
    }


def sensitivity_um(
    forward: Forward, model: DepositionModel, effect: Effect, name: str, predicted_um: np.ndarray
) -> np.ndarray:
    """(P,) change of the predicted readings by an amplitude, in its typical size [um].

    Args:
        effect: as it is there, in the model or neutral.
        name: of the amplitude; a bound beside it makes the difference one-sided.
        predicted_um: (P,) by the model with the effect.
    """
    info = type(effect).parameters()[name]
    here, step = getattr(effect, name), STEP * info['typical']
    ends = [value for value in (here - step, here + step) if info['low'] <= value <= info['high']]
    moved = [
        forward.predict_um(model.with_effect(effect.model_copy(update={name: value})))
        for value in ends
    ]
    if len(ends) == 2:
        return (moved[1] - moved[0]) / (2.0 * STEP)
    return (moved[0] - predicted_um) / (STEP if ends[0] > here else -STEP)


def sensitivity(forward: Forward, fit: Fit, effect: Effect, sigma_um: np.ndarray) -> np.ndarray:
    """(P, n) derivative of the readings by an effect's n amplitudes at the fitted model.

    Each is for an amplitude in its typical size, over the noise.

    Args:
        effect: neutral, or as it is in the fitted model.
        sigma_um: (P,) standard deviation of the points [um].
    """
    base = forward.predict_um(fit.model.with_effect(effect))
    return np.column_stack([
        sensitivity_um(forward, fit.model, effect, name, base) / sigma_um
        for name in effect.amplitudes()
    ])  # fmt: skip


UNKNOWN, FOOTPRINT, PLACE = 'unknown', 'footprint', 'place'
# Relative error of a law, as a standard deviation, and its length of correlation in standard
# deviations of the covariate.
LAW_ERROR, LAW_LENGTH = 0.3, 1.0
# Relative error over all other conditions, and that of a law of another form over its own ones.
OTHER_ERROR, OTHER_LAW = 0.3, 1.5
# An effect is there by its law, off by so much as laws are, or by a law much further off: how many
# times as far, and the prior share of each; and the share of a law of another form.
LAWS_OFF, ANOTHER_FORM = ((0.2, 0.25), (1.0, 0.4), (3.0, 0.2)), 0.15
# Laws of any form: typical size of a factor, of an addition [um], and of a factor over a part.
FACTOR, ADDITION_UM = 0.05, 0.7
FACTOR_OF_PLACE = 0.1
# A law of any form, chosen among some dozens, is learned if it raises the log evidence by this
# much. A footprint beside an effect is learned if it predicts what is left out: there is one, and
# its amplitudes are as small as the readings want them.
WORTH_LEARNING = 6.0
# Their lengths of correlation: over a covariate in its standard deviations, over the part [m].
LENGTHS = {'covariate': (0.35, 1.0), PLACE: (0.1, 0.25)}
# Effects with what each changes of the readings (P,) [um].
Changes = list[tuple[Effect, np.ndarray]]


@dataclass(frozen=True)
class Explanation:
    """One way in which a cause explains the readings."""

    cause: str  # an effect's id, or ``UNKNOWN``
    columns: np.ndarray  # (P, n) directions over the noise, for amplitudes of unit variance
    sides: np.ndarray  # (n,) +1 or -1 where physics fixes the sign of an amplitude, else 0
    share: float  # prior share of this explanation among those of its cause
    # The effect in one of its shapes, by whose amplitudes the directions are the derivatives; None
    # for a law of any form.
    law: Effect | None = None
    # The law of any form whose amplitudes the directions are, or None.
    random: RandomLaw | None = None
    corrects: str = ''  # id of the effect whose law it corrects, if it does
    worth: float = WORTH_LEARNING  # log evidence that it must add to be learned

    @property
    def learns(self) -> str:
        """Covariate of the learned law that it may become; '' if it cannot."""
        return self.random.basis.law.covariate if self.random else ''

    def select(self, rows: np.ndarray) -> 'Explanation':
        """The explanation for some of the readings; its law stays that of all."""
        return replace(self, columns=self.columns[rows])


def of_random(study: Study, random: RandomLaw, share: float = 1.0) -> Explanation:
    """A law of any form as an explanation, its directions over the noise of the study."""
    columns = random.change_um / study.sigma_um[:, np.newaxis]
    return Explanation(UNKNOWN, columns, np.zeros(columns.shape[1]), share, random=random)


def of_effects(
    study: Study, fit: Fit, candidates: Mapping[str, list[Effect]]
) -> Iterator[Explanation]:
    """The laws of effects that may be missing beside a fitted model.

    Args:
        fit: where to linearise; effects that are part of its model explain nothing more.
        candidates: effects in the shapes to try, by id.
    """
    for name, shapes in candidates.items():
        if fit.model.effect(name) is not None:
            continue
        for shape in shapes:
            columns = sensitivity(study.forward, fit, shape, study.sigma_um)
            low, high = shape.amplitude_bounds()
            # Only growth above neutral may be physical, or below.
            sides = 1.0 * (low >= 0.0) - 1.0 * (high <= 0.0)
            yield Explanation(name, columns, sides, 1.0 / len(shapes), shape)


def nonparametric_laws_of(study: Study, model: DepositionModel) -> list[Explanation]:
    """Smooth factors on what arrives, over each covariate that varies but the film itself.

    None of them changes the film as a whole: that is the pattern's.
    """
    laws = [
        basis.random(FACTOR, length).centred
        for name, law in CURVES.items()
        if name != 'film_um' and model.effect(law.id) is None
        for basis in [curve_basis(study, model, name)]
        if basis is not None
        for length in LENGTHS['covariate']
    ]
    return [of_random(study, law, 1.0 / len(laws)) for law in laws]


def of_places(study: Study, model: DepositionModel, each: bool = False) -> list[Explanation]:
    """Smooth factors on the film over places of a part, for what no covariate carries.

    Args:
        model: whose film they are factors on.
        each: only on one part at a time, not on all together.
    """
    if model.effect(LearnedMap.id) is not None:
        return []
    laws = [
        basis.random(FACTOR_OF_PLACE, length).centred
        for basis in map_bases(study, model)
        if not each or len(basis.settings['maps']) == 1
        for length in LENGTHS[PLACE]
    ]
    return [of_random(study, law, 1.0 / len(laws)) for law in laws]


def of_corrections(study: Study, fit: Fit, names: frozenset[str]) -> list[Explanation]:
    """Curves over their own covariates by which the laws of effects in a model may be off.

    Args:
        names: ids of the effects.
    """
    return [
        replace(of_random(study, curve.centred), corrects=effect.id)
        for effect, _, curve in _laws_off(study, fit, _changes(study, fit, names), fit.model)
        if curve and not fit.model.effect(curve.basis.law.id)
    ]


def of_footprint(study: Study, fit: Fit, worth: float = WORTH_LEARNING) -> list[Explanation]:
    """Deviations of the footprint from the two Gaussians of eq. (1) that fit best.

    Args:
        worth: log evidence that they must add to be learned.
    """
    if fit.model.effect(LearnedFootprint.id) is not None:
        return []
    laws = Footprints.of(study, fit, RADII).laws
    return [replace(of_random(study, law.centred, 1.0 / len(laws)), worth=worth) for law in laws]


def law_errors(study: Study, fit: Fit, kept: frozenset[str], model: DepositionModel) -> np.ndarray:
    """(P, n) directions over the noise in which the laws of effects in a model may be off.

    Args:
        kept: ids of the effects.
        model: whose rays say over which values of the covariates; one like it.
    """
    return _law_errors(study, fit, _changes(study, fit, kept), model)


def ways_off(
    study: Study, fit: Fit, kept: frozenset[str] | None, model: DepositionModel
) -> list[tuple[np.ndarray, float]]:
    """Ways in which the laws of effects in a model may be off, as ``law_errors``.

    Without ids in ``kept``, of all that were not learned.

    Returns:
        Of each way the directions (P, n) over the noise, and its prior share.
    """
    changes = _changes(study, fit, kept)
    errors = _law_errors(study, fit, changes, model)
    if not errors.any():
        return [(errors, 1.0)]
    other = _over_noise(study, _off_anywhere(study, fit, changes, model, OTHER_LAW, own=True))
    return [*((times * errors, share) for times, share in LAWS_OFF), (other, ANOTHER_FORM)]


def _law_errors(study: Study, fit: Fit, changes: Changes, model: DepositionModel) -> np.ndarray:
    """As ``law_errors``, of effects with these changes of the readings."""
    off = [columns for _, columns, _ in _laws_off(study, fit, changes, model)]
    off += _off_anywhere(study, fit, changes, model, OTHER_ERROR, own=False)
    return _over_noise(study, off)


def _over_noise(study: Study, columns_um: Iterable[np.ndarray]) -> np.ndarray:
    """(P, n) all of these directions (P, ...) [um], over the noise."""
    return np.hstack([np.empty((len(study), 0)), *columns_um]) / study.sigma_um[:, np.newaxis]


def _off_anywhere(
    study: Study, fit: Fit, changes: Changes, model: DepositionModel, size: float, own: bool
) -> Iterator[np.ndarray]:
    """(P, n) what laws may be off by, relative to their change of the film [um].

    Over the covariates that are the effect's own; or over all others, there relative to what no
    pattern would follow, lest an effect that acts on all film stand for anything.
    """
    covariates = standardised(study, model)
    for effect, change in changes:
        if not own:
            change = _beyond_pattern(study, fit, change)
        over = [name for name in covariates if (name in effect.covariates) == own]
        for name in over:
            root = root_of_field(covariates[name], LAW_LENGTH, NEGLIGIBLE)
            yield size / np.sqrt(len(over)) * change[:, np.newaxis] * root


def standardised(study: Study, model: DepositionModel) -> dict[str, np.ndarray]:
    """(P,) covariates that vary, in their standard deviations from the mean."""
    return {
        name: (values - values.mean()) / values.std()
        for name, values in study.covariates(model).items()
        if varies(values)
    }


def _changes(study: Study, fit: Fit, kept: frozenset[str] | None) -> Changes:
    """What the effects change whose laws may be off."""
    film, found = study.forward.predict_um(fit.model), []
    if kept is None:
        kept = frozenset(e.id for e in fit.model.effects if e.family != 'learned')
    for effect in (e for e in fit.model.effects if e.id in kept and not e.exact):
        others = tuple(e for e in fit.model.effects if e.id != effect.id)
        without = fit.model.model_copy(update={'effects': others})
        found.append((effect, film - study.forward.predict_um(without)))
    return found


def _beyond_pattern(study: Study, fit: Fit, change_um: np.ndarray) -> np.ndarray:
    """(P,) what is left of a change of the readings (P,) that the pattern follows [um].

    Attraction by the incidence, say, acts on all film, and hardly shows beside another pattern.
    """
    # Of the readings and of the prior, which holds the pattern where it is.
    pattern = np.vstack([fit.jacobian, fit.parameters.prior.whitening])
    pattern = pattern[:, : len(fit.parameters.pattern)]
    change = np.zeros(len(pattern))
    change[: len(study)] = change_um / study.sigma_um
    left = change - pattern @ np.linalg.lstsq(pattern, change, rcond=None)[0]
    # No law is off where it does not act.
    most_um = np.abs(change_um)
    return np.clip(study.sigma_um * left[: len(study)], -most_um, most_um)


def _laws_off(
    study: Study, fit: Fit, changes: Changes, model: DepositionModel
) -> Iterator[tuple[Effect, np.ndarray, RandomLaw | None]]:
    """Effects, by what their laws may be off over a covariate (P, n) [um], and as a curve."""
    covariates, film = standardised(study, model), study.forward.predict_um(fit.model)
    for effect, change in changes:
        own = [name for name in effect.covariates if name in covariates]
        scale = LAW_ERROR / np.sqrt(max(len(own), 1))
        for name in own:
            basis = None
            if effect.free_law and name in CURVES:
                basis = curve_basis(study, model, name, effect.free_law, effect.needs)
            if basis:
                relative = change
                if effect.free_law != 'addition':
                    relative = np.divide(change, film, out=np.zeros_like(film), where=film > 0.0)
                # The size of an effect is what it changes at this share of the points at the most.
                size = scale * float(np.quantile(np.abs(relative), 0.95))
                curve = basis.random(size, LAW_LENGTH)
                yield effect, curve.change_um, curve
            else:
                root = root_of_field(covariates[name], LAW_LENGTH, NEGLIGIBLE)
                yield effect, scale * change[:, np.newaxis] * root, None

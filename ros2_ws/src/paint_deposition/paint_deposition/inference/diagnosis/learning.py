"""Laws learned from readings: which laws of any form the accepted ones leave unexplained.

They are chosen one after the other by their evidence beside everything that the model may vary,
and kept only if they improve the prediction of readings left out.
"""

from collections.abc import Mapping, Sequence
from functools import cached_property, partial

import numpy as np

from paint_deposition.inference.comparison.regions import misfit_regions
from paint_deposition.inference.diagnosis.explanations import (
    FOOTPRINT,
    PLACE,
    Explanation,
    law_errors,
)
from paint_deposition.inference.diagnosis.gaussian import (
    NullModel,
    OrthogonalDirections,
    simulated,
)
from paint_deposition.inference.diagnosis.model_space import ALPHA, DRAWS, SIZES
from paint_deposition.inference.diagnosis.search import EffectSet, SearchStage
from paint_deposition.inference.diagnosis.verdict import Unknown
from paint_deposition.inference.fitting.least_squares import Fit
from paint_deposition.inference.fitting.study import Study
from paint_deposition.inference.readings.covariates import varies

MOST_LAWS = 2
# Share by which a law must lower the error on readings left out.
LEAST_GAIN = 0.02
# A law that was chosen, and the size of its amplitudes.
Sized = tuple[Explanation, float]
# (n, P) films [um] by the covariates without a law, the identity of the set, and what is left out.
Films = dict[tuple[frozenset[str], int, bytes], np.ndarray]
# Null hypotheses by what kind of law must say more than them, see ``nulls_around``.
Nulls = Mapping[str, NullModel]
CORRECTION, OTHER = 'correction', 'other'


def nulls_around(best: EffectSet, fit: Fit) -> Nulls:
    """What a law of each kind must say more than, beside a set of effects and a fit with it."""
    study, sizes, discrepancy = best.state.study, best.best.sizes, best.discrepancy
    plain = NullModel.around(fit, study.nuisance)
    off = law_errors(study, fit, best.names, best.discrepancy.model)
    correction = plain.with_discrepancy(discrepancy.covariance(sizes))
    usual = plain.with_discrepancy(discrepancy.covariance(discrepancy.usual(sizes)))
    return {
        # Pattern, nuisance, what the accepted laws may be off by, and the discrepancy of parts
        # and settings.
        FOOTPRINT: plain.with_discrepancy(discrepancy.of_parts(sizes)).beside(off),
        # Of an accepted law: the same with the footprint, without what the laws may be off by.
        CORRECTION: correction,
        # All of it, with the usual discrepancy of parts and settings; the most probable may be
        # what is unknown.
        PLACE: usual.beside(off),
        # All of it.
        OTHER: correction.beside(off),
    }


def null_for(nulls: Nulls, explanation: Explanation) -> NullModel:
    """The null hypothesis for an explanation."""
    kind = CORRECTION if explanation.corrects else explanation.learns
    return nulls.get(kind, nulls[OTHER])


def of_readings(nulls: Nulls, rows: np.ndarray) -> Nulls:
    """The null hypotheses for some of the readings."""
    return {kind: null.select(rows) for kind, null in nulls.items()}


def choose_laws(
    nulls: Nulls, explanations: Sequence[Explanation], freedom: float
) -> list[tuple[int, float]]:
    """The laws that the readings call for, strongest first.

    Args:
        nulls: what varies already.
        explanations: laws of any form, of which one for each covariate is considered.
        freedom: degrees of freedom of the noise estimate.

    Returns:
        The number of each explanation, and the standard deviation of its amplitudes.
    """
    left = {k: e for k, e in enumerate(explanations) if e.learns}
    chosen: list[tuple[int, float]] = []
    while left and len(chosen) < MOST_LAWS:
        worth = [
            (float(value), k, float(size))
            for k, explanation in left.items()
            for value, size in zip(
                by_size(null_for(nulls, explanation), explanation, freedom), SIZES, strict=True
            )
            if value >= explanation.worth
        ]
        if not worth:
            break
        _, k, size = max(worth)
        chosen.append((k, size))
        # What was chosen may vary from now on, too.
        columns = size * left[k].columns
        nulls = {kind: null.beside(columns) for kind, null in nulls.items()}
        left = {number: e for number, e in left.items() if e.learns != left[k].learns}
    return chosen


def by_size(null: NullModel, explanation: Explanation, freedom: float) -> np.ndarray:
    """(S,) log Bayes factor of a law at every size."""
    found = OrthogonalDirections.of(null.whiten(explanation.columns), explanation.sides)
    return found.log_bayes_factors(null.deviation[:, np.newaxis], SIZES, freedom)[:, 0]


class LeftOut:
    """Errors on readings left out, of a search and the laws learned after it.

    For each fold the choice is repeated with the other readings between the sets of effects that
    were tried: as long as it is the same, it goes on to the next stage. Where it is the same to
    the end, its set is the final one, too. The fits of the sets are shared by all folds.

    Args:
        nothing: the model that was tested.
        stages: of the search.
        final: the set that remained of the last one.
        options: laws of any form that may be learned.
        films_um: that were predicted already for the same final set and options.
    """

    def __init__(
        self, nothing: EffectSet, stages: Sequence[SearchStage], final: EffectSet,
        options: Sequence[Explanation], films_um: Films | None = None,
    ) -> None:  # fmt: skip
        self.nothing, self.stages, self.final, self.options = nothing, stages, final, options
        self.study = final.state.study
        self.folds = {
            'parts': self.study.folds,
            PLACE: self.study.scattered,
            FOOTPRINT: self.study.patches,
        }
        self._known: dict[tuple[frozenset[str], str], np.ndarray] = {}
        self._films_um: Films = {} if films_um is None else films_um
        self._finds_nothing: dict[int, bool] = {}  # by fold, whether the test says so

    def errors_by_count_um(
        self,
        without: frozenset[str] = frozenset(),
        of: str = 'parts',
        rows: np.ndarray | slice = slice(None),
    ) -> np.ndarray:
        """(n,) with effects and 0 to n - 1 laws, all found without what is left out [um].

        Args:
            without: covariates of laws that are not learned.
            of: what is left out, a key of ``folds``.
            rows: of the readings (P,) whose errors count.
        """
        key = without, of
        if key not in self._known:
            predict = partial(self._predicted, without)
            self._known[key] = self.study.squares_left_out_um2(predict, self.folds[of]())
        return np.sqrt(np.mean(self._known[key][:, rows], axis=1))

    def borne_out(
        self,
        laws: Sequence[Sized],
        without: frozenset[str] = frozenset(),
        rows: np.ndarray | slice = slice(None),
    ) -> int:
        """How many of some laws, from the first one on, the readings left out bear out.

        A curve must predict whole parts better. Without predicting these worse it is enough for a
        footprint to predict patches better, and for a map, which says what is between readings,
        single points.
        """
        kept, enough = 0, 1.0 - LEAST_GAIN
        parts_um = self.errors_by_count_um(without, rows=rows)
        for count, (law, _) in enumerate(laws, start=1):
            better = parts_um[count] <= enough * parts_um[kept]
            if law.learns in (PLACE, FOOTPRINT) and parts_um[count] <= 1.001 * parts_um[kept]:
                within_um = self.errors_by_count_um(without, law.learns, rows)
                better |= within_um[count] <= enough * within_um[kept]
            if better:
                kept = count
        return kept

    def errors_um(
        self, laws: Sequence[Sized] = (), without: frozenset[str] = frozenset()
    ) -> tuple[float, float]:
        """On parts left out as with ``keeping_effects``, and with what the others lead to [um].

        With as many of some laws as these bear out; with nothing at all where their test finds
        nothing, but something was found with all parts.
        """
        nothing, folds = self.nothing, self.study.folds()
        unaware = LeftOut(nothing, [SearchStage(nothing, [])], nothing, ())
        squares_um2 = np.zeros(len(folds))
        for fold in np.unique(folds).tolist():
            out = folds == fold
            if fold not in self._finds_nothing:
                self._finds_nothing[fold] = nothing is not self.final and (
                    min(nothing.space.select(~out).p_values(nothing.state.seed)) >= ALPHA
                )
            if self._finds_nothing[fold]:
                squares_um2[out] = unaware.errors_by_count_um(rows=out)[0] ** 2
                continue
            count = self.borne_out(laws, without, ~out)
            squares_um2[out] = self.errors_by_count_um(without, rows=out)[count] ** 2
        error_um = float(np.sqrt(np.mean(squares_um2)))
        keeping = self.keeping_effects
        return error_um if keeping is self else keeping.errors_um(laws, without)[0], error_um

    @cached_property
    def keeping_effects(self) -> 'LeftOut':
        """The same if every fold keeps the effects found with all readings, and refits them."""
        if self.nothing is self.final:
            return self
        final, stages = self.final, [SearchStage(self.final, [])]
        return LeftOut(final, stages, final, self.options, self._films_um)

    def _predicted(self, without: frozenset[str], out: np.ndarray) -> np.ndarray:
        """(n, P) films with 0 to n - 1 laws, found without some readings (P,) [um]."""
        study, freedom = self.study, self.final.state.freedom
        options = [option for option in self.options if option.learns not in without]
        followers = [*(stage.here for stage in self.stages[1:]), self.stages[-1].here]
        for stage, follower in zip(self.stages, followers, strict=True):
            found = stage.chosen(~out)
            if found.names != follower.names:
                break
        else:
            found = self.final
        key = without, id(found), out.tobytes()
        if key in self._films_um:
            return self._films_um[key]
        nulls = of_readings(nulls_around(found, found.fit), ~out)
        laws = choose_laws(nulls, [option.select(~out) for option in options], freedom)
        learned = [size * options[k].columns for k, size in laws]
        films_um = [study.predicted_without_um(found.fit, out)]
        for count in range(1, len(learned) + 1):
            free = np.hstack(learned[:count])
            films_um.append(study.predicted_without_um(found.fit, out, free))
        films_um += films_um[-1:] * (MOST_LAWS - len(learned))
        return self._films_um.setdefault(key, np.array(films_um))


def locate_unexplained(study: Study, fit: Fit, nothing: EffectSet, seed: int) -> Unknown:
    """Regress the deviations on each covariate, smoothly, and take the one that explains most.

    The p-value is that of the maximum over all covariates if sprays differed as usual ones do.

    Args:
        fit: the model so far.
        nothing: whose discrepancy is that of the sprays.
        seed: of the simulated deviations.
    """
    usual = nothing.discrepancy.covariance(nothing.discrepancy.usual(nothing.best.sizes))
    null = NullModel.around(fit, study.nuisance, discrepancy=usual)
    draws = simulated(len(study), study.noise.degrees_of_freedom, DRAWS, seed)
    found, by_chance = [], np.zeros(DRAWS)
    covariates = study.covariates(fit.model)
    for name in (name for name, values in covariates.items() if varies(values)):
        smooth = _smooth(covariates[name]) / study.sigma_um[:, np.newaxis]
        directions, _ = np.linalg.qr(null.whiten(smooth))
        found.append((float(np.sum((directions.T @ null.deviation) ** 2)), name))
        by_chance = np.maximum(by_chance, np.sum((directions.T @ draws) ** 2, axis=0))
    strength, covariate = max(found, key=lambda item: item[0])
    values = covariates[covariate]
    smooth = np.column_stack([np.ones(len(study)), _smooth(values)])
    weights = 1.0 / study.sigma_um[:, np.newaxis]
    residuals = study.residuals(fit.predicted_um)
    coefficients, *_ = np.linalg.lstsq(
        smooth * weights, residuals.residual_um / study.sigma_um, rcond=None
    )
    order = np.argsort(values)
    points = order[np.linspace(0, len(order) - 1, 15).astype(int)]
    regions = misfit_regions(study, residuals, fit.model)
    # The strongest contrast is the place to look at: what is widest, or off the other way, may
    # only balance it.
    first = max(regions, key=lambda region: abs(region.mean_residual_um), default=None)
    sign = np.sign(first.mean_residual_um) if first else 0.0
    alike = {one.experiment for one in regions if sign * one.mean_residual_um > 0.0}
    names = [experiment.name for experiment in study.campaign.experiments]
    shown = [name for name in names if name in alike]
    mean_um = float(np.mean(study.measured_um[first.rows])) if first else np.nan
    return Unknown(
        covariate,
        float((1 + np.count_nonzero(by_chance >= strength)) / (1 + DRAWS)),
        {
            covariate: values[points].tolist(),
            'residual_um': (smooth[points] @ coefficients).tolist(),
        },
        first.description if first else 'no single place stands out',
        first.experiment if first else '',
        tuple(shown),
        shown[0] if shown and shown == names[-len(shown) :] != names else '',
        first.mean_residual_um if first else 0.0,
        first.mean_residual_um / (mean_um - first.mean_residual_um) if first else 0.0,
    )


def _smooth(values: np.ndarray) -> np.ndarray:
    """(P, 4) polynomials of the values' ranks, so that outliers have no leverage."""
    ranks = np.argsort(np.argsort(values)) / max(len(values) - 1, 1)
    return np.polynomial.legendre.legvander(2.0 * ranks - 1.0, 4)[:, 1:]

"""What the report shows, computed once from the results, and the rows of its tables."""

from collections.abc import Mapping, Sequence
from functools import cached_property
from itertools import pairwise, product
from typing import Any

import numpy as np

from paint_deposition.effects.base import Effect
from paint_deposition.effects.learned_curves import LearnedCurve, counted_from_1
from paint_deposition.effects.learned_laws import LearnedFootprint, LearnedMap
from paint_deposition.film.common_film import sum_um
from paint_deposition.film.integrator import FilmIntegrator
from paint_deposition.film.statistics import wanted_at
from paint_deposition.inference.comparison.comparison import Comparison, SideBySide
from paint_deposition.inference.comparison.profiles import Profile, profiles_of
from paint_deposition.inference.design.proposals import Place, Spray
from paint_deposition.inference.diagnosis.model_space import SURE
from paint_deposition.inference.diagnosis.verdict import Diagnosis, Step
from paint_deposition.inference.fitting.estimates import Estimate, estimates
from paint_deposition.inference.fitting.pattern_vector import PATTERN_NAMES
from paint_deposition.inference.fitting.posterior import with_mean_level
from paint_deposition.inference.fitting.study import Study
from paint_deposition.inference.readings.readings import root_mean_square
from paint_deposition.model.eq1_pattern import PlanarPattern
from paint_deposition.report import words
from paint_deposition.report.colour_scales import ACCENT, BEFORE, INK, MODELS, TWO_SIDED_95


class ReportData:
    """Everything the report is made of; what takes time is computed once, where it is shown.

    Attributes:
        comparisons: of the first and the best model of a diagnosis; one where nothing was added;
            of models side by side each.
        diagnosis: None after a comparison alone.
        older: history of the model that a diagnosis started from, as in its file.
        beside: models that stand side by side; None where one followed from another.
        models: base first, best last. model: the best one.
        improved: whether there is a before and an after.
        model_names: what the models are called where both are shown.
        colours: of the models; a model before is paler than the one after it.
        lines: colour and width [px] of each model's line over readings. The line of a model before
            is thin and lies over the bold one, so that both are seen where they agree.
        residuals_um: for each model (P,) at the points, averaged over repeats [um].
        proposals: what to measure and what to spray next.
    """

    def __init__(
        self,
        result: Comparison | SideBySide | Diagnosis,
        older: Sequence[Mapping[str, Any]] = (),
    ) -> None:
        self.older = older
        self.beside = result if isinstance(result, SideBySide) else None
        self.diagnosis: Diagnosis | None = None
        self.comparisons: tuple[Comparison, ...]
        self.proposals: tuple[Sequence[Place], Sequence[Spray]] = ((), ())
        if isinstance(result, SideBySide):
            self.comparisons = tuple(result.by_name.values())
        elif isinstance(result, Comparison):
            self.comparisons = (result,)
        else:
            first, *later = result.comparisons
            self.comparisons = (first, *later[-1:])
            self.diagnosis, self.proposals = result, result.proposals
        self.study = self.comparisons[0].study
        self.experiments = self.study.campaign.experiments
        self.models = tuple(comparison.model for comparison in self.comparisons)
        self.residuals_um = [comparison.points.residual_um for comparison in self.comparisons]
        self.model, count = self.models[-1], len(self.models)
        self.improved = count > 1 and not self.beside
        self.model_names: tuple[str, ...] = ('model',)
        self.colours: tuple[str, ...] = MODELS[:count]
        self.lines: list[dict[str, Any]] = [{'color': ACCENT, 'width': 3.5}]
        if self.improved:
            self.model_names, self.colours = ('model before', 'model after'), (BEFORE, ACCENT)
            self.lines.insert(0, {'color': INK, 'width': 1.2})
        elif self.beside:
            self.model_names = tuple(self.beside.by_name)
            self.lines = [{'color': colour, 'width': 2.2} for colour in self.colours]

    @cached_property
    def bands(self) -> list[str]:
        """Where the film measured at each point is beside its own target band; '' without one."""
        target_of, bands = self.study.campaign.target_of, []
        for one in self.experiments:
            measured = one.readings.mean_um
            target, tolerance = wanted_at(measured, *target_of(one), one.zones_of_points)
            off = measured - target
            within = np.where(np.abs(off) <= tolerance, 'in', np.where(off < 0.0, 'low', 'high'))
            bands += np.where(np.isnan(off), '', within).tolist()
        return bands

    @cached_property
    def changes(self) -> dict[str, dict[str, float]]:
        """What each effect that was added changes in the prediction at the points, by id.

        It is told by the most negative, the most positive (or 0) and the RMS difference [um]. The
        model with it and the model without it are each fitted to all readings: what the pattern
        can imitate counts as no change.
        """
        steps = self.diagnosis.history if self.diagnosis else ()
        off = {s.added: s.fit.predicted_um - b.fit.predicted_um for b, s in pairwise(steps)}
        return {
            added: {
                'least_um': min(um.min(), 0.0), 'most_um': max(um.max(), 0.0),
                'rms_um': root_mean_square(um),
            }
            for added, um in off.items()
        }  # fmt: skip

    def effect_class(self, effect_id: str) -> type[Effect] | None:
        """An effect that was looked for or is in the models; None if it is neither."""
        own = {e.id: type(e) for model in self.models for e in model.effects}
        return (own | dict(self.diagnosis.library if self.diagnosis else {})).get(effect_id)

    @cached_property
    def profiles(self) -> list[Profile]:
        """Along columns and rows."""
        return profiles_of(self.study, self.models)

    def rows_of(self, index: int) -> slice:
        """Points of the study that belong to an experiment."""
        first, stop = np.searchsorted(self.study.campaign.experiment_of, [index, index + 1])
        return slice(int(first), int(stop))

    @cached_property
    def painted(self) -> list[list[tuple[np.ndarray, float]]]:
        """The layer that was measured: for each experiment, with each model.

        It is the film (V,) on the surface [um], and the solids that a part which catches
        everything would get [cm3].
        """
        found = []
        for one in self.experiments:
            points, of_part = one.surface.points(), []
            for model in self.models:
                acting, films = model.without(one.switched_off), []
                for sign, rows in one.films:
                    film = FilmIntegrator(points, acting, 'double', one.surface)
                    film.add(one.path.select(rows))
                    films.append((sign, film))
                film_um = sum_um((sign, film.film_um) for sign, film in films)
                of_part.append(
                    (film_um, sum(sign * film.used.emitted_cm3 for sign, film in films))
                )
            found.append(of_part)
        return found


def history_as_list(
    study: Study, steps: Sequence[Step], older: Sequence[Mapping[str, Any]] = ()
) -> list[dict[str, Any]]:
    """What was added to a model and the errors it left.

    Errors can be compared within one campaign only, so each step names its campaign, with the
    noise of its gauge. The start model is the last of the older steps: refitted to the
    same campaign it replaces that step, fitted to another one it follows it.

    Args:
        study: the readings.
        steps: the models, the start model, refitted, first.
        older: what the start model's own file says.
    """
    campaign = study.campaign.name
    found = [
        {
            'added': step.added,
            'rmse_um': round(step.rmse_um, 4),
            'holdout_rmse_um': round(step.holdout_rmse_um, 4),
            'noise_floor_um': round(study.noise_floor_um, 4),
            'campaign': campaign,
        }
        for step in steps
    ]
    kept = [dict(step) for step in older]
    if kept and kept[-1].get('campaign', campaign) == campaign:
        found[0] = kept.pop() | found[0] | {'added': older[-1].get('added', 'pattern')}
    else:
        found[0]['added'] = 'refit' if kept or steps[0].model.effects else 'pattern'
    return [*kept, *found]


# --- rows of the tables: the sentences around them are the template's


def class_rows(data: ReportData) -> list[dict[str, Any]]:
    """Candidate causes with the effects they are confounded with, and parameters."""
    rows = []
    for found in data.diagnosis.classes if data.diagnosis else ():
        effect = data.effect_class(found.best)
        like = [member for member in found.members if member != found.best]
        parameters = [
            _parameter(effect, name, one.value, one.low, one.high) | {'reason': one.reason}
            for name, one in found.parameters.items()
        ]
        accepted = data.diagnosis is not None and found.best in data.diagnosis.accepted
        learned, sure = words.is_learned(found.best), found.probability > SURE
        rows.append({
            'id': found.best, 'found': found, 'name': words.effect_name(found.best),
            'like': like, 'others': [words.effect_name(member) for member in like],
            'accepted': accepted, 'learned': learned,
            # A diagnosis adds effects that it is sure of, and keeps learned laws for what they
            # predict: others were added by the user.
            'asked': accepted and not (found.probability == 1.0 if learned else sure),
            'meaning': words.effect_meaning(effect),
            'signature': effect.signature if effect else '',
            'parameters': parameters + words.learned_rows(data.model.effect(found.best)),
        })  # fmt: skip
    return rows


def _parameter(effect: type[Effect] | None, name: str, *values: float) -> dict[str, str]:
    """A parameter in words: its value, and the ends of its 95 % interval if there is one."""
    unit = effect.parameters()[name]['unit'] if effect else ''
    return {'words': words.parameter_words(name, unit)} | _printed(unit, *values)


def _printed(unit: str, *values: float) -> dict[str, str]:
    # A value below this share of its interval is printed as none.
    if abs(values[0]) < 1e-4 * np.ptp(values):
        values = (0.0, *values[1:])
    return dict(zip(('unit', 'value', 'low', 'high'), words.in_unit(unit, *values), strict=False))


def law_rows(data: ReportData) -> list[dict[str, str]]:
    """Learned laws of the best model: where each holds, and how well a curve is known."""
    rows = []
    for law in data.model.effects:
        row = {'name': words.effect_name(law.id), 'best': ''}
        if isinstance(law, LearnedMap):
            rows.append(row | {'kind': 'map'})
        elif isinstance(law, LearnedFootprint):
            rows.append(row | {'kind': 'footprint', 'ends': words.number(1e3 * law.reach_m)})
        elif isinstance(law, LearnedCurve):
            over = words.learned_rows(law)[1]
            row |= {'kind': 'curve', 'ends': over['value'], 'unit': over['unit']}
            if law.sd:  # where the band of the curve is narrow, and where it is wide
                at = np.linspace(law.low, law.high, 101)
                half, shown = TWO_SIDED_95 * law.deviation(at), counted_from_1(law.covariate, at)
                of_half = ' µm' if law.kind == 'addition' else ''
                best, least = (
                    f'± {words.number(half[k], 2)}{of_half} at {words.number(shown[k])} '
                    f'{words.unit_words(law.unit)}'.rstrip()
                    for k in (half.argmin(), half.argmax())
                )
                row |= {'best': best, 'least': least, 'forms': words.form_words(law)}
            rows.append(row)
    return rows


def pattern_rows(data: ReportData) -> list[dict[str, str]]:
    """The pattern's parameters; with 95 % intervals where the model was fitted."""
    fitted: tuple[Estimate, ...] = ()
    if data.diagnosis:
        fit = data.diagnosis.history[-1].fit
        fitted = estimates(fit, with_mean_level(fit, data.study.campaign))
    found = {estimate.name: estimate for estimate in fitted}
    brushes, rows = data.model.brushes, []
    of = [f'brush {brush.number}: ' if len(brushes) > 1 else '' for brush in brushes] or ['']
    for (whose, planar), name in product(zip(of, data.model.patterns, strict=True), PATTERN_NAMES):
        # 'r, offset radius of the ring [m]'
        symbol, _, described = str(PlanarPattern.model_fields[name].description).partition(', ')
        meaning, _, unit = described.removesuffix(']').partition(' [')
        ends = (found[name].low, found[name].high) if name in found else ()
        told = {'symbol': symbol, 'words': whose + meaning}
        rows.append(told | _printed(unit, getattr(planar, name), *ends))
    return rows


def effect_rows(data: ReportData) -> list[dict[str, Any]]:
    """Effects in the best model, what each does to the film, and its parameters."""
    known = {c.best: c.parameters for c in data.diagnosis.classes} if data.diagnosis else {}
    rows = []
    for effect in data.model.effects:
        found = known.get(effect.id, {})
        parameters = words.learned_rows(effect)
        for name in effect.parameters():
            one = found.get(name)
            values = (one.value, one.low, one.high) if one else (getattr(effect, name),)
            parameters.append(_parameter(type(effect), name, *values))
        change = data.changes.get(effect.id)
        rows.append({'id': effect.id, 'change': change, 'parameters': parameters})
    return rows


def blind_rows(data: ReportData) -> list[dict[str, Any]]:
    """Effects that these readings could not show, and what would have been seen of others."""
    diagnosis, rows = data.diagnosis, []
    if diagnosis is None:
        return []
    for effect_id in dict.fromkeys((*diagnosis.not_testable, *diagnosis.detectable)):
        if effect_id in diagnosis.accepted:
            continue
        effect, seen = data.effect_class(effect_id), diagnosis.detectable.get(effect_id, {})
        amplitudes = [
            {
                'words': words.parameter_words(name, info['unit']),
                'least': _size(seen.get(name), info['unit']),
                'usual': _size(info['typical'], info['unit']),
            }
            for name, info in (effect.parameters() if effect else {}).items()
            if info['role'] == 'amplitude'
        ]
        rows.append({
            'id': effect_id, 'testable': effect_id not in diagnosis.not_testable,
            'amplitudes': amplitudes, 'meaning': words.effect_meaning(effect),
        })  # fmt: skip
    return rows


def _size(value: float | None, unit: str) -> str:
    if value is None or not np.isfinite(value):
        return ''
    shown_unit, size = words.in_unit(unit, abs(value))
    return f'{size} {shown_unit}'.strip()

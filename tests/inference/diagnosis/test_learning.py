"""Laws learned from readings, and the error on readings without which all of it was found."""

from dataclasses import replace

import numpy as np
import pytest

import paint_deposition as pd
from inference.diagnosis.linear import linear_fit, null_of
from inference.diagnosis.readings_on_door import at_model
from inference.fitting.panels import ORDERS, gauged, reading
from paint_deposition.effects.catalogue import EFFECTS, LEARNED
from paint_deposition.effects.learned_laws import hat_weights
from paint_deposition.inference.comparison.comparison import compare
from paint_deposition.inference.diagnosis import learning
from paint_deposition.inference.diagnosis.explanations import UNKNOWN, Explanation, of_places
from paint_deposition.inference.diagnosis.gaussian import NullModel
from paint_deposition.inference.diagnosis.model_space import ModelSpace
from paint_deposition.inference.diagnosis.refit import refit
from paint_deposition.inference.diagnosis.search import Search, SearchStage
from paint_deposition.inference.diagnosis.smooth_laws import Basis
from paint_deposition.inference.diagnosis.state import DiagnosisState
from paint_deposition.inference.fitting.study import Study
from paint_deposition.inference.readings.readings import root_mean_square

POINTS, KNOTS = 80, 8
WAVE = 3.0 * np.sin(np.linspace(0.0, 7.0, POINTS))
# Curves of unit size over a covariate that goes evenly from the first knot to the last.
ALONG = hat_weights(np.linspace(0.0, KNOTS - 1.0, POINTS), KNOTS)
STEP = np.sqrt(12.0) / (KNOTS - 1.0)
CURVE = Basis(LEARNED['height_fraction'], {}, ALONG, STEP * np.arange(KNOTS)[:, np.newaxis], STEP)
CURVE = CURVE.random(1.0, 0.5)
CHANGE = CURVE.change_um
WAVY = Explanation(UNKNOWN, CHANGE, np.zeros(CHANGE.shape[1]), 1.0, random=CURVE)

KINDS = ('footprint', 'correction', 'place', 'other')


def nulls(change: np.ndarray, **others: np.ndarray) -> learning.Nulls:
    """Beside noise that a change (P,) has moved; for some kinds of law more (P, n) may vary."""
    base = null_of(linear_fit(np.random.default_rng(0), POINTS))
    null = NullModel.of(base.columns, base.scaled_deviation + change)
    beside = {kind: null.beside(columns) for kind, columns in others.items()}
    return {kind: beside.get(kind, null) for kind in KINDS}


def test_a_law_is_learned_once_where_it_says_more_than_what_may_vary_already():
    assert learning.choose_laws(nulls(0.0 * WAVE), [WAVY], np.inf) == []
    among = [replace(WAVY, columns=0.0 * CHANGE), WAVY, WAVY]
    ((number, size),) = learning.choose_laws(nulls(WAVE), among, np.inf)
    assert number in (1, 2)
    assert size > 1.0
    assert learning.choose_laws(nulls(WAVE), [replace(WAVY, random=None)], np.inf) == []
    # A correction of a law need not say more than the errors of that law.
    hidden = nulls(WAVE, other=3.0 * CHANGE)
    assert learning.choose_laws(hidden, [WAVY], np.inf) == []
    assert len(learning.choose_laws(hidden, [replace(WAVY, corrects='edge_build')], np.inf)) == 1
    beside = nulls(WAVE, **dict.fromkeys(KINDS, 3.0 * CHANGE))
    assert learning.choose_laws(beside, [WAVY], np.inf) == []


BASE = pd.DepositionModel()
THREE = (*ORDERS, (0.7, 0.3, 1.5, 1.1))
EDGE = EFFECTS['edge_build'](gain=0.8, length_m=0.1)
RISING = LEARNED['time_s'](low=0.0, high=70.0, learned=(-0.2, 0.05, 0.12, 0.15, 0.15))


def begun(campaign: pd.Campaign, *library: str) -> DiagnosisState:
    return DiagnosisState.begin(campaign, BASE, {name: EFFECTS[name] for name in library}, seed=0)


@pytest.mark.slow
def test_what_no_law_explains_is_learned_without_the_parts_left_out(monkeypatch):
    """The flow rises and levels off, which no effect of the library does."""
    rising = gauged(BASE.with_effect(RISING), seed=2, orders=THREE)
    nothing = Search(begun(rising)).nothing
    over_time = [law for law in nothing.state.nonparametric_laws if law.learns == 'time_s']
    left_out = learning.LeftOut(nothing, [SearchStage(nothing, [])], nothing, over_time)
    without, *with_laws = left_out.errors_by_count_um()
    noise_um = nothing.state.study.noise_floor_um
    assert without > 1.7 * noise_um
    assert with_laws[0] < 1.3 * noise_um
    assert len(with_laws) == learning.MOST_LAWS
    # No second law is learned over one covariate, and none over one that is left out.
    assert with_laws[1] == with_laws[0]
    law = [(over_time[0], 1.0)]
    assert left_out.borne_out(law) == 1
    assert left_out.errors_um(law)[1] == pytest.approx(with_laws[0])
    kept_out = left_out.errors_by_count_um(frozenset(['time_s']))
    assert kept_out == pytest.approx([without] * (1 + learning.MOST_LAWS))
    anew = []
    for part in rising.experiments:
        others = pd.Campaign(tuple(one for one in rising.experiments if one is not part))
        learned = refit(others, BASE, LEARNED['time_s']).model
        anew.append(compare(Study.of(pd.Campaign((part,))), learned).points.residual_um)
    assert with_laws[0] == pytest.approx(root_mean_square(np.concatenate(anew)), rel=0.15)
    # Parts by which nothing would be missing predict the one left out as if nothing were.
    monkeypatch.setattr(ModelSpace, 'p_values', lambda self, seed: (1.0, 1.0))
    stages, found = [SearchStage(nothing, [])], replace(nothing)
    unaware = learning.LeftOut(nothing, stages, found, over_time)
    assert unaware.errors_um(law)[1] == pytest.approx(without)


@pytest.mark.slow
def test_a_law_that_improves_one_part_only_is_not_chosen_by_that_part():
    """The error of each part is that of as many laws as the other parts bear out."""
    first, *others = gauged(BASE, seed=0, orders=THREE).experiments
    nothing = Search(begun(pd.Campaign((first, *others)))).nothing
    study = nothing.state.study
    films_um = study.measured_um - np.array([[1.0], [1.02]])
    films_um[1, study.folds() == 0] += 0.9

    class Given(learning.LeftOut):
        def errors_by_count_um(self, without=frozenset(), of='parts', rows=slice(None)):
            return np.sqrt(np.mean((study.measured_um - films_um)[:, rows] ** 2, axis=1))

    given = Given(nothing, [SearchStage(nothing, [])], nothing, [])
    law = [(WAVY, 1.0)]
    assert given.errors_by_count_um()[1] < 0.9
    assert given.borne_out(law) == 1
    assert given.errors_um(law)[1] == pytest.approx(np.sqrt((1.0 + 2.0 * 1.02**2) / 3.0))


@pytest.mark.slow
def test_a_map_is_borne_out_by_points_within_a_spot_that_a_patch_takes_out_as_a_whole():
    (panel,) = gauged(BASE, seed=1, columns=5, orders=THREE[:1]).experiments
    sound = Study.of(pd.Campaign((panel,)))
    places_m, patch = sound.campaign.positions_m, sound.patches() == 0
    middle_m = places_m[patch].mean(axis=0)
    apart_m = np.linalg.norm(panel.readings.positions_m - middle_m, axis=1)
    less_um = 10.0 * np.exp(-((apart_m / 0.18) ** 2))
    spotted = reading(panel, panel.readings.thickness_um - less_um)
    nothing = Search(begun(pd.Campaign((spotted,)))).nothing
    study = nothing.state.study
    maps = [*of_places(study, nothing.fit.model)]
    left_out = learning.LeftOut(nothing, [SearchStage(nothing, [])], nothing, maps)
    without, by_patches, _ = left_out.errors_by_count_um()
    assert by_patches == pytest.approx(without, rel=0.02)
    without, by_points, _ = left_out.errors_by_count_um(of='place')
    assert by_points < 0.75 * without
    assert left_out.borne_out([(left_out.options[0], 1.0)]) == 1
    high_m = [np.ptp(places_m[study.scattered() == k, 2]) for k in range(6)]
    assert min(high_m) > 1.5 > np.ptp(places_m[patch, 2])


@pytest.mark.slow
def test_a_fold_that_calls_for_another_set_goes_no_further(monkeypatch):
    """Only one part had the voltage that the effect needs: from the others it is not known."""
    one, *others = gauged(BASE, seed=0, orders=THREE).experiments
    with_edge = gauged(BASE.with_effect(EDGE), seed=0, orders=THREE[:1]).experiments[0]
    off = frozenset(['voltage'])
    parts = replace(with_edge, name=one.name), *(replace(e, switched_off=off) for e in others)
    monkeypatch.setattr(Study, 'leaves_out_parts', True)
    state = begun(pd.Campaign(parts), 'edge_build', 'flow_drift')
    study, stages = state.study, Search(state).stages()
    first, last = stages[0].here, stages[-1].here
    assert last.names == {'edge_build'}
    folds = study.folds()
    sets = [first if fold == 0 else last for fold in range(len(parts))]
    assert [stages[0].chosen(folds != k).names for k in range(3)] == [one.names for one in sets]
    # Where the last set is found and then pruned to the first one, it is so in every fold.
    for final, by_fold in ((last, sets), (first, [first] * len(parts))):
        fits = [one.fit for one in by_fold]
        expected = study.errors_left_out_um(
            lambda out, fits=fits: study.predicted_without_um(fits[folds[out][0]], out)
        )
        left_out = learning.LeftOut(first, stages, final, [])
        assert left_out.errors_by_count_um() == pytest.approx(
            [expected] * (1 + learning.MOST_LAWS)
        )
        assert left_out.errors_um()[1] == pytest.approx(expected)


@pytest.mark.slow
def test_the_unexplained_is_told_by_its_place_its_size_and_the_part_that_it_began_on():
    first, *later = gauged(BASE, seed=1, columns=5, orders=THREE).experiments
    changed = []
    for panel in later:
        x, _, z = panel.readings.positions_m.T
        more_um = np.where((x > 0.3) & (z > 1.5), 6.0, 0.0)
        changed.append(reading(panel, panel.readings.thickness_um + more_um))
    state = begun(pd.Campaign((first, *changed)))
    fit, nothing = at_model(state.study, BASE), Search(state).nothing
    unknown = learning.locate_unexplained(state.study, fit, nothing, seed=0)
    assert unknown.parts == ('panel 2', 'panel 3')
    assert unknown.since == 'panel 2'
    # The place that is told also holds some neighbours.
    assert 3.0 < unknown.mean_residual_um < 6.5
    assert unknown.share > 0.1
    assert unknown.p_value < 0.05
    assert set(unknown.curve) == {unknown.covariate, 'residual_um'}
    assert 'more than the model says, since panel 2; it shows most with' in str(unknown)
    assert str(unknown).startswith(f'On {unknown.part}, upper third')
    assert unknown.part in unknown.parts
    # On all parts it has no beginning; where no place stands out only the condition is told.
    on_all = replace(unknown, parts=('panel 1', *unknown.parts), since='', mean_residual_um=-6.0)
    assert 'model says; it shows on panel 1, panel 2, panel 3, most with' in str(on_all)
    assert 'most' not in str(replace(on_all, p_value=0.3))
    nowhere = replace(unknown, parts=(), part='', where='no single place stands out')
    shows = f'It shows most with {unknown.covariate}; no single place stands out.'
    assert str(nowhere) == shows

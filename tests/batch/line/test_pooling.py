"""What many parts say together and one does not; what changes, and when."""

from dataclasses import replace

import numpy as np
import pyarrow as pa
import pytest

from batch.line.synthetic import FIRST_S, HOUR_S, SIGMA_UM, parts
from paint_deposition.batch.line.changes import Series, changes_of, series_of
from paint_deposition.batch.line.pooling import amplitudes, pooled
from paint_deposition.batch.line.result import Line
from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.inference.fitting.pattern_vector import PatternVector

pytestmark = pytest.mark.slow

FIRST = amplitudes()[0]


def changes(made):
    series = series_of(made, pooled(made))
    return changes_of(series, np.array([part.time_s for part in made]))


def test_an_effect_too_small_for_one_part_shows_in_many():
    made = parts(150, seed=1, drift=0.3, points=24)
    assert all(pooled([part, part]).causes == () for part in made[:2])
    (cause,) = pooled(made).causes
    assert (cause.effect, cause.parameter) == FIRST
    assert cause.all_parts > 10.0


def test_the_patterns_of_two_brushes_are_shared_by_all_parts():
    """What the second brush changes is taken for no effect; an effect is found beside it."""
    brushes = PatternVector((1, 2))
    assert pooled(parts(60, 0, pattern=len(brushes)), brushes).causes == ()
    made = parts(150, seed=1, drift=0.5, points=36, pattern=len(brushes))
    (cause,) = pooled(made, brushes).causes
    assert (cause.effect, cause.parameter) == FIRST
    assert cause.value == pytest.approx(0.5 * EFFECTS[FIRST[0]].parameters()[FIRST[1]]['typical'],
                                        abs=4.0 * cause.sd)  # fmt: skip


def test_a_misfit_that_all_parts_share_is_no_effect():
    found = pooled(parts(100, seed=2, misfit=0.03))
    assert found.causes == ()
    assert found.posterior.scales.misfit is not None


def test_a_model_that_is_not_of_the_line_is_named():
    near = parts(3, 1)
    far = [replace(part, residual_um=-0.66 * part.predicted_um) for part in near]
    for measured, told in ((near, False), ([], False), (far, True)):
        line = Line(DepositionModel(), {}, pa.table({}), 0, 'none')
        vars(line)['parts'] = measured
        words = 'the model predicts 25 µm where the gauge reads 9 µm; calibrate'
        assert any(words in warning for warning in line.warnings) == told


def test_level_and_noise_are_estimated():
    made = [replace(part, sigma_um=part.sigma_um / 1.5) for part in parts(300, 3, level=0.02)]
    scales = pooled(made).posterior.scales
    assert scales.level == pytest.approx(0.02, rel=0.15)
    assert scales.noise == pytest.approx(1.5, rel=0.06)


def test_a_step_has_its_date_and_its_size():
    made = parts(90, seed=5, steps=[(60, -0.04)])
    (change,) = changes(made)
    assert (change.series, change.kind) == ('level', 'step')
    assert abs(change.part - 60) <= 1
    assert change.earliest_s <= FIRST_S + 60 * HOUR_S <= change.latest_s
    assert change.after - change.before == pytest.approx(-4.0, abs=3 * change.sd)
    assert 'fell by' in change.sentence


def test_an_effect_that_grows_has_a_beginning():
    amount = np.concatenate([np.zeros(60), np.linspace(0.0, 8.0, 60)])
    found = changes(parts(120, seed=6, drift=amount))
    # One thing changed. What shares its mark on the film changed with it and is named there.
    (grown,) = found
    assert '.'.join(FIRST) in grown.members
    assert grown.kind == 'drift'
    assert 45 <= grown.part <= 75
    assert grown.per_day > 0.0
    assert 'level' in grown.also


def test_a_steady_line_has_few_alarms_and_changes():
    made = parts(150, 10)
    series = series_of(made, pooled(made))
    alarms = sum(len(rows) for one in series for rows in one.charts.alarms.values())
    # One alarm in 1000 parts is wanted; the centre is known from 50 parts only.
    assert alarms <= 2
    assert changes_of(series, np.array([part.time_s for part in made])) == []


def test_one_bad_part_is_an_alarm_and_no_change():
    values = np.random.default_rng(7).normal(size=100)
    values[70] += 9.0
    series = Series('level', '%', ('level',), values, np.ones(100), 33, 10_000.0)
    assert series.charts.alarms['shewhart'].tolist() == [70]
    assert changes_of([series], FIRST_S + HOUR_S * np.arange(100)) == []


def test_one_bad_part_does_not_make_the_others_look_too_good():
    """It raises the noise of all parts together, which is not that of the ordinary ones."""
    made = parts(24, seed=9)
    bad = made[20].residual_um + 12.0 * np.random.default_rng(3).normal(size=12)
    made[20] = replace(made[20], residual_um=bad)
    misfit = next(one for one in series_of(made, pooled(made)) if one.name == 'misfit')
    assert misfit.charts.alarms['shewhart'].tolist() == [20]
    ordinary = np.delete(misfit.values, 20)
    assert abs(np.median(ordinary)) < 0.5
    assert ordinary.min() > -3.0


def test_the_scales_are_those_beside_the_effects_that_were_found():
    """Of two programmes in turn the marks are opposite: unexplained, they look like noise."""
    made = parts(100, seed=8, drift=0.0, points=24)
    for row, part in enumerate(made):
        turned = part.by_effect * (-1.0) ** row
        shown = part.residual_um + 0.6 * turned[:, 0]
        made[row] = replace(part, by_effect=turned, residual_um=shown)
    found = pooled(made)
    (cause,) = found.causes
    typical = EFFECTS[FIRST[0]].parameters()[FIRST[1]]['typical']
    assert found.posterior.scales.noise == pytest.approx(1.0, abs=0.06)
    assert cause.value == pytest.approx(0.6 * typical, abs=4.0 * cause.sd)
    lone_sd = SIGMA_UM / np.sqrt(sum(np.sum(part.by_effect[:, 0] ** 2) for part in made))
    assert cause.sd == pytest.approx(lone_sd * typical, rel=0.1)

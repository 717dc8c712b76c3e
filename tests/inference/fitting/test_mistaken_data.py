"""Data that are simply wrong are told from effects that the model lacks."""

from dataclasses import replace

import numpy as np
import pytest

from inference.fitting.panels import gauged
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.effects.library.air_drift import AirDrift
from paint_deposition.effects.library.flow_drift import FlowDrift
from paint_deposition.inference.fitting.cleaning import clean_and_fit
from paint_deposition.inference.readings.campaign import Campaign, Experiment
from paint_deposition.inference.readings.readings import Readings

MODEL = DepositionModel()
GIVEN = MODEL.with_patterns([MODEL.planar.model_copy(update={'K1_cm3_per_s': 1.8})])
# Heights of the passes on two panels, neither of them symmetric about the middle.
ORDERS = ((0.3, 0.7, 1.4), (1.5, 0.6, 1.2))


def said(campaign: Campaign, start: DepositionModel = MODEL) -> tuple[str, ...]:
    return clean_and_fit(campaign, start, starts=1)[0].warnings


def with_readings(campaign: Campaign, *readings: Readings) -> Campaign:
    """The panels with these readings, from the first panel on."""
    parts = [*campaign.experiments]
    for k, own in enumerate(readings):
        parts[k] = parts[k].with_readings(own)
    return replace(campaign, experiments=tuple(parts))


def mirrored(part: Experiment, axis: int, about_m: float) -> Readings:
    places = part.readings.positions_m.copy()
    places[:, axis] = 2.0 * about_m - places[:, axis]
    return replace(part.readings, positions_m=places)


def scaled(part: Experiment, factor: float) -> Readings:
    return replace(part.readings, thickness_um=factor * part.readings.thickness_um)


@pytest.fixture(scope='module')
def panels() -> Campaign:
    return gauged(MODEL, 3, orders=ORDERS)


def test_sound_readings_are_not_accused(panels):
    assert said(panels) == ()
    assert said(panels, GIVEN) == ()


def test_readings_of_one_panel_or_of_all_upside_down(panels):
    first, second = panels.experiments
    (one,) = said(with_readings(panels, mirrored(first, 2, 1.0)))
    assert 'the readings of panel 1 look mirrored top to bottom' in one
    (every,) = said(with_readings(panels, *(mirrored(p, 2, 1.0) for p in (first, second))))
    assert every.startswith('the readings look mirrored top to bottom')
    assert '(0.000, 0.000, 1.000) m' in every


def test_what_is_symmetric_is_not_accused_of_a_mirror(panels):
    """The passes run straight across the panels: left and right have the same film."""
    assert said(with_readings(panels, *(mirrored(p, 0, 0.0) for p in panels.experiments))) == ()


@pytest.mark.parametrize(
    'effect',
    [AirDrift(shift_down_m=0.06), AirDrift(shift_across_m=0.08), FlowDrift(drift_per_pass=0.2)],
)
def test_an_effect_is_no_mistake(effect):
    """A strong draught moves the film as a mirror about another plane would."""
    nearly_even = ((0.37, 0.97, 1.57), (0.40, 1.0, 1.60))
    for orders in (ORDERS, nearly_even):
        assert said(gauged(MODEL.with_effect(effect), 5, orders=orders)) == ()


def test_readings_of_two_panels_exchanged(panels):
    first, second = (part.readings for part in panels.experiments)
    (one,) = said(with_readings(panels, second, first))
    assert one.startswith('the readings of panel 1 and panel 2 look exchanged: ')
    assert 'pair them the other way round' in one


def test_alike_panels_are_not_accused_of_an_exchange():
    alike = gauged(MODEL, 4, orders=(ORDERS[0], ORDERS[0]))
    first, second = (part.readings for part in alike.experiments)
    assert said(with_readings(alike, second, first)) == ()


@pytest.mark.parametrize(
    ('factor', 'words'),
    [(10.0, 'ten times too large'), (0.1, 'ten times too small'), (25.4, 'taken for mils')],
)
def test_readings_in_another_unit(panels, factor, words):
    first, second = (scaled(part, factor) for part in panels.experiments)
    (every,) = said(with_readings(panels, first, second), GIVEN)
    assert every.startswith('the readings look ')
    assert words in every
    (one,) = said(with_readings(panels, first), GIVEN)
    assert one.startswith('the readings of panel 1 look ')
    assert words in one


def test_a_target_tells_the_unit_where_the_film_alone_does_not(panels):
    """100 µm of film may be meant; where 30 are wanted, they are not."""
    tenfold = with_readings(panels, *(scaled(part, 10.0) for part in panels.experiments))
    mean_um = tenfold.means.mean_um.mean()
    assert said(replace(tenfold, target_um=mean_um / 10.0, tolerance_um=3.0))
    assert said(replace(tenfold, target_um=mean_um, tolerance_um=30.0)) == ()


def test_a_model_of_another_gun_is_named_and_does_not_stop(panels):
    other = MODEL.with_patterns([MODEL.planar.model_copy(update={'K1_cm3_per_s': 0.3})])
    study, _ = clean_and_fit(panels, other, starts=1)
    (mistake,) = study.mistakes
    assert "another gun's" in mistake.sentence
    assert not mistake.stops


def test_swapped_readings_are_named_once_and_left_out(panels):
    part, _ = panels.experiments
    film = part.readings.thickness_um.copy()
    low, high = int(np.argmin(part.means.mean_um)), int(np.argmax(part.means.mean_um))
    rows = [part.means.owner == k for k in (low, high)]
    film[rows[0]], film[rows[1]] = film[rows[1]], film[rows[0]]
    bad = with_readings(panels, replace(part.readings, thickness_um=film))
    study, _ = clean_and_fit(bad, MODEL, starts=1)
    assert {one.point for one in study.outliers} == {f'panel 1: P{k}' for k in (low, high)}
    (line,) = study.left_out
    assert 'look swapped' in line
    assert f"'panel 1: P{min(low, high)}' and 'panel 1: P{max(low, high)}'" in line

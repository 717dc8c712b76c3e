"""Data that are simply wrong are told from effects that the model lacks."""

from dataclasses import replace

import numpy as np
import pytest

import paint_deposition as pd
from inference.fitting.panels import PANEL, gauged, painted_by, reading
from paint_deposition.effects.library.air_drift import AirDrift
from paint_deposition.effects.library.flow_drift import FlowDrift
from paint_deposition.inference.fitting.cleaning import clean_and_fit
from paint_deposition.inference.readings.campaign import Experiment
from paint_deposition.part.zones import Zone

pytestmark = pytest.mark.slow

MODEL = pd.DepositionModel()
# Heights of the passes on two panels, neither of them symmetric about the middle.
ORDERS = ((0.3, 0.7, 1.4), (1.5, 0.6, 1.2))


def of_level(K1_cm3_per_s: float) -> pd.DepositionModel:
    planar = MODEL.planar.model_copy(update={'K1_cm3_per_s': K1_cm3_per_s})
    return MODEL.with_patterns([planar])


GIVEN = of_level(1.8)


def of(*parts: Experiment) -> pd.Campaign:
    return pd.Campaign(parts)


def said(campaign: pd.Campaign, start: pd.DepositionModel = MODEL) -> tuple[str, ...]:
    return clean_and_fit(campaign, start, starts=1)[0].warnings


def mirrored(part: Experiment, axis: int = 2, about_m: float = 1.0) -> Experiment:
    places = part.readings.positions_m.copy()
    places[:, axis] = 2.0 * about_m - places[:, axis]
    return part.with_readings(replace(part.readings, positions_m=places))


def exchanged(first: Experiment, second: Experiment) -> pd.Campaign:
    return of(first.with_readings(second.readings), second.with_readings(first.readings))


def scaled(part: Experiment, factor: float) -> Experiment:
    return reading(part, factor * part.readings.thickness_um)


def swapped(part: Experiment) -> tuple[Experiment, set[str]]:
    """The thinnest and the thickest point in each other's place, and their labels."""
    film = part.readings.thickness_um.copy()
    ends = int(np.argmin(part.readings.mean_um)), int(np.argmax(part.readings.mean_um))
    low, high = (part.readings.owner == k for k in ends)
    film[low], film[high] = film[high], film[low]
    return reading(part, film), {f'{part.name}: P{k}' for k in ends}


@pytest.fixture(scope='module')
def panels() -> pd.Campaign:
    return gauged(MODEL, 3, orders=ORDERS)


def test_sound_readings_are_not_accused(panels):
    first, second = panels.experiments
    assert said(panels) == said(panels, GIVEN) == ()
    # The passes run straight across the panels: left and right have the same film.
    assert said(of(mirrored(first, 0, 0.0), mirrored(second, 0, 0.0))) == ()
    alike = gauged(MODEL, 4, orders=(ORDERS[0], ORDERS[0]))
    assert said(exchanged(*alike.experiments)) == ()
    # Without voltage any share of the paint arrives: a film of any thickness may be its own.
    off, other = exchanged(first, second).experiments
    assert said(of(replace(off, switched_off=frozenset({'voltage'})), other)) == ()


def test_readings_of_one_panel_or_of_all_upside_down(panels):
    first, second = panels.experiments
    (one,) = said(of(mirrored(first), second))
    assert 'the readings of panel 1 look mirrored top to bottom' in one
    assert '(0.000, 0.000, 1.000) m' in one
    (every,) = said(of(mirrored(first), mirrored(second)))
    assert every.startswith('the readings look mirrored top to bottom')
    assert 'about the middle of each part' in every


def test_a_part_that_is_not_symmetric_is_mirrored_as_the_gun_sees_it(panels):
    """Listed by their points, the readings of the other hand lie on this one, too."""

    def bulged(places_m: np.ndarray) -> np.ndarray:
        return places_m * [1.0, 0.0, 1.0] + 0.04 * places_m[:, 2:] ** 2 * [0.0, 1.0, 0.0]

    surface = pd.Surface.from_triangles(bulged(PANEL.vertices_m), PANEL.faces, 0.05)
    first, second = (
        painted_by(MODEL, part.path, bulged(part.points.positions_m), surface=surface, name=name)
        for name, part in zip('ab', panels.experiments, strict=True)
    )
    assert said(of(first, second)) == ()
    places = bulged(first.readings.positions_m * [1.0, 0.0, -1.0] + [0.0, 0.0, 2.0])
    (one,) = said(of(first.with_readings(replace(first.readings, positions_m=places)), second))
    assert 'the readings of a look mirrored top to bottom' in one


@pytest.mark.parametrize(
    'effect',
    [AirDrift(shift_down_m=0.06), AirDrift(shift_across_m=0.08), FlowDrift(drift_per_pass=0.2)],
)
def test_an_effect_is_no_mistake(effect):
    """A strong draught moves the film as a mirror about another plane would."""
    nearly_even = ((0.37, 0.97, 1.57), (0.40, 1.0, 1.60))
    for orders in (ORDERS, nearly_even):
        assert said(gauged(MODEL.with_effect(effect), 5, orders=orders)) == ()


@pytest.mark.parametrize(
    ('factor', 'words'),
    [(10.0, 'ten times too large'), (0.1, 'ten times too small'), (25.4, 'taken for mils')],
)
def test_readings_in_another_unit(panels, factor, words):
    first, second = panels.experiments
    (every,) = said(of(scaled(first, factor), scaled(second, factor)), GIVEN)
    assert every.startswith('the readings look ')
    assert words in every
    (one,) = said(of(scaled(first, factor), second), GIVEN)
    assert one.startswith('the readings of panel 1 look ')
    assert words in one


def test_a_target_tells_the_unit_where_the_film_alone_does_not(panels):
    """100 µm of film may be meant; where 30 are wanted, they are not."""
    tenfold = of(*(scaled(part, 10.0) for part in panels.experiments))
    mean_um = tenfold.readings.mean_um.mean()
    assert said(replace(tenfold, target_um=mean_um / 10.0, tolerance_um=3.0))
    assert said(replace(tenfold, target_um=mean_um, tolerance_um=30.0)) == ()
    # A model of another gun is named, too, and does not stop.
    ((sentence, stops),) = clean_and_fit(panels, of_level(0.3), starts=1)[0].mistakes
    assert "another gun's" in sentence
    assert not stops


def test_parts_whose_level_falls_by_more_than_usual_are_told():
    parts = gauged(MODEL, 3, orders=(ORDERS[0],) * 4).experiments
    assert pd.compare(of(*parts)).warnings == ()
    falling = of(*map(scaled, parts, (1.1, 1.03, 0.95, 0.87)))
    (warning,) = pd.compare(falling).warnings
    assert 'part levels panel 1 +' in warning
    assert ' %, falling; ' in warning
    found = pd.diagnose(falling)
    assert found.verdict == 'unknown_effect'
    assert found.p_value < 0.02
    assert found.reason.startswith('The levels of the parts differ by more than usual')
    assert found.warnings == ()


def test_a_model_for_another_flow_is_compared_as_it_is(panels):
    """No level of parts and no gauge zero makes up for it."""
    found = pd.compare(panels, of_level(1.4 * MODEL.planar.K1_cm3_per_s))
    (warning,) = found.warnings
    assert warning.startswith('the readings say 0.71 times the K1 of the model')
    assert found.points.bias_um == pytest.approx(-0.4 * panels.readings.mean_um.mean(), rel=0.1)


def test_a_comparison_warns_of_mirrored_and_names_swapped_readings_once(panels):
    first, second = panels.experiments
    bad, labels = swapped(first)
    found = pd.compare(of(bad, mirrored(second)))
    assert found.warnings[0].startswith('the readings of panel 2 look mirrored top to bottom: ')
    assert {one['swapped_with'] for one in found.to_dict()['left_out']} == labels
    (line,) = found.study.left_out
    assert 'look swapped' in line
    assert all(f"'{label}'" in line for label in labels)


def test_a_diagnosis_stops_at_exchanged_readings(panels):
    parts = panels.experiments
    named = (replace(part.readings, source=f'{part.name}.csv') for part in parts)
    found = pd.diagnose(
        exchanged(*(p.with_readings(r) for p, r in zip(parts, named, strict=True)))
    )
    assert found.verdict == 'fit_broken'
    assert 'the readings of panel 1 and panel 2 look exchanged: ' in found.reason
    assert 'pair them the other way round in the campaign' in found.reason
    assert '(panel 1.csv with panel 1)' in found.reason
    assert found.accepted == ()


def test_a_calibration_warns_of_the_unit_and_of_targets_far_away(panels):
    rim, rest = np.array([[0.1, -1, 0], [0.3, 1, 2]]), np.array([[-1, -1, 0.5], [1, 1, 1]])
    told = pd.Zones((Zone('rim', 20.0, 5.0, rim), Zone('rest', 1.0, 0.5, rest)))
    parts = []
    for part in panels.without(panels.readings.thickness_um < 3.0).experiments:
        zones = told.at(part.surface.vertices_m, part.surface.normals)
        parts.append(replace(scaled(part, 10.0), zones=zones))
    unit, rim, rest, *_ = pd.calibrate(of(*parts)).warnings
    assert unit.startswith('the readings look ten times too large: as given they mean a film of ')
    assert unit.endswith('; divide them by 10')
    # Then all else that readings and targets are warned of.
    assert "panel 1: no reading is in zone 'rim' (20 µm), the nearest is 0.100 m off" in rim
    assert "panel 1: no reading is near the 1 µm of zone 'rest'" in rest

"""Data that are simply wrong are told from effects that the model lacks."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from cli.command import paint
from inference.fitting.panels import OUTLINE_M, gauged, passes
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.effects.library.air_drift import AirDrift
from paint_deposition.effects.library.flow_drift import FlowDrift
from paint_deposition.inference.fitting.cleaning import clean_and_fit
from paint_deposition.inference.readings.campaign import Campaign, Experiment
from paint_deposition.inference.readings.readings import Readings
from worlds.record import Part

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


def swapped(part: Experiment) -> tuple[Readings, set[str]]:
    """The thinnest and the thickest point in each other's place, and their labels."""
    film = part.readings.thickness_um.copy()
    ends = int(np.argmin(part.means.mean_um)), int(np.argmax(part.means.mean_um))
    low, high = (part.means.owner == k for k in ends)
    film[low], film[high] = film[high], film[low]
    return replace(part.readings, thickness_um=film), {f'P{k}' for k in ends}


def written(campaign: Campaign, folder: Path, **more: object) -> Path:
    """The panels as files."""
    entries = []
    none = np.empty((0, 3))
    for part, heights_m in zip(campaign.experiments, ORDERS, strict=True):
        motion, own = passes(heights_m, samples=80), part.readings
        name = part.name.replace(' ', '_')
        faces = np.array([[0, 2, 1], [0, 3, 2]])
        entries.append(Part(
            name, OUTLINE_M, faces, motion.stamps_ns, motion.positions_m,
            motion.quaternions_xyzw, motion.trigger_stamps_ns, motion.trigger_flow > 0.0,
            own.positions_m, own.point, own.thickness_um, None, none, none[:, 0], none[:, 0],
        ).write(folder))  # fmt: skip
    file = folder / 'campaign.yaml'
    file.write_text(yaml.safe_dump({'experiments': entries} | more))
    return file


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


def test_a_part_of_unknown_level_is_not_accused_of_an_exchange(panels):
    """Without voltage any share of the paint arrives: a film of any thickness may be its own."""
    first, second = panels.experiments
    off = replace(first.with_readings(second.readings), switched_off=frozenset({'voltage'}))
    other = second.with_readings(first.readings)
    assert said(replace(panels, experiments=(off, other))) == ()


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
    bad, labels = swapped(panels.experiments[0])
    study, _ = clean_and_fit(with_readings(panels, bad), MODEL, starts=1)
    assert {one.point for one in study.outliers} == {f'panel 1: {label}' for label in labels}
    (line,) = study.left_out
    assert 'look swapped' in line
    assert all(f"'panel 1: {label}'" in line for label in labels)


def test_compare_warns_of_mirrored_and_names_swapped_readings(panels, tmp_path):
    first, second = panels.experiments
    bad, labels = swapped(first)
    file = written(with_readings(panels, bad, mirrored(second, 2, 1.0)), tmp_path)
    done = paint('compare', file, '-o', tmp_path / 'out')
    assert done.returncode == 0, done.stderr
    assert '\nwarning: the readings of panel_2 look mirrored top to bottom: ' in done.stderr
    found = json.loads((tmp_path / 'out/comparison.json').read_text())
    assert {one['swapped_with'] for one in found['left_out']} == {f'panel_1: {p}' for p in labels}


def test_diagnose_stops_at_exchanged_readings(panels, tmp_path):
    first, second = (part.readings for part in panels.experiments)
    file = written(with_readings(panels, second, first), tmp_path)
    done = paint('diagnose', file, '-o', tmp_path / 'out')
    assert done.returncode == 0, done.stderr
    found = json.loads((tmp_path / 'out/diagnosis.json').read_text())
    assert found['verdict'] == 'fit_broken'
    assert 'panel_1 and panel_2 look exchanged' in found['reason']
    assert 'panel_2.csv with panel_1' in found['reason']
    assert found['accepted'] == []


def test_calibrate_warns_of_the_unit_and_of_targets_far_away(panels, tmp_path):
    thick = panels.without(panels.readings.thickness_um < 3.0)
    tenfold = with_readings(thick, *(scaled(part, 10.0) for part in thick.experiments))
    zones = [
        {'name': 'rim', 'target_um': 20, 'tolerance_um': 5, 'box': [[0.1, -1, 0], [0.3, 1, 2]]},
        {'name': 'rest', 'target_um': 1, 'tolerance_um': 0.5, 'box': [[-1, -1, 0.5], [1, 1, 1]]},
    ]
    (tmp_path / 'zones.yaml').write_text(yaml.safe_dump({'zones': zones}))
    file = written(tenfold, tmp_path, zones='zones.yaml')
    done = paint('calibrate', file, '-o', tmp_path / 'out')
    assert done.returncode == 0, done.stderr
    first, second, *_ = done.stderr.partition('warning: the readings look ')[2].splitlines()
    assert first.startswith('ten times too large: they mean a film of ')
    assert first.endswith('; divide them by 10')
    # Then all else that readings and targets are warned of.
    assert second.startswith('warning: panel_1: no reading is ')
    assert "panel_1: no reading is in zone 'rim' (20 µm), the nearest is 0.05" in done.stderr
    assert "panel_1: no reading is near the 1 µm of zone 'rest'" in done.stderr

"""What the report calls and how it shows effects of users and learned laws."""

from types import SimpleNamespace

import numpy as np
import pytest

from booth import SAMPLES
from paint_deposition.effects.base import Effect, parameter
from paint_deposition.effects.catalogue import LEARNED
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.effects.learned_laws import WAVES, LearnedFootprint, LearnedMap, PartGrid
from paint_deposition.effects.library.flow_drift import FlowDrift
from paint_deposition.files.effect_file import load_effect_file
from paint_deposition.inference.comparison.comparison import compare
from paint_deposition.inference.fitting.estimates import DiscrepancyFigures, FootprintProfile
from paint_deposition.inference.fitting.study import Study
from paint_deposition.report import charts, words
from paint_deposition.report.charts import footprint_figure, learned_figure, map_figure
from paint_deposition.report.data import ReportData
from small_campaign import small_campaign


class HoleBuild(Effect):
    id = 'hole_build'
    family = 'boundary'
    gain: float = parameter(
        0.0, low=-2, high=2, typical=0.1, unit='1', description='share of paint more at holes'
    )


def test_units_are_not_said_twice_and_numbers_have_no_computers_exponent():
    wake = load_effect_file(SAMPLES / 'my_effect.py')
    unit = wake.parameters()['loss_per_m_per_s']['unit']
    assert words.parameter_words('loss_per_m_per_s', unit) == 'loss'
    assert words.in_unit(unit, 2e-9) == ('per m/s', '2 × 10⁻⁹')
    unit = FlowDrift.parameters()['drift_per_pass']['unit']
    assert words.in_unit(unit, 0.02)[0] == 'per pass'
    told = {'drift_per_pass': (unit, 'drift'), 'shift_down_m': ('m', 'shift down')}
    for name, (unit, expected) in (told | {'gain': ('1', 'gain'), 's': ('s', 's')}).items():
        assert words.parameter_words(name, unit) == expected
    found = [words.number(value) for value in (0.0, 1234.0, -0.00012345, 2.5e-9, 4e8)]
    assert found == ['0', '1234', '−0.000123', '2.5 × 10⁻⁹', '4 × 10⁸']


def test_effects_without_a_docstring_and_learned_laws_are_told_by_what_they_have():
    assert words.effect_meaning(HoleBuild) == 'Share of paint more at holes.'
    signed = type('Signed', (HoleBuild,), {'signature': 'more paint around holes'})
    assert words.effect_meaning(signed) == 'More paint around holes.'
    assert words.effect_meaning(FlowDrift) == FlowDrift.__doc__.splitlines()[0]
    name = 'learned law over the time since the motion began'
    assert words.effect_name('learned:time_s') == name
    assert words.effect_name('edge_build and learned:time_s') == f'edge build and {name}'
    assert words.is_learned('learned:time_s')
    assert not words.is_learned('edge_build')


def rows_of(law) -> list[tuple[str, ...]]:
    return [tuple(row.values()) for row in words.learned_rows(law)]


def test_a_learned_law_is_told_by_its_curve_and_its_range():
    law = LEARNED['time_s'](low=2.0, high=60.0, learned=(0.1, -0.25))
    assert rows_of(law) == [('factor', '0.75 to 1.1', ''), ('over', '2 to 60', 's')]
    passes = LEARNED['spray_pass'](low=0.0, high=5.0)
    assert rows_of(passes)[1] == ('over', '1 to 6', '')
    fog = LEARNED['height_fraction'](kind='addition', learned=(2.0, -0.5))
    assert rows_of(fog)[0] == ('addition', '−0.5 to 2', 'µm')
    ends = {'low_m': (-0.5, -0.2), 'high_m': (0.5, 0.2)}
    grid = PartGrid(part_m=(1.2, 0.1, 0.5), **ends, columns=2, rows=2)
    map_ = LEARNED['place'](maps=(grid,), learned=(0.1, 0.0, 0.0, -0.2))
    factor, over = rows_of(map_)
    assert factor == ('factor', '0.8 to 1.1', '')
    assert over == ('over', '1000 × 400', 'mm of a part')
    # Mean and first harmonic add up on the heavier side.
    ring = LEARNED['footprint'](reach_m=0.3, learned=(0.0,) * 5 + (0.1, 0.2, 0.0, 0.0, 0.0))
    assert rows_of(ring)[0] == ('factor', '0.9 to 1.3', '')


KNOTS = 24


@pytest.fixture(scope='module')
def study(tmp_path_factory):
    return Study.of(small_campaign(tmp_path_factory.mktemp('campaign')))


def shown(study: Study, *effects) -> ReportData:
    return ReportData(compare(study, DepositionModel(effects=effects)))


@pytest.mark.slow
def test_a_curve_is_drawn_with_its_closed_form_and_with_its_band_if_it_is_known(study):
    law = LEARNED['edge_distance_m'](low=0.0, high=0.25, learned=(0.0,) * KNOTS)
    d_m = np.linspace(0.0, 0.25, 100_001)
    at_knots = np.interp(law.knots, law.axis(d_m), 0.4 * np.exp(-((d_m / 0.03) ** 2)))
    law = law.model_copy(update={'learned': tuple(at_knots)})
    plain = learned_figure(shown(study, law))
    curve = plain['charts'][0]['data'][0]
    known = law.model_copy(update={'sd': (0.02,) * (KNOTS - 1) + (0.5,)})
    figure = learned_figure(shown(study, known))
    (chart,) = figure['charts']
    band, again, *forms = chart['data']
    assert again['y'] == pytest.approx(curve['y'])
    assert ('dots: ' in chart['title']) == bool(forms)
    low, high = np.split(band['y'], 2)
    assert high[-1] - low[0] == pytest.approx(2.0 * 1.96 * 0.02)
    # Far from the edge it is so wide that its lower end would take all film away.
    assert low[-1] == 0.05
    words = [entry[0] for entry in figure['legend']]
    assert words == [*(entry[0] for entry in plain['legend']), '95 % band']


@pytest.mark.slow
def test_a_map_shows_what_it_does_where_the_readings_of_its_part_lie(study):
    door = study.campaign.experiments[1].measured_points
    place = {'low_m': (-0.4, -0.3), 'high_m': (0.4, 0.3), 'columns': 3, 'rows': 2}
    learned = (-2.0, -2.0, -2.0, 0.1, 0.2, 0.3)
    sizes_m = tuple(door.extent_m.tolist()), (9.0, 9.0, 9.0)
    grids = tuple(PartGrid(part_m=size_m, **place) for size_m in sizes_m)
    assert map_figure(shown(study)) is None
    maps = map_figure(shown(study, LearnedMap(maps=grids, learned=learned * 2)))
    [first, dots], [second] = (chart['data'] for chart in maps['charts'])
    assert first['z'] == pytest.approx(np.array([[0.05, 0.05, 0.05], [1.1, 1.2, 1.3]]))
    # Neutral is the middle of the colours.
    assert first['zmin'] + first['zmax'] == pytest.approx(2.0)
    assert second['z'] == pytest.approx(first['z'])
    assert len(dots['x']) == len(door.positions_m)
    titles = [chart['title'] for chart in maps['charts']]
    assert titles == ['factor on door', 'factor on a part that was not measured here']
    added = map_figure(shown(study, LearnedMap(maps=grids[:1], kind='addition', learned=learned)))
    (chart,) = added['charts']
    assert chart['data'][0]['z'] == pytest.approx(np.reshape(learned, (2, 3)))
    assert chart['data'][0]['zmin'] + chart['data'][0]['zmax'] == pytest.approx(0.0)
    assert chart['title'] == 'addition [µm] on door'


@pytest.mark.slow
def test_a_footprint_is_the_pattern_times_its_factor(study):
    heavier_right = (0.0,) * WAVES + (0.1, 0.2, 0.0, 0.0, 0.0)
    footprint = LearnedFootprint(reach_m=0.2, learned=heavier_right)
    assert footprint_figure(shown(study)) is None
    charts = footprint_figure(shown(study, footprint))['charts']
    plain, learned, factor = (chart['data'][0] for chart in charts)
    assert learned['z'] == pytest.approx(plain['z'] * factor['z'])
    x, y = np.meshgrid(factor['x'], factor['y'])
    at = np.argmin(np.hypot(x - 0.2, y))
    assert factor['z'].flat[at] == pytest.approx(1.3, abs=0.03)
    assert factor['z'][np.hypot(x, y) > 0.41] == pytest.approx(1.0)


def test_the_footprint_is_shown_with_its_band(study):
    radius_m, eq1 = np.array([0.0, 0.1, 0.2]), np.array([0.5, 1.0, 0.1])
    profile = FootprintProfile(radius_m, eq1, eq1 + 0.1, np.array([0.5, 0.1, 0.01]))
    figures = DiscrepancyFigures(0.02, 0.0, 0.03, 0.1, (0.06, 2.0), profile)
    assert charts.profile_figure(shown(study)) is None
    diagnosed = shown(study)
    diagnosed.diagnosis = SimpleNamespace(discrepancy=figures)
    band, plain, found = charts.profile_figure(diagnosed)['charts'][0]['data']
    assert (plain['y'] == eq1).all()
    assert (found['y'] == eq1 + 0.1).all()
    low, high = band['y'][:3], band['y'][:2:-1]
    assert low == pytest.approx(np.maximum(found['y'] - 1.96 * profile.sd, 0.0), abs=1e-4)
    assert high == pytest.approx(found['y'] + 1.96 * profile.sd, abs=1e-4)

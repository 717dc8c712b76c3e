"""Coats one over the other: sums of films, and what wet paint does that dry paint does not."""

import numpy as np
import pytest

import paint_deposition as pd
from booth import LOOKING_ALONG_Y, SAMPLES
from paint_deposition.effects.library.gauge_gain import GaugeGain
from paint_deposition.effects.library.sag import Sag
from paint_deposition.errors import ModelError, PaintError
from paint_deposition.film.common_film import Coats
from scenes import straight_pass

TIMES_S = np.arange(0.0, 3.0, 0.02)
BASE, LOW = (
    straight_pass(TIMES_S, (-0.5, -0.25, z), (0.5, -0.25, z), LOOKING_ALONG_Y) for z in (1.1, 0.9)
)
PLAIN = pd.DepositionModel()
SAGGING = PLAIN.with_effect(Sag(run_m=0.01))


@pytest.fixture(scope='module')
def panel():
    return pd.read_mesh(SAMPLES / 'panel.stl', max_edge_length_m=0.05)


@pytest.fixture(scope='module')
def painted(panel):
    """`painted(model, wet_on_wet)`: a coat of two guns, and one of the first again."""

    def film(model, wet_on_wet=False, **more):
        coats, motions = ['base', 'base', 'clear'], [BASE, LOW, BASE]
        return pd.simulate(panel, motions, model, coats=coats, wet_on_wet=wet_on_wet, **more)

    return film


@pytest.mark.parametrize('wet_on_wet', [False, True])
def test_coats_add_up_to_the_film_of_their_guns(panel, painted, wet_on_wet):
    """Nothing acts on the finished film: wet or dry, the coats are what each lays alone."""
    film = painted(PLAIN, wet_on_wet)
    alone = [pd.simulate(panel, motions).film_um for motions in ([BASE, LOW], BASE)]
    base, clear = film.coats
    assert np.array_equal(base.film_um, alone[0])
    assert clear.film_um == pytest.approx(alone[1], abs=1e-12)
    assert np.array_equal(film.film_um, pd.simulate(panel, [BASE, LOW, BASE]).film_um)
    guns = [[gun.name for gun in coat.guns] for coat in film.coats]
    assert guns == [['gun 1', 'gun 2'], ['gun 3']]
    volumes = [coat.statistics.painted_volume_cm3 for coat in film.coats]
    assert sum(volumes) == pytest.approx(film.statistics.painted_volume_cm3)


def test_dried_coats_sag_each_by_itself_wet_ones_as_one_and_a_film_that_runs_away_is_told(panel):
    """Paint runs with the cube of the wet film: twice the film runs eight times as much."""
    plain, once = (pd.simulate(panel, BASE, model).film_um for model in (PLAIN, SAGGING))
    run_um = once - plain
    for wet_on_wet, times in ((False, 2.0), (True, 8.0)):
        coats = {'coats': ['base', 'clear'], 'wet_on_wet': wet_on_wet}
        film = pd.simulate(panel, [BASE, BASE], SAGGING, **coats)
        assert film.film_um - 2.0 * plain == pytest.approx(times * run_um, abs=1e-9)
        assert np.array_equal(film.coats[0].film_um, once)
        added = sum(coat.film_um for coat in film.coats)
        assert added == pytest.approx(film.film_um, abs=1e-12)
    assert np.abs(run_um).max() > 0.1
    # The law is of first order: pushed too far it takes away more than is there.
    said = 'and no film is below 0: the law of sag does not hold at this size'
    for count, warned in ((1, False), (8, True)):
        warnings = pd.simulate(panel, [BASE] * count, SAGGING).warnings
        assert any(said in warning for warning in warnings) == warned


def test_the_gauge_is_one_and_each_dried_coat_may_sag_by_its_own(panel):
    motions, coats = [BASE, BASE], ['base', 'clear']
    film = pd.simulate(panel, motions, [SAGGING, PLAIN], coats=coats).film_um
    alone = (pd.simulate(panel, BASE, model).film_um for model in (SAGGING, PLAIN))
    assert np.array_equal(film, sum(alone))
    with pytest.raises(ModelError, match=r'gun 1 and gun 2 differ .*\(sag\)'):
        pd.simulate(panel, motions, [SAGGING, PLAIN], coats=coats, wet_on_wet=True)
    with pytest.raises(ModelError, match=r'gun 1 and gun 2 differ .*\(gauge_gain\)'):
        pd.simulate(panel, motions, [PLAIN.with_effect(GaugeGain.typical()), PLAIN], coats=coats)
    with pytest.raises(PaintError, match='3 names for 2 guns: give one for each, or none'):
        pd.simulate(panel, motions, names=['left', 'right', 'roof'])


@pytest.mark.parametrize('wet_on_wet', [False, True])
def test_readings_of_a_layer_see_its_coats_only(painted, wet_on_wet):
    layers = np.array(['base', 'Clear', 'clear + base', 'total', ''])
    readings = pd.Readings.of(np.tile([0.1, 0.0, 1.0], (5, 1)), np.full(5, 20.0), layer=layers)
    film = painted(SAGGING, wet_on_wet, readings=readings)
    base, clear, *sums = film.predicted_um
    assert min(base, clear) > 5.0
    assert sums == pytest.approx([base + clear] * 3, abs=1e-12)
    with pytest.raises(PaintError, match="'primer' has no coat of the part; its coats: base"):
        painted(PLAIN, readings=pd.Readings.of([[0.0, 0, 0]], [9.0], layer=np.array('primer')))


def test_what_a_coat_adds_to_a_wet_film_is_the_film_less_that_before():
    coats = Coats.of_guns(['primer', 'base', 'base', 'clear'], 4, {'clear'})
    one, two, both = slice(0, 1), slice(1, 3), slice(1, 4)
    assert coats.films_of('total') == ((1, one), (1, both))
    assert coats.films_of('base') == ((1, two),)
    assert coats.films_of('clear') == ((1, both), (-1, two))
    assert coats.films_of('primer+clear') == ((1, one), (1, both), (-1, two))
    assert coats.films_of('clear+base') == ((1, both),)


@pytest.mark.parametrize(
    ('names', 'message'),
    [
        (['base'], '1 names of coats for 3 motions'),
        (['base', 'clear', 'base'], "'base' is painted, then another, then 'base' again"),
        (['base', 'clear', 'a,b'], "no coat can be called 'a,b'"),
        (['base', 'clear', 'total'], "no coat can be called 'total'"),
    ],
)
def test_names_that_do_not_go_are_refused(names, message):
    with pytest.raises(PaintError, match=message):
        Coats.of_guns(names, 3)

"""A gun that stands still before one spot: doable, within the film given, and without motion."""

from dataclasses import replace

import numpy as np
import pytest

import paint_deposition as pd
from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.inference.design.sprays import MENU
from paint_deposition.inference.diagnosis.proposals import Spray, StationarySpray, spots, suits
from paint_deposition.inference.fitting.forward import Forward

MODEL = pd.DepositionModel()
MOST_UM = 25.0
BY_KEY = {change.key: change for change in MENU}


@pytest.fixture(scope='module')
def panel(sample):
    return sample.experiments[0]


def stand(panel, **more) -> StationarySpray:
    return StationarySpray.before(panel, spots(panel, 1)[0], MODEL, MOST_UM, **more)


def film_um(panel, one, model=MODEL):
    return Forward(pd.Campaign((one.sprayed(panel),)), model.effects).predict_um(model)


def test_the_gun_stands_square_before_a_spot_at_the_distance_of_the_passes(panel):
    one = stand(panel)
    path = one.sprayed(panel).path
    assert path.rotation[:, :, 2] == pytest.approx(np.tile(-one.normal, (len(path), 1)), abs=1e-9)
    away = path.position_m - one.position_m
    assert np.linalg.norm(away, axis=1) == pytest.approx(one.standoff_m, abs=1e-9)
    assert path.spraying_time_s == pytest.approx(one.dwell_s, abs=1e-9)
    assert path.speed_m_per_s.max() == 0.0
    # The tool is turned about its axis as it was on the passes.
    assert one.across @ panel.path.rotation[0, :, 0] > 0.99


def test_the_film_stays_within_the_one_given_and_comes_near_it(panel):
    one = stand(panel)
    film = film_um(panel, one)
    assert 0.7 * MOST_UM < film.max() <= one.peak_um <= MOST_UM
    half = film_um(panel, replace(one, dwell_s=0.5 * one.dwell_s))
    assert half == pytest.approx(0.5 * film, rel=1e-9)
    closer = StationarySpray.before(
        BY_KEY['closer'].made(panel), spots(panel, 1)[0], MODEL, MOST_UM
    )
    assert closer.dwell_s < one.dwell_s
    assert 0.7 * MOST_UM < film_um(panel, closer).max() <= MOST_UM
    # Half a second is needed: the trigger is not quick enough for less film.
    assert StationarySpray.before(panel, spots(panel, 1)[0], MODEL, 0.1) is None


@pytest.mark.parametrize('name', ['corner_slowdown', 'gun_wake', 'pose_lag'])
def test_effects_of_motion_do_not_show(panel, name):
    effect = EFFECTS[name].typical()
    model = MODEL.model_copy(update={'effects': (effect,)})
    passes = Forward(pd.Campaign((panel,)), (effect,))
    assert np.abs(passes.predict_um(model) - passes.predict_um(MODEL)).max() > 1e-4
    one = stand(panel)
    assert film_um(panel, one, model) == pytest.approx(film_um(panel, one), abs=1e-9)


def test_effects_of_a_whole_job_do_not_suit_a_spot():
    assert suits(MODEL, {'lateral shift', 'curvature'})
    assert not suits(MODEL, {'lateral shift', 'order'})
    fog = MODEL.model_copy(update={'effects': (EFFECTS['overspray_fog'].typical(),)})
    assert not suits(fog, {'lateral shift'})


def test_a_film_that_may_sag_is_told():
    thick = Spray('the same passes at twice the flow', ('a', 'b'), 4.0, 1.0, peak_um=60.0,
                  peak_now_um=30.0)  # fmt: skip
    assert thick.film_words == 'the film will reach 60 µm, now 30: see that it does not sag'
    assert replace(thick, peak_um=33.0).film_words == ''

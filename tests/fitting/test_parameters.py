"""The vector that a fit varies: there and back, bounds and priors."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.effects.library.air_drift import AirDrift
from paint_deposition.effects.library.corner_slowdown import CornerSlowdown
from paint_deposition.fitting.parameters import PATTERN, FreeParameters
from paint_deposition.model.pattern import PlanarPattern

PATTERNS = st.builds(
    PlanarPattern,
    K1_cm3_per_s=st.floats(0.05, 20.0),
    K2=st.floats(0.0, 1.0),
    K3=st.floats(0.01, 0.98),
    phi_rad=st.floats(-3.1, 3.1),
    r_m=st.floats(0.0, 0.6),
    sigma1_m=st.floats(0.01, 0.5),
    sigma2_m=st.floats(0.01, 0.5),
)


@given(PATTERNS, st.floats(-0.1, 0.1), st.floats(0.0, 2.0))
def test_a_model_survives_the_way_there_and_back(planar, shift_m, gain):
    model = DepositionModel(
        planar=planar,
        effects=(AirDrift(shift_across_m=shift_m), CornerSlowdown(gain=gain, length_m=0.2)),
    )
    parameters = FreeParameters.of(model, *model.effects)
    again = parameters.decode(parameters.encode(model))
    for name, value in planar:
        assert getattr(again.planar, name) == pytest.approx(value, abs=1e-12), name
    for before, after in zip(model.effects, again.effects, strict=True):
        assert type(after) is type(before)
        assert after.values() == pytest.approx(before.values(), abs=1e-12)
    assert again.projection == model.projection


def test_a_vector_survives_the_way_there_and_back():
    parameters = FreeParameters.of(DepositionModel(), AirDrift())
    vector = np.array([0.7, 0.3, -0.1, 0.2, 0.15, -2.5, -2.0, 0.4, -1.3])
    assert len(parameters) == len(vector) == len(parameters.names)
    assert parameters.encode(parameters.decode(vector)) == pytest.approx(vector)


def test_amplitudes_count_in_their_typical_size():
    parameters = FreeParameters.of(DepositionModel(), AirDrift())
    vector = parameters.encode(parameters.start)
    assert vector[len(PATTERN) :].tolist() == [0.0, 0.0]
    vector[len(PATTERN)] = 2.0
    typical = AirDrift.parameters()['shift_down_m']['typical']
    assert parameters.decode(vector).effect('air_drift').shift_down_m == pytest.approx(2 * typical)
    assert parameters.names[len(PATTERN) :] == (
        'air_drift.shift_down_m',
        'air_drift.shift_across_m',
    )


def test_shapes_and_effects_that_are_not_varied_stay():
    start = DepositionModel(effects=(AirDrift(shift_down_m=0.03),))
    corner = CornerSlowdown(length_m=0.3)
    parameters = FreeParameters.of(start, corner)
    assert parameters.varied == (('corner_slowdown', 'gain'),)
    model = parameters.decode(np.concatenate([parameters.encode(parameters.start)[:-1], [1.0]]))
    assert model.effect('air_drift') == AirDrift(shift_down_m=0.03)
    assert model.effect('corner_slowdown').length_m == 0.3
    assert model.effect('corner_slowdown').gain > 0.0


@pytest.mark.parametrize('effect', EFFECTS.values(), ids=EFFECTS.keys())
def test_bounds_and_prior_suit_every_effect(effect):
    parameters = FreeParameters.of(DepositionModel(), effect())
    low, high = parameters.bounds
    centre, width = parameters.prior
    assert (low <= centre).all()
    assert (centre <= high).all()
    assert (width > 0.0).all()
    for end in (low, high):
        decoded = parameters.decode(end)
        assert parameters.encode(decoded)[len(PATTERN) :] == pytest.approx(end[len(PATTERN) :])


def test_an_asymmetry_beyond_one_is_cut():
    vector = FreeParameters.of(DepositionModel()).encode(DepositionModel())
    vector[2:4] = 0.9
    model = FreeParameters.of(DepositionModel()).decode(vector)
    assert model.planar.K3 == 1.0
    assert model.planar.phi_rad == pytest.approx(np.pi / 4)

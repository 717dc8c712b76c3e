"""The vector that a fit varies: there and back, bounds and priors."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

import paint_deposition as pd
from paint_deposition.effects.catalogue import EFFECTS, LEARNED
from paint_deposition.effects.library.air_drift import AirDrift
from paint_deposition.effects.library.corner_slowdown import CornerSlowdown
from paint_deposition.inference.fitting.parameters import SHAPE_DEVIATIONS, FreeParameters
from paint_deposition.model.eq1_pattern import PATTERN, PlanarPattern

PATTERNS = st.builds(
    PlanarPattern, K1_cm3_per_s=st.floats(0.05, 20.0), K2=st.floats(0.0, 1.0),
    K3=st.floats(0.01, 0.98), phi_rad=st.floats(-3.1, 3.1), r_m=st.floats(0.0, 0.6),
    sigma1_m=st.floats(0.01, 0.5), sigma2_m=st.floats(0.01, 0.5),
)  # fmt: skip


@given(PATTERNS, st.floats(-0.1, 0.1), st.floats(0.0, 2.0))
def test_a_model_survives_the_way_there_and_back(planar, shift_m, gain):
    model = pd.DepositionModel(
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


def test_shapes_are_varied_on_a_logarithmic_scale():
    """Neutral is the centre; the whole physical range is a few widths of the prior."""
    parameters = FreeParameters.of(pd.DepositionModel(), CornerSlowdown(gain=0.5))
    assert parameters.names[len(PATTERN) :] == ('corner_slowdown.gain', 'corner_slowdown.length_m')
    vector = parameters.encode(parameters.start)
    info = CornerSlowdown.parameters()['length_m']
    lengths = []
    for entry in (-0.5, 0.0, 0.5):
        vector[-1] = entry
        effect = parameters.decode(vector).effect('corner_slowdown')
        assert effect.gain == pytest.approx(0.5)
        lengths.append(effect.length_m)
    assert lengths[1] == pytest.approx(info['neutral'])
    assert lengths[2] / lengths[1] == pytest.approx(lengths[1] / lengths[0])
    assert lengths[2] > lengths[0]
    low, high = parameters.bounds
    assert high[-1] - low[-1] == pytest.approx(SHAPE_DEVIATIONS)
    ends = [parameters.decode(end).effect('corner_slowdown').length_m for end in (low, high)]
    assert ends == pytest.approx([info['low'], info['high']])


def test_a_learned_law_has_nothing_to_vary():
    law = LEARNED['time_s'](low=0.0, high=9.0, learned=(0.1, 0.0, -0.1))
    parameters = FreeParameters.of(pd.DepositionModel(), law)
    assert len(parameters) == len(PATTERN)
    assert parameters.decode(parameters.encode(parameters.start)).effect(law.id) == law


@pytest.mark.parametrize('effect', EFFECTS.values(), ids=EFFECTS.keys())
def test_bounds_and_prior_suit_every_effect(effect):
    parameters = FreeParameters.of(pd.DepositionModel(), effect())
    low, high = parameters.bounds
    prior = parameters.prior
    assert (low <= prior.centre).all()
    assert (prior.centre <= high).all()
    assert (prior.width > 0.0).all()
    for end in (low, high):
        decoded = parameters.decode(end)
        assert parameters.encode(decoded)[len(PATTERN) :] == pytest.approx(end[len(PATTERN) :])

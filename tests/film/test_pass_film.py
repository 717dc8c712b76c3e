"""The film across one long pass: closed form and integrator, against eq. (2)."""

import math

import numpy as np
import pytest

from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import PaintError
from paint_deposition.film.pass_film import collapse_um, pass_film_um, sampled_collapse
from paint_deposition.model.eq1_pattern import PlanarPattern
from paint_deposition.model.eq2_projection import Projection
from paint_deposition.model.eq3_collapse import half_width_m
from paint_deposition.motion.path import SprayPath
from paint_deposition.part.points import SurfacePoints
from patterns import PATTERNS, RING
from reference import reference_film_um

SPEED_M_PER_S = 0.2
ACROSS_M = np.linspace(-0.7, 0.7, 57)


def model_of(planar, *effects):
    return DepositionModel(planar=planar, effects=effects)


@pytest.mark.slow
@pytest.mark.parametrize(('standoff_m', 'travel_rad'), [(0.15, 0.0), (0.25, 2.5), (0.4, 2.5)])
def test_collapse_is_the_integral_of_eq2_along_a_pass(standoff_m, travel_rad):
    model = model_of(RING)
    x = np.array([-0.33, 0.0, 0.02, 0.2, 0.4])
    # Tool z to the plane z = 0; the pass runs along the tool's travel_rad.
    way = np.array([math.cos(travel_rad), math.sin(travel_rad), 0.0])
    right = np.array([-way[1], way[0], 0.0])
    steps = 4000
    along = (np.arange(steps) - 0.5 * (steps - 1)) * 0.001
    path = SprayPath.of(
        np.arange(steps), np.full(steps, 0.001 / SPEED_M_PER_S), np.ones(steps),
        np.array([0.0, 0.0, -standoff_m]) + along[:, np.newaxis] * way,
        np.tile(np.eye(3), (steps, 1, 1)), np.tile(SPEED_M_PER_S * way, (steps, 1)),
    )  # fmt: skip
    plane = SurfacePoints(x[:, np.newaxis] * right, np.tile([0.0, 0.0, -1.0], (len(x), 1)))
    film = reference_film_um(plane, path, model)
    got = collapse_um(model, x, SPEED_M_PER_S, standoff_m, travel_rad)
    np.testing.assert_allclose(got, film, rtol=0.0, atol=1e-10 * film.max())


@pytest.mark.parametrize('name', PATTERNS)
@pytest.mark.parametrize(('standoff_m', 'travel_rad'), [(0.25, 0.0), (0.4, 0.9), (0.15, 2.5)])
def test_film_integrator_lays_the_same_pass(name, standoff_m, travel_rad):
    model = model_of(PATTERNS[name])
    across_m = np.append(ACROSS_M, 1e-5)
    direct = collapse_um(model, across_m, SPEED_M_PER_S, standoff_m, travel_rad)
    painted = pass_film_um(model, across_m, SPEED_M_PER_S, standoff_m, travel_rad)
    assert np.abs(painted - direct).max() < 1e-10 * direct.max()


def test_volume_is_kept_and_the_half_width_is_where_the_profile_has_half_its_peak():
    model = model_of(RING)
    for standoff, travel in [(0.1, 0.3), (0.25, 0.0), (0.6, 2.0)]:
        pass_ = sampled_collapse(model, 0.3, standoff_m=standoff, travel_rad=travel)
        assert pass_.area_um_m == pytest.approx(RING.K1_cm3_per_s / 0.3, rel=1e-9)
    pass_ = sampled_collapse(model_of(PlanarPattern(K3=0.0)), 0.2)
    half = 0.5 * half_width_m(pass_)
    peak = pass_.thickness_um(ACROSS_M).max()
    assert pass_.thickness_um(np.array([half])) == pytest.approx(0.5 * peak, rel=0.01)
    assert half_width_m(pass_) == pytest.approx(0.574, abs=1e-3)


def test_a_gun_lays_one_profile_both_ways_and_drifting_air_shifts_it_down_whichever():
    bare = model_of(RING)
    wake = model_of(RING, EFFECTS['gun_wake'](lag_s=0.03))
    # A wake moves the kink of eq. (1) off the finest sub-steps.
    for model, precision in ((bare, 1e-6), (wake, 1e-5)):
        forth = collapse_um(model, ACROSS_M, SPEED_M_PER_S)
        back = collapse_um(model, ACROSS_M, SPEED_M_PER_S, backwards=True)
        np.testing.assert_allclose(back, forth, atol=precision * forth.max())
        turned = collapse_um(model, ACROSS_M, SPEED_M_PER_S, backwards=True, turned=True)
        np.testing.assert_allclose(turned, forth[::-1], atol=precision * forth.max())
        assert np.abs(turned - forth).max() > 0.05 * forth.max()
    model = model_of(RING, EFFECTS['air_drift'](shift_down_m=0.03))
    for turned in (False, True):
        still = collapse_um(model_of(RING), ACROSS_M + 0.03, 0.2, turned=turned)
        got = collapse_um(model, ACROSS_M, 0.2, turned=turned)
        np.testing.assert_allclose(got, still, atol=1e-6 * still.max())


@pytest.mark.parametrize('name', PATTERNS)
def test_sampled_collapse_is_the_collapse(name):
    model = model_of(PATTERNS[name])
    sampled = sampled_collapse(model, 0.2)
    x = np.random.default_rng(0).uniform(-0.9, 0.9, 2000)
    exact = collapse_um(model, x, 0.2)
    assert np.abs(sampled.thickness_um(x) - exact).max() < 1e-4 * exact.max()
    assert sampled.thickness_um(np.array([sampled.reach_m + 0.01]))[0] == 0.0


@pytest.mark.parametrize(
    ('speed', 'standoff', 'offset', 'remedy'),
    [*((*wrong, 0.05, 'give a number above 0') for wrong in ((0.0, 0.25), (-1.0, 0.25), (0.2, 0))),
     (0.2, 0.03, -0.04, r'0.04 m in front of the TCP: give a standoff above 0.041')],
)  # fmt: skip
def test_impossible_passes_are_refused(speed, standoff, offset, remedy):
    model = DepositionModel(projection=Projection(emission_offset_m=offset))
    for one in (model, model.with_effect(EFFECTS['gun_wake'].typical())):
        with pytest.raises(PaintError, match=remedy):
            collapse_um(one, ACROSS_M, speed, standoff)
        with pytest.raises(PaintError, match=remedy):
            sampled_collapse(one, speed, standoff_m=standoff)

"""Other forms of the laws keep what their effect is: sign, reference, limits, conservation."""

import numpy as np
import pytest

from .doors import Part
from .flight import Air, Landings
from .jobs import Plan, drive, slices
from .parcels import Pattern, conner_plume
from .test_truths import COLUMN, centre, change
from .truths import Scene, library

PATTERN = Pattern(1.5, K2=0.2, K3=0.0, phi_rad=0.0, r_m=0.09, sigma1_m=0.04, sigma2_m=0.06)
FLAT = Part('door', 1.2, 0.9)
VALLEY = Part('door', 1.2, 0.9, crown_x_m=-0.25)
RIDGE = Part('door', 1.2, 0.9, crown_x_m=0.25)
KNOWN = library()


def forms(effect_id):
    return sorted(name for name, truth in KNOWN.items() if truth.id == effect_id)


def hidden(name, amplitude, **drawn):
    details = KNOWN[name].details(np.random.default_rng(0))
    return KNOWN[name](amplitude, {**details, **drawn})


def scene(part=FLAT):
    plan = Plan(passes=4, overrun_m=0.3, gun_margin_m=0.2, teach_error_m=0.0, follow=0.0)
    return Scene(part, PATTERN, drive(part, plan, np.random.default_rng(0)))


def landed(part, x, z, cosine=1.0, beyond_m=0.0):
    x, z = np.broadcast_arrays(np.atleast_1d(x).astype(float), z)
    one, at = np.ones(x.shape), part.point(x, z)
    return Landings(np.arange(x.size), one, one, at, cosine * one, beyond_m * one, at)


def flow_of(truth, at=None):
    place = scene()
    return truth.on_flow(place.nominal.commanded, place), place.nominal


@pytest.mark.parametrize('name', sorted(n for n, truth in KNOWN.items() if truth.form))
def test_without_amplitude_nothing_changes(name):
    truth, place = hidden(name, 0.0), scene(VALLEY)
    x, z = np.linspace(-0.5, 0.5, 30), np.linspace(0.05, 0.85, 30)
    kept = truth.on_landing(landed(VALLEY, x, z, 0.8, 0.05), place)
    assert np.allclose(kept, 1.0)
    time_s = place.nominal.time_s
    flow = place.nominal.commanded
    assert np.allclose(truth.on_flow(flow, place)(time_s), flow(time_s))
    assert np.allclose(truth.on_motion(place.nominal, place).tcp_m, place.nominal.tcp_m)
    film = np.linspace(5.0, 30.0, 30)
    assert np.allclose(truth.on_film(film, x, z, place, lambda x, z: 20.0 + 0.0 * x), film)
    assert np.allclose(truth.on_gauge(film, x, z, place), film)


@pytest.mark.parametrize('name', forms('edge_build'))
def test_edges_gain_their_amplitude_and_the_middle_nothing(name):
    x = np.linspace(-0.6, 0.0, 400)
    gain = hidden(name, 0.3, reach_m=0.03).on_landing(landed(FLAT, x, 0.45), scene())
    assert gain[0] == pytest.approx(1.3, rel=1e-6)
    assert gain[-1] == pytest.approx(1.0, abs=0.002)


@pytest.mark.parametrize('name', [n for n in forms('faraday_shielding') if '~' in n])
def test_recesses_lose_by_their_measure_and_ridges_nothing(name):
    """The measure is 1 in a valley of 250 mm radius, so that little amplitudes mean the same."""
    truth = hidden(name, 0.05)
    lost = 1.0 - truth.on_landing(landed(VALLEY, 0.0, 0.45), scene(VALLEY))
    assert lost == pytest.approx(0.05, rel=0.15)
    for part in (FLAT, RIDGE):
        assert np.allclose(truth.on_landing(landed(part, [-0.3, 0.0], 0.45), scene(part)), 1.0)


@pytest.mark.parametrize('name', forms('convex_attraction'))
def test_ridges_gain_and_valleys_nothing(name):
    truth = hidden(name, 0.2)
    gain = truth.on_landing(landed(RIDGE, 0.0, 0.45), scene(RIDGE))
    assert gain == pytest.approx(1.2, abs=0.01)
    assert np.allclose(truth.on_landing(landed(VALLEY, 0.0, 0.45), scene(VALLEY)), 1.0)


@pytest.mark.parametrize('name', forms('incidence_attraction'))
@pytest.mark.parametrize('amplitude', [0.5, -0.5])
def test_incidence_acts_on_surface_that_turns_away(name, amplitude):
    cosine = np.cos(np.deg2rad([0.0, 20.0, 40.0, 60.0]))
    kept = hidden(name, amplitude).on_landing(landed(FLAT, [0.0] * 4, 0.45, cosine), scene())
    assert kept[0] == pytest.approx(1.0)
    assert np.all(np.sign(amplitude) * np.diff(kept) > 0.0)
    assert kept.min() > 0.0


def test_a_delayed_valve_gives_what_it_owes():
    """As long late at the end as at the start: the same paint, moved along."""
    truth = hidden('trigger_lag~delay', 0.2, fall_ratio=1.0)
    flow, motion = flow_of(truth)
    start = motion.trigger_s[motion.trigger_on][0]
    assert list(flow(start + np.array([0.1, 0.3]))) == [0.0, 1.0]
    time_s = np.linspace(motion.time_s[0], motion.time_s[-1], 400_001)
    given, owed = (np.trapezoid(f(time_s), time_s) for f in (flow, motion.commanded))
    assert given == pytest.approx(owed, rel=1e-3)


@pytest.mark.parametrize('name', ['flow_drift', 'flow_drift~by_pass', 'flow_drift~settling'])
def test_flow_grows_by_the_amplitude_a_pass(name):
    flow, motion = flow_of(hidden(name, 0.02))
    times = motion.time_s[motion.commanded(motion.time_s) > 0]
    first, last = flow(times[[0, -1]])
    whole = 4 if name == 'flow_drift' else 3
    assert last - first == pytest.approx(0.02 * whole, rel=0.02)
    assert first < 1.0 < last


@pytest.mark.parametrize('effect', ['pattern_spread', 'air_drift'])
def test_droplets_of_mean_size_are_carried_alike_by_every_form(effect):
    plume = conner_plume(PATTERN, 1 << 12, seed=1)
    spraying = slices(scene().nominal, scene().nominal.commanded)
    still = Air(np.zeros_like(spraying.tcp_0_m), np.zeros_like(plume.x_m))
    for name in forms(effect):
        air = hidden(name, 0.02, direction=np.array([0.0, 0.0, -1.0])).on_air(
            still, spraying, plume
        )
        size = air.narrowing.mean() if effect == 'pattern_spread' else -air.drift_m[:, 2].mean()
        assert size == pytest.approx(0.02, rel=0.01), name


@pytest.mark.slow
@pytest.mark.parametrize(('form', 'power'), [('~square', 2.0), ('~carried', 1.0)])
def test_a_draught_displaces_by_a_power_of_the_way(form, power):
    """Half the way to the model plane: 125 mm of 250."""
    clean, film = change(
        f'air_drift{form}', COLUMN, 0.02, drawn={'direction': np.array([0, 0, -1.0])},
        standoff_m=0.125, gun_margin_m=0.25,
    )  # fmt: skip
    moved = centre(film, COLUMN[1]) - centre(clean, COLUMN[1])
    assert moved == pytest.approx(-0.02 * 0.5**power, abs=0.0006)


@pytest.mark.parametrize('name', forms('sag'))
def test_every_fluid_runs_down_and_none_is_lost(name):
    z = np.linspace(0.0, 1.0, 401)
    bump = 5.0 + 20.0 * np.exp(-(((z - 0.6) / 0.1) ** 2))[None, :]
    after = hidden(name, 0.1).run_down(bump, z[1] - z[0])
    left = after.sum() + (0.1 / 20.0**3 * 5.0**3) / (z[1] - z[0]) * (name == 'sag')
    assert left == pytest.approx(bump.sum(), rel=2e-4)
    assert (after * z).sum() < (bump * z).sum()

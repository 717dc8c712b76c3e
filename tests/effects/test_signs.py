"""A positive parameter does what its description says, a negative one the opposite."""

from collections.abc import Callable

import numpy as np
import pytest

import booth
from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.part.points import SurfacePoints

X, UP = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
Figure = Callable[[np.ndarray, SurfacePoints], float]


def along(axis: np.ndarray) -> Figure:
    return lambda film_um, points: float(booth.centroid_m(film_um, points) @ axis)


def negative(figure: Figure) -> Figure:
    return lambda film_um, points: -figure(film_um, points)


def on_ridges(film_um: np.ndarray, points: SurfacePoints) -> float:
    return float(film_um[points.curvature_per_m < -1.0].sum())


def off_valleys(film_um: np.ndarray, points: SurfacePoints) -> float:
    return -float(film_um[points.curvature_per_m > 1.0].sum())


rightward, leftward, upward, downward = along(X), along(-X), along(UP), along(-UP)
narrowness, loss = negative(booth.spread_m), negative(booth.volume_cm3)
FAR, NEAR = booth.spot(standoff_m=0.32), booth.spot(standoff_m=0.2)
ASIDE = booth.spot(x_m=0.2)
PASS = booth.serpentine((0.0,), half_width_m=0.4, opens_at_m=0.25)
PASSES = booth.serpentine((0.1, -0.1), half_width_m=0.4, opens_at_m=0.25)
ON_DOOR = booth.serpentine((0.2, 0.45), half_width_m=0.7, opens_at_m=0.65)

# What a positive value of each amplitude makes more of, and where.
EXPECTED = {
    ('incidence_attraction', 'attraction'): (booth.volume_cm3, booth.panel, NEAR),
    ('standoff_efficiency', 'exponent'): (loss, booth.panel, FAR),
    ('pattern_spread', 'exponent'): (booth.spread_m, booth.panel, FAR),
    ('tcp_standoff', 'offset_z_m'): (narrowness, booth.panel, FAR),
    ('air_drift', 'shift_down_m'): (downward, booth.panel, FAR),
    ('air_drift', 'shift_across_m'): (rightward, booth.panel, FAR),
    ('tcp_offset', 'offset_x_m'): (rightward, booth.panel, FAR),
    ('tcp_offset', 'offset_y_m'): (downward, booth.panel, FAR),
    ('tcp_tilt', 'tilt_x_rad'): (upward, booth.panel, FAR),
    ('tcp_tilt', 'tilt_y_rad'): (rightward, booth.panel, FAR),
    ('part_misalignment', 'shift_down_m'): (upward, booth.panel, FAR),
    ('part_misalignment', 'shift_across_m'): (leftward, booth.panel, FAR),
    ('part_misalignment', 'shift_deep_m'): (booth.spread_m, booth.panel, FAR),
    ('part_misalignment', 'yaw_rad'): (downward, booth.panel, ASIDE),
    ('sag', 'run_m'): (downward, booth.panel, NEAR),
    ('convex_attraction', 'gain'): (on_ridges, booth.door, ON_DOOR),
    ('faraday_shielding', 'shielding'): (off_valleys, booth.door, ON_DOOR),
    ('gauge_curvature_bias', 'bias_um'): (on_ridges, booth.door, ON_DOOR),
    ('edge_build', 'gain'): (booth.volume_cm3, booth.door, ON_DOOR),
    ('corner_slowdown', 'gain'): (booth.volume_cm3, booth.panel, PASSES),
    ('trigger_lag', 'rise_s'): (loss, booth.panel, PASS),
    ('trigger_lag', 'fall_s'): (booth.volume_cm3, booth.panel, PASS),
    ('flow_drift', 'drift_per_pass'): (downward, booth.panel, PASSES),
    ('fog_gradient', 'fog_um'): (downward, booth.panel, NEAR),
    ('overspray_fog', 'fog_um'): (booth.volume_cm3, booth.panel, NEAR),
    ('gauge_gain', 'gain'): (booth.volume_cm3, booth.panel, NEAR),
    ('gauge_zero', 'offset_um'): (booth.volume_cm3, booth.panel, NEAR),
    ('pose_lag', 'lag_s'): (rightward, booth.panel, PASS),
    ('gun_wake', 'lag_s'): (leftward, booth.panel, PASS),
    ('occlusion', 'strength'): (loss, booth.panel_with_screen, NEAR),
}


def test_every_amplitude_has_a_sign():
    assert set(EXPECTED) == {(e.id, name) for e in EFFECTS.values() for name in e.amplitudes()}


@pytest.mark.parametrize(('effect_id', 'name'), EXPECTED, ids=['-'.join(key) for key in EXPECTED])
def test_sign(effect_id: str, name: str):
    figure, part, motion = EXPECTED[effect_id, name]
    effect, path = EFFECTS[effect_id], booth.path_of(motion)
    at = effect.parameters()[name]

    def of(value: float) -> float:
        film_um = booth.painted(part(), path, effect(**{name: value})).gauge_um
        return figure(film_um, part().points())

    neutral = of(at['neutral'])
    visible = 1e-6 * abs(neutral) + 1e-9
    assert of(at['neutral'] + at['typical']) > neutral + visible
    if at['low'] < at['neutral']:
        assert of(at['neutral'] - at['typical']) < neutral - visible

"""A positive parameter does what its description says, a negative one the opposite."""

from collections.abc import Callable

import numpy as np
import pytest

from booth import (
    centroid_m,
    door,
    painted,
    panel,
    panel_with_screen,
    path_of,
    serpentine,
    spot,
    spread_m,
    volume_cm3,
)
from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.part.points import SurfacePoints

X, UP = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
Figure = Callable[[np.ndarray, SurfacePoints], float]


def along(axis: np.ndarray) -> Figure:
    return lambda film_um, points: float(centroid_m(film_um, points) @ axis)


def negative(figure: Figure) -> Figure:
    return lambda film_um, points: -figure(film_um, points)


def on_ridges(film_um: np.ndarray, points: SurfacePoints) -> float:
    return float(film_um[points.curvature_per_m < -1.0].sum())


def off_valleys(film_um: np.ndarray, points: SurfacePoints) -> float:
    return -float(film_um[points.curvature_per_m > 1.0].sum())


rightward, leftward, upward, downward = along(X), along(-X), along(UP), along(-UP)
narrowness, loss = negative(spread_m), negative(volume_cm3)
FAR, NEAR = spot(standoff_m=0.32), spot(standoff_m=0.2)
ASIDE = spot(x_m=0.2)
PASS = serpentine((0.0,), half_width_m=0.4, opens_at_m=0.25)
PASSES = serpentine((0.1, -0.1), half_width_m=0.4, opens_at_m=0.25)
ON_DOOR = serpentine((0.2, 0.45), half_width_m=0.7, opens_at_m=0.65)

# What a positive value of each amplitude makes more of, and where.
EXPECTED = {
    ('incidence_attraction', 'attraction'): (volume_cm3, panel, NEAR),
    ('standoff_efficiency', 'exponent'): (loss, panel, FAR),
    ('pattern_spread', 'exponent'): (spread_m, panel, FAR),
    ('tcp_standoff', 'offset_z_m'): (narrowness, panel, FAR),
    ('air_drift', 'shift_down_m'): (downward, panel, FAR),
    ('air_drift', 'shift_across_m'): (rightward, panel, FAR),
    ('tcp_offset', 'offset_x_m'): (rightward, panel, FAR),
    ('tcp_offset', 'offset_y_m'): (downward, panel, FAR),
    ('tcp_tilt', 'tilt_x_rad'): (upward, panel, FAR),
    ('tcp_tilt', 'tilt_y_rad'): (rightward, panel, FAR),
    ('part_misalignment', 'shift_down_m'): (upward, panel, FAR),
    ('part_misalignment', 'shift_across_m'): (leftward, panel, FAR),
    ('part_misalignment', 'shift_deep_m'): (spread_m, panel, FAR),
    ('part_misalignment', 'yaw_rad'): (downward, panel, ASIDE),
    ('sag', 'run_m'): (downward, panel, NEAR),
    ('convex_attraction', 'gain'): (on_ridges, door, ON_DOOR),
    ('faraday_shielding', 'shielding'): (off_valleys, door, ON_DOOR),
    ('gauge_curvature_bias', 'bias_um'): (on_ridges, door, ON_DOOR),
    ('edge_build', 'gain'): (volume_cm3, door, ON_DOOR),
    ('corner_slowdown', 'gain'): (volume_cm3, panel, PASSES),
    ('trigger_lag', 'rise_s'): (loss, panel, PASS),
    ('trigger_lag', 'fall_s'): (volume_cm3, panel, PASS),
    ('flow_drift', 'drift_per_pass'): (downward, panel, PASSES),
    ('fog_gradient', 'fog_um'): (downward, panel, NEAR),
    ('overspray_fog', 'fog_um'): (volume_cm3, panel, NEAR),
    ('gauge_gain', 'gain'): (volume_cm3, panel, NEAR),
    ('gauge_zero', 'offset_um'): (volume_cm3, panel, NEAR),
    ('pose_lag', 'lag_s'): (rightward, panel, PASS),
    ('gun_wake', 'lag_s'): (leftward, panel, PASS),
    ('occlusion', 'strength'): (loss, panel_with_screen, NEAR),
}


def test_every_amplitude_has_a_sign():
    assert set(EXPECTED) == {(e.id, name) for e in EFFECTS.values() for name in e.amplitudes()}


@pytest.mark.parametrize(('effect_id', 'name'), EXPECTED, ids=['-'.join(key) for key in EXPECTED])
def test_sign(effect_id: str, name: str):
    figure, part, motion = EXPECTED[effect_id, name]
    effect, path = EFFECTS[effect_id], path_of(motion)
    at = effect.parameters()[name]

    def of(value: float) -> float:
        film_um = painted(part(), path, effect(**{name: value})).gauge_um
        return figure(film_um, part().points())

    neutral = of(at['neutral'])
    visible = 1e-6 * abs(neutral) + 1e-9
    assert of(at['neutral'] + at['typical']) > neutral + visible
    if at['low'] < at['neutral']:
        assert of(at['neutral'] - at['typical']) < neutral - visible

"""Whatever is painted with whatever: no film below zero, no paint from nowhere, live as offline.

`make numbers` tries 10,000 paths and models; PAINT_EXAMPLES says how many here.
"""

import os

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import paint_deposition as pd
from paint_deposition.effects.catalogue import effect_class
from paint_deposition.film.live_film import LiveFilm
from paint_deposition.model.eq1_pattern import PlanarPattern
from paint_deposition.model.eq2_projection import Projection
from paint_deposition.motion.pose_stream import TriggerChange
from scenes import LOOKING_DOWN, lying_plane, painted, poses, stamps_ns

EXAMPLES = int(os.environ.get('PAINT_EXAMPLES', '10'))
many = settings(max_examples=EXAMPLES, suppress_health_check=[HealthCheck.too_slow])
# Of each way in which a law can act: on the flux, on the path, with what lies ahead, over time.
LAWS = [
    (), ('incidence_attraction',), ('trigger_lag', 'air_drift'), ('corner_slowdown',),
    ('flow_drift',),
]  # fmt: skip
PLANE = lying_plane(0.7, 72)


@st.composite
def models(draw) -> pd.DepositionModel:
    """A narrow pattern, hollow, so that a sum over points 20 mm apart is off by under 0.4 %."""
    planar = PlanarPattern(
        K1_cm3_per_s=draw(st.floats(0.1, 10.0)), K2=draw(st.floats(0.0, 1.0)),
        K3=draw(st.floats(0.0, 1.0)), phi_rad=draw(st.floats(-3.1, 3.1)),
        r_m=draw(st.floats(0.06, 0.08)), sigma1_m=draw(st.floats(0.03, 0.04)),
        sigma2_m=draw(st.floats(0.03, 0.05)),
    )  # fmt: skip
    plane = draw(st.floats(0.2, 0.4))
    projection = Projection(model_plane_m=plane, emission_offset_m=draw(st.floats(0.0, 0.1)))
    laws = [effect_class(name).typical() for name in draw(st.sampled_from(LAWS))]
    return pd.DepositionModel(planar=planar, projection=projection, effects=tuple(laws))


@st.composite
def motions(draw) -> pd.Trajectory:
    """Straight legs between random corners at a random rate, with a random trigger or none."""
    corners = np.array(draw(st.lists(
        st.tuples(*[st.floats(-0.2, 0.2)] * 2, st.floats(0.2, 0.3)), min_size=2, max_size=4,
    )))  # fmt: skip
    times_s = np.arange(0.0, draw(st.floats(0.5, 2.0)), draw(st.sampled_from([0.004, 0.01, 0.04])))
    at_corner = np.linspace(0.0, times_s[-1], len(corners))
    positions = np.stack([np.interp(times_s, at_corner, c) for c in corners.T], axis=1)
    tilt = Rotation.from_euler('xyz', draw(st.tuples(*[st.floats(-0.3, 0.3)] * 3)))
    quaternion = (Rotation.from_quat(LOOKING_DOWN) * tilt).as_quat()
    switched_s = sorted(draw(st.lists(st.floats(0.0, 2.0), max_size=4)))
    flow = draw(st.lists(
        st.sampled_from([0.0, 0.5, 1.0]), min_size=len(switched_s), max_size=len(switched_s),
    ))  # fmt: skip
    return pd.Trajectory(
        stamps_ns(times_s), positions, np.tile(quaternion, (len(times_s), 1)), 'part',
        stamps_ns(switched_s), np.array(flow, dtype=float),
    )  # fmt: skip


@pytest.mark.slow
@many
@given(motion=motions(), model=models())
def test_a_film_is_never_negative_and_holds_what_was_sprayed(motion, model):
    film = painted(PLANE, motion, model, 'double')
    assert (film.film_um >= 0.0).all()
    assert np.isfinite(film.film_um).all()
    landed_cm3 = float(film.film_um @ PLANE.area_m2)
    # All of the narrow pattern meets the plane; what is off is the sum over its points.
    off_cm3 = 0.01 * film.used.emitted_cm3
    attraction = sum(effect.attraction for effect in model.effects if effect.flux_factor)
    # It lays 1 + a (1 - cos) of what there is: more than all, and less than 1 + a times.
    assert landed_cm3 >= film.used.emitted_cm3 - off_cm3
    assert landed_cm3 <= (1.0 + attraction) * film.used.emitted_cm3 + off_cm3


@pytest.mark.slow
@many
@given(
    motion=motions(), model=models(),
    sizes=st.lists(st.integers(1, 60), min_size=1, max_size=5),
)  # fmt: skip
def test_the_live_film_is_the_offline_film_to_the_last_bit(motion, model, sizes):
    expected = painted(PLANE, motion, model, 'double')
    film = LiveFilm(PLANE, model, precision='double')
    states = list(zip(motion.trigger_stamps_ns.tolist(), motion.trigger_flow, strict=True))
    start = turn = 0
    while start < len(motion):
        rows = slice(start, start + sizes[turn % len(sizes)])
        batch = poses(motion, rows)
        while states and states[0][0] <= batch.stamps_ns[-1]:
            film.add_trigger(TriggerChange(states[0][0], float(states.pop(0)[1])))
        film.add_poses(batch)
        film.snapshot()  # looking at the film changes nothing
        start, turn = rows.stop, turn + 1
    for stamp, flow in states:
        film.add_trigger(TriggerChange(stamp, float(flow)))
    assert np.array_equal(film.snapshot().film_um, expected.film_um)

"""Cases are repeatable, as hard as they say, and their noise is what it is said to be."""

import numpy as np
import pytest

from worlds.record import KINDS

from .cases import GUESSED, MESH_EDGES_M, READINGS, SIZES, draw_case
from .gauge import GaugeNoise, measure
from .truths import library


@pytest.mark.parametrize('kind', KINDS)
def test_cases_are_of_their_kind_and_within_their_ranges(kind):
    known = library()
    cases = [draw_case(seed, kind) for seed in range(30)]
    for case in cases:
        assert len(case.truths) == {'clean': 0, 'pair': 2}.get(kind, 1)
        assert READINGS[0] <= case.readings <= READINGS[1]
        assert MESH_EDGES_M[0] <= case.mesh_edge_m <= MESH_EDGES_M[1]
        for name, amplitude in zip(case.truths, case.amplitudes, strict=True):
            truth = known[name]
            assert (kind in ('unknown', 'footprint')) == (':' in name)
            assert abs(amplitude) <= truth.most
            size = abs(amplitude) / truth.typical
            # Rebound is drawn 0.6 times as large as attraction.
            assert 0.6 * SIZES[0] / GUESSED <= size <= SIZES[1] * GUESSED
        if kind == 'pair':
            one, other = (known[name] for name in case.truths)
            assert one.family != other.family
    for choice in ('stated', 'layout'):
        assert len({getattr(case, choice) for case in cases}) > 1


def test_repeats_share_the_texture_and_parts_their_level():
    spot = np.repeat(np.arange(2000), 2)
    film = np.full(4000, 100.0)
    noise = GaugeNoise(floor_um=0.0, relative=0.0, texture=0.01, level=0.05)
    session = measure(spot, film, film, noise, np.random.default_rng(3))
    first, second = session.thickness_um[::2], session.thickness_um[1::2]
    assert np.array_equal(first, second)
    assert first.std() / session.level == pytest.approx(1.0, rel=0.06)
    assert first.mean() == pytest.approx(100.0 * session.level, abs=0.1)
    levels = [
        measure(spot[:1], film[:1], film[:1], noise, np.random.default_rng(k)).level
        for k in range(500)
    ]
    assert np.std(levels) == pytest.approx(0.05, rel=0.1)

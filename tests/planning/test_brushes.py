"""A programme that is timed anew keeps the brush of each opening."""

from dataclasses import replace

import numpy as np
import pytest

from brushes import NARROW, switched, two_brushes
from paint_deposition.errors import ModelError
from paint_deposition.planning.improvement.limits import Limits
from paint_deposition.planning.improvement.moves import moves_of
from paint_deposition.planning.improvement.programme import Programme
from paint_deposition.planning.index_request import Request
from paint_deposition.planning.recommendation import recommend
from scenes import stamps_ns, straight_pass

# 0.3 m/s along x from -0.6 m: brush 1, then 2 without closing, off, and 2 at another flow.
CHANGES = switched(stamps_ns([0.5, 1.5, 2.0, 3.0, 3.5]), (1, 1), (1, 2), (0, 0), (0.5, 2), (0, 0))
MOTION = replace(straight_pass(np.arange(0.0, 4.001, 0.02)), **CHANGES)


def test_openings_end_where_the_brush_changes():
    programme = Programme.of(MOTION)
    found = [(o.on_m, o.off_m, o.flow, o.brush) for o in programme.openings]
    expected = [(0.15, 0.45, 1.0, 1), (0.45, 0.6, 1.0, 2), (0.9, 1.05, 0.5, 2)]
    assert [f[2:] for f in found] == [e[2:] for e in expected]
    assert np.allclose([f[:2] for f in found], [e[:2] for e in expected], atol=1e-6)


def test_motion_and_moves_tell_the_brush():
    programme = Programme.of(MOTION)
    opened = [(flow, brush) for _, flow, brush in programme.trajectory().triggers if flow]
    assert opened == [(1.0, 1), (1.0, 2), (0.5, 2)]
    moves = [(move.flow, move.brush) for move in moves_of(programme, Limits()) if move.spraying]
    assert list(dict.fromkeys(moves)) == [(1.0, 1), (1.0, 2), (0.5, 2)]


def test_an_index_is_for_one_brush():
    model, request = two_brushes(), Request(speed_m_per_s=0.3)
    with pytest.raises(ModelError, match='an index is for one brush and the model has 1, 2'):
        recommend(model, request)
    of_one = recommend(model.with_brush(1), request)
    plain = recommend(model.with_brush(1).model_copy(update={'brushes': ()}), request)
    assert of_one.index_m == plain.index_m
    assert model.with_brush(1).planar == NARROW

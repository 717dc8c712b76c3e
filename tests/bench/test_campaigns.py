"""Cases come back as the package reads them, their noise drawn anew, their errors judged."""

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.campaigns import PaintedCase
from benchmarks.rivals import Points, visible_strength
from benchmarks.unseen import oracle_unseen_error, unseen_error
from tests.virtual_paint_shop.cases import draw_case

pytestmark = pytest.mark.slow


@pytest.fixture(scope='module')
def painted(tmp_path_factory):
    """A panel and a door with fog of 2 um, measured at 80 points, few parcels."""
    case = draw_case(5, 'effect', ('overspray_fog',))
    noise = replace(case.noise, slip_fraction=0.05, heavy_tails=False)
    case = replace(
        case, layout=('panel', 'door'), readings=80, amplitudes=(2.0,), noise=noise, stated=True
    )
    return PaintedCase.of(case, tmp_path_factory.mktemp('films'), 1_000_000)


def test_the_same_draw_has_the_same_noise(painted):
    one, again, other = (painted.draw(k).campaign.readings.thickness_um for k in (1, 1, 2))
    assert np.array_equal(one, again)
    assert np.mean(one == other) < 0.1


def test_mistyped_readings_are_not_held_against_anyone(painted):
    points = Points.of(painted, painted.draw(0))
    assert not points.kept.all()
    away = (points.mean_um - points.expected_um)[points.kept]
    assert np.abs(away / np.hypot(points.sigma_um[points.kept], 2.5)).max() < 4.0


def test_a_mark_is_seen_as_far_as_no_pattern_explains_it(painted):
    points = Points.of(painted, painted.draw(0))
    gain = 0.02 * painted.forward.predict_um(painted.pattern)
    fog = points.marks_um[:, 0]
    assert np.allclose(fog, 2.0)
    assert visible_strength(painted, points, gain) < 0.1
    assert visible_strength(painted, points, fog) > 1.0


def test_errors_on_unseen_readings_are_of_the_model_and_not_of_the_noise(painted):
    draw = painted.draw(0)
    points = Points.of(painted, draw)
    true = painted.pattern
    wide = true.planar.model_copy(update={'sigma1_m': 1.5 * true.planar.sigma1_m})
    wrong = unseen_error(painted, draw, points, true.model_copy(update={'planar': wide}))
    assert 1.0 <= oracle_unseen_error(painted, points) < 1.4
    assert 1.0 <= unseen_error(painted, draw, points, true) < wrong

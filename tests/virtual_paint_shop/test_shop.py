"""Campaigns are repeatable and believable, and the shop keeps to itself."""

import re
from pathlib import Path

import numpy as np
import pytest

from .draw import draw_jobs
from .jobs import record
from .parcels import conner_plume, half_width_m
from .shop import generate, panel_study


@pytest.mark.slow
def test_same_seed_same_campaign_whatever_is_hidden():
    few = {'parcels': 300_000, 'readings': 40, 'repeats': 10, 'heldout': 10}
    clean, again = generate(5, **few), generate(5, **few)
    hidden = generate(5, 'overspray_fog', amplitude=1.0, **few)
    a, b, c = (x.experiments[0] for x in (clean, again, hidden))
    assert np.array_equal(a.readings.thickness_um, b.readings.thickness_um)
    assert np.array_equal(a.log.positions_m, c.log.positions_m)
    assert np.array_equal(a.readings.positions_m, c.readings.positions_m)
    assert np.allclose(c.readings.thickness_um - a.readings.thickness_um, 1.0, atol=0.1)
    assert hidden.truth['hidden'][0]['visible_rms_um']['door'] == pytest.approx(1.0)
    other = generate(6, **few).experiments[0]
    assert not np.array_equal(other.vertices_m, a.vertices_m)


@pytest.mark.parametrize('seed', range(4))
def test_jobs_are_believable(seed):
    pattern, (job,) = draw_jobs(seed, [], ('door',), 0.05, None)
    plan, motion = job.plan, job.motion
    assert 0.9 <= job.part.width_m <= 1.3
    assert 0.7 <= job.part.height_m <= 1.0
    assert 0.15 <= plan.index_m <= 0.5
    assert 3 <= plan.passes <= 6
    assert 12.0 <= pattern.K1_cm3_per_s / (plan.speed_m_per_s * plan.index_m) <= 30.0
    assert 0.05 < plan.speed_m_per_s < 1.0
    log = record(motion, plan.sample_s, np.random.default_rng(seed))
    assert 900 <= log.stamps_ns.size <= 3200
    assert np.diff(log.stamps_ns).min() > 0
    assert np.diff(log.stamps_ns).max() < 0.25e9
    away = motion.tcp_m[:, 1] - job.part.height(motion.tcp_m[:, 0], motion.tcp_m[:, 2])
    over = job.part.edge_distance(motion.tcp_m[:, 0], motion.tcp_m[:, 2]) > 0
    assert 0.15 < away[over].min() < away[over].max() < 0.40


@pytest.mark.slow
def test_panel_study_paints_one_bell_at_three_indexes():
    studies = [panel_study(1, index, parcels=1_000_000) for index in (0.577, 0.525, 0.625)]
    assert len({s.pattern for s in studies}) == 1
    films = [s.experiments[0].readings.film_um.mean() for s in studies]
    assert films[1] > films[0] > films[2]
    assert 0.5 < half_width_m(conner_plume(studies[0].pattern, 1 << 15, 1)) < 0.65


def test_unknown_names_are_refused():
    with pytest.raises(ValueError, match='air_drift'):
        generate(1, 'air_drfit')
    with pytest.raises(ValueError, match='door_vertical'):
        generate(1, experiments=('bonnet',))


def test_the_shop_shares_no_code_with_what_it_judges():
    for source in Path(__file__).parent.glob('*.py'):
        imports = re.findall(r'^\s*(?:from|import)\s+(\S+)', source.read_text(), re.MULTILINE)
        assert not [name for name in imports if name.startswith('paint_')], source.name

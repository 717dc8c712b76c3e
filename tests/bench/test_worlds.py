"""The worlds paint by eq. (2) where nothing is hidden, and by laws of their own else."""

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.worlds import droplets, semi_real
from benchmarks.worlds.measured import available
from benchmarks.worlds.record import KINDS, detectability
from tests.virtual_paint_shop.gauge import GaugeNoise

import paint_deposition as pd

WIDTH_M, FLOW = 0.09, 1.5
MODEL = f"""
planar: {{K1_cm3_per_s: {FLOW}, K2: 1.0, K3: 0.0, phi_rad: 0.0, r_m: 0.1, sigma1_m: 0.05,
  sigma2_m: {WIDTH_M}}}
projection: {{model_plane_m: 0.3, emission_offset_m: 0.05}}
"""
measured = pytest.mark.skipif(not available(), reason='measurements kept beside the repository')


@pytest.mark.slow
@measured
def test_with_nothing_hidden_the_film_follows_eq_2(tmp_path):
    """Up to each part's own level and its gauge's zero. Of one Gaussian eq. (1) is exact."""
    line = np.linspace(-semi_real.HALF_M, semi_real.HALF_M, semi_real.GRID)
    u, v = np.meshgrid(line, line)
    table = np.exp(-(u**2 + v**2) / (2 * WIDTH_M**2)) / (2 * np.pi * WIDTH_M**2)
    pattern = semi_real.Pattern(table, FLOW, 0.1, 2.5 * WIDTH_M)
    painted = semi_real.paint(2, 'clean', pattern=pattern)
    folder = painted.write(tmp_path / 'campaign').parent
    (tmp_path / 'model.yaml').write_text(MODEL)
    for part in painted.parts:
        film = pd.simulate(
            pd.read_mesh(folder / f'{part.name}.stl', max_edge_length_m=0.05),
            pd.read_recording(folder / part.name, state_topic='/atomizer/state'),
            pd.read_model(tmp_path / 'model.yaml'),
            readings=pd.read_readings(folder / f'unseen_{part.name}.csv'),
        )
        predicted = film.predicted_um
        columns = np.column_stack([predicted, np.ones_like(predicted)])
        solved, *_ = np.linalg.lstsq(columns, part.unseen_um, rcond=None)
        assert np.abs(columns @ solved - part.unseen_um).max() < 0.005 * predicted.max()


@pytest.mark.slow
@measured
def test_a_seed_gives_one_campaign_of_its_kind():
    campaigns = {kind: semi_real.paint(3, kind) for kind in KINDS}
    for kind, one in campaigns.items():
        assert len(one.hidden) == {'clean': 0, 'pair': 2}.get(kind, 1)
        assert (kind in ('unknown', 'footprint')) == any(':' in name for name in one.hidden)
        assert 1 <= len(one.parts) <= 4
        for part in one.parts:
            assert np.isfinite(part.thickness_um).all()
            assert (part.unseen_sigma_um > 0.0).all()
        if kind in ('effect', 'pair', 'unknown'):
            assert len(one.strengths) == len(one.hidden)
            assert one.strength > 0.0
    again, other = (semi_real.paint(seed, 'clean').parts[0].thickness_um for seed in (3, 4))
    np.testing.assert_array_equal(campaigns['clean'].parts[0].thickness_um, again)
    assert again[:5].tolist() != other[:5].tolist()


@pytest.mark.slow
@measured
def test_every_effect_changes_the_readings():
    """Of one curved part whose gun opens near its edges."""
    rng = np.random.default_rng(5)
    pattern, sheet = semi_real.draw_pattern(rng, 'fan', 0.15), semi_real.draw_sheet(rng, True)
    job = semi_real.draw_job(rng, sheet, pattern, 20.0, 0.3, 0.2, True)
    x, z = (rng.uniform([-0.5, 0.0], [0.5, 1.0], (30, 2)) * [sheet.width_m, sheet.height_m]).T
    plain = semi_real.gauge_um(sheet, job, pattern, {}, x, z)
    for name in [*semi_real.EFFECTS, *(f'unknown:{name}' for name in semi_real.UNKNOWN)]:
        hidden = {name: semi_real.draw_hidden(rng, name)}
        shown = semi_real.gauge_um(sheet, job, pattern, hidden, x, z)
        assert np.abs(shown - plain).max() > 0.1, name


def test_a_mark_that_what_is_free_explains_is_not_detectable():
    rng = np.random.default_rng(0)
    free, sigma = rng.normal(size=(40, 3)), np.full(40, 0.5)
    other = rng.normal(size=40)
    inside, alone = detectability(np.stack([free[:, 0], other], 1), 1e3 * free, sigma)
    assert inside < 0.01
    left = other - free @ np.linalg.lstsq(free, other, rcond=None)[0]
    assert alone == pytest.approx(np.linalg.norm(left) / 0.5, rel=1e-3)


def test_amounts_are_compared_where_they_mean_the_same():
    hidden = {'id': 'gun_wake', 'form': 'even', 'amplitude': 0.02}
    assert droplets.true_amounts(hidden, [4]) == {'gun_wake.lag_s': 0.02}
    step = {'id': 'flow_drift', 'form': 'step', 'amplitude': 0.02}
    assert droplets.true_amounts(step, [4]) == {}
    amount = droplets.true_amounts(step | {'form': ''}, [4])['flow_drift.drift_per_pass']
    assert amount == pytest.approx(0.02, rel=0.02)


@pytest.mark.slow
def test_a_painted_case_knows_how_visible_each_effect_is():
    case = droplets.draw_case(11, 'pair', ('gauge_zero', 'edge_build'))
    quiet = GaugeNoise(floor_um=0.5, relative=0.0, session_offset_um=0.3, texture=0.01, level=0.02)
    case = replace(case, layout=('panel', 'door'), amplitudes=(6.0, 0.6), noise=quiet, readings=80)
    one, other = (droplets.paint(11, 'pair', case=c, parcels=100_000) for c in (
        case, replace(case, amplitudes=(6.0, 1.2))))  # fmt: skip
    assert one.hidden == ('gauge_zero', 'edge_build')
    assert [p.name for p in one.parts] == list(case.layout)
    assert min(one.strengths) > 1.0
    assert other.strengths[0] == pytest.approx(one.strengths[0], rel=0.1)
    assert 1.4 < other.strengths[1] / one.strengths[1] < 2.1

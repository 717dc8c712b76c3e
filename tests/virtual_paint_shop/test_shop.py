"""The shop paints eq. (2) where nothing is hidden, is repeatable, and keeps to itself."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
import yaml

from . import conner
from .doors import Part
from .draw import draw_jobs
from .files import write
from .gauge import scatter
from .jobs import Job, Plan, drive
from .parcels import Pattern
from .respray import sprayed_again
from .shop import PARCELS, Bench, generate
from .truths import DOWN, library

FEW = {'parcels': 300_000, 'readings': 40, 'repeats': 10, 'heldout': 10}


@pytest.mark.slow
def test_a_clean_door_follows_eqs_1_and_2():
    """Bias below 0.05 um and counting noise below 0.3 um, at the default number of parcels."""
    pattern, (job,) = draw_jobs(8, [], ('door',))
    x, z = scatter(job.part, 120, np.random.default_rng(8), 0.015)
    film = Bench(8, job, pattern, PARCELS).film_at([], x, z)
    theory = conner.film_um(pattern, job.motion, job.part.point(x, z), job.part.normal(x, z))
    assert 10.0 < theory.mean() < 40.0
    assert abs(np.mean(film - theory)) < 0.05
    assert np.std(film - theory) / theory.mean() < 0.01
    assert np.std(film - theory) < 0.3


@pytest.mark.slow
@pytest.mark.parametrize(
    ('truth_id', 'drawn', 'shift_m'),
    [
        ('air_drift', {'direction': DOWN}, -0.020),
        ('tcp_offset', {'direction_rad': np.pi / 2}, 0.020),
        ('tcp_tilt', {'axis_rad': 0.0}, -0.25 * 0.020),
        ('part_misalignment', {'direction': DOWN, 'turn_rad': np.zeros(3)}, 0.020),
    ],
)
def test_a_hidden_shift_has_the_amount_that_a_judge_expects(truth_id, drawn, shift_m):
    """Tool y points up here; a tilt turns the axis about the bell, 0.25 m from the panel."""
    part, z = Part('door', 1.0, 1.0), np.linspace(0.02, 0.98, 61)
    plan = Plan(passes=1, standoff_m=0.25, follow=0.0, teach_error_m=0.0, overrun_m=0.3)
    job = Job('door', part, plan, drive(part, plan, np.random.default_rng(0)))
    bell = Pattern(1.5, K2=0.2, K3=0.0, phi_rad=0.0, r_m=0.09, sigma1_m=0.04, sigma2_m=0.06)
    bench = Bench(1, job, bell, 600_000)
    truth = library()[truth_id](0.020, drawn)
    clean, film = (bench.film_at(truths, 0.0 * z, z) for truths in ([], [truth]))
    moved = np.average(z, weights=film) - np.average(z, weights=clean)
    assert moved == pytest.approx(shift_m, abs=0.0006)
    assert film.sum() == pytest.approx(clean.sum(), rel=0.01)


@pytest.mark.slow
def test_every_hidden_effect_changes_the_readings_of_a_door():
    pattern, (job,) = draw_jobs(5, [], ('door',), gun='near_edge')
    x, z = scatter(job.part, 200, np.random.default_rng(1), 0.015)
    usual = Bench(9, job, pattern, 100_000)
    clean = usual.readings([], x, z)[1]
    for name, truth in library().items():
        hidden = truth.draw(np.random.default_rng(2), truth.most if np.isfinite(truth.most) else 1)
        part, bench, before = hidden.on_part(job.part), usual, clean
        if part is not job.part:
            bench = Bench(9, Job(job.name, part, job.plan, job.motion), pattern, 100_000)
            before = bench.readings([], x, z)[1]
        shown = bench.readings([hidden], x, z)[1]
        assert np.abs(shown - before).max() > 0.5, name


@pytest.mark.slow
def test_same_seed_same_campaign_whatever_is_hidden():
    clean, again, other = generate(5, **FEW), generate(5, **FEW), generate(6, **FEW)
    hidden = generate(5, 'overspray_fog', amplitude=1.0, **FEW)
    a, b, c, d = (x.experiments[0] for x in (clean, again, hidden, other))
    assert np.array_equal(a.readings.thickness_um, b.readings.thickness_um)
    assert np.array_equal(a.log.positions_m, c.log.positions_m)
    assert np.array_equal(a.readings.positions_m, c.readings.positions_m)
    assert np.allclose(c.readings.thickness_um - a.readings.thickness_um, 1.0, atol=0.1)
    assert not np.array_equal(d.vertices_m, a.vertices_m)


@pytest.mark.slow
def test_a_campaign_file_hides_the_truth_and_says_what_was_done_otherwise(tmp_path):
    campaign = generate(4, 'edge_build', experiments=('panel', 'door'), **FEW)
    changes = ['draught_off', 'upside_down', 'half_flow']
    both = sprayed_again(campaign, [], 'door', changes, 9, parcels=300_000)
    text = write(both, tmp_path / 'out').read_text()
    assert 'truth' not in text
    assert 'edge' not in text
    entries = yaml.safe_load(text)['experiments']
    for entry in entries:
        for key in ('mesh', 'trajectory', 'measurements'):
            assert (tmp_path / 'out' / entry[key]).exists()
    assert (entries[2]['name'], entries[2]['switched_off']) == ('door_next', ['draught'])
    assert entries[2]['down'] == [0.0, 0.0, 1.0]
    assert json.loads((tmp_path / 'out/truth/truth.json').read_text())['id'] == 'edge_build'


def test_the_shop_shares_no_code_with_what_it_judges():
    for source in Path(__file__).parent.glob('*.py'):
        imports = re.findall(r'^\s*(?:from|import)\s+(\S+)', source.read_text(), re.MULTILINE)
        assert not [name for name in imports if name.startswith('paint_')], source.name

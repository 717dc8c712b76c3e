"""Zones through the real commands, with files."""

import json

import numpy as np
import pytest
import yaml

from booth import SAMPLES
from cli.command import COARSE, assert_refused, paint, ran

ZONES = """zones:
  - {name: foot, target_um: 20, tolerance_um: 2, box: [[-2, -2, -2], [2, 2, 0.0]]}
  - {name: 'head, left', target_um: 9, tolerance_um: 1, box: [[-2, -2, 0.0], [0, 2, 2]]}
"""


@pytest.fixture
def zones(tmp_path):
    path = tmp_path / 'zones.yaml'
    path.write_text(ZONES)
    return path


def test_simulate_counts_each_zone_against_its_band(panel, one_pass, zones, tmp_path):
    whole = (
        'simulate',
        '--mesh',
        panel,
        '--trajectory',
        one_pass,
        *COARSE,
        '-o',
        tmp_path / 'out',
    )
    done = ran(*whole, '--zones', zones)
    figures = json.loads((tmp_path / 'out/stats.json').read_text())
    foot, head = figures['zones']
    assert [foot['name'], head['name']] == ['foot', 'head, left']
    assert (foot['target_um'], head['target_tolerance_um']) == (20.0, 1.0)
    painted = [zone['coverage'] * zone['area_m2'] for zone in figures['zones']]
    within = np.dot(painted, [zone['within_target'] for zone in figures['zones']]) / sum(painted)
    assert figures['within_target'] == pytest.approx(within)
    assert f'head, left, 9 ± 1 µm: {head["mean_um"]:.1f} µm mean' in done.stdout
    table = np.genfromtxt(
        tmp_path / 'out/film.csv', delimiter=',', skip_header=1, usecols=(2, 3), comments='"'
    )
    names = [row.split(',', 4)[4] for row in (tmp_path / 'out/film.csv').read_text().splitlines()]
    assert names[0] == 'zone'
    assert set(names[1:]) == {'foot', '"head, left"', ''}
    low = [name == 'foot' for name in names[1:]]
    np.testing.assert_array_equal(low, table[:, 0] <= 0.0)
    assert table[low, 1].max() == pytest.approx(foot['max_um'])
    zones.write_text(ZONES.replace('0.0]]}', '-1.0]]}'))
    assert_refused(paint(*whole, '--zones', zones), "zone 'foot' holds no vertex of the part")


@pytest.mark.slow
def test_compare_tells_the_readings_of_each_zone(zones, tmp_path):
    """By --zones, which stands for the campaign's own."""
    sample = SAMPLES / 'measured_door'
    campaign = yaml.safe_load((sample / 'unseen.yaml').read_text())
    (door,) = campaign['experiments']
    for key in ('mesh', 'trajectory', 'measurements'):
        door[key] = str(sample / door[key])
    file = tmp_path / 'campaign.yaml'
    (tmp_path / 'other.yaml').write_text(ZONES.replace('0.0', '0.3').replace(' 20,', ' 22,'))
    file.write_text(json.dumps(campaign | {'zones': 'other.yaml', 'model': 'bell.yaml'}))
    (tmp_path / 'bell.yaml').write_text('{}')
    done = ran('compare', file, '-o', tmp_path / 'out')
    written = json.loads((tmp_path / 'out/comparison.json').read_text())
    foot, _ = written['zones']
    lines = (tmp_path / 'out/residuals.csv').read_text().splitlines()
    rows = [dict(zip(lines[0].split(','), line.split(','), strict=True)) for line in lines[1:]]
    own = [row for row in rows if float(row['z_m']) <= 0.3 and row['used'] == '1']
    film = np.array([float(row['thickness_um']) for row in own])
    assert (foot['readings'], foot['target_um']) == (len(own), 22.0)
    assert foot['mean_um'] == pytest.approx(film.mean(), abs=1e-3)
    within = np.mean(np.abs(film - 22.0) <= 2.0)
    assert foot['within'] == pytest.approx(within)
    assert foot['verdict'] == f'{round((1 - within) * len(own))} of {len(own)} out'
    predicted = np.mean([float(row['predicted_um']) for row in own])
    assert foot['mean_predicted_um'] == pytest.approx(predicted, abs=1e-3)
    assert abs(foot['worst_um'] - 22.0) == pytest.approx(np.abs(film - 22.0).max(), abs=1e-3)
    assert 'door: foot, 22 ± 2 µm:' in done.stdout
    page = (tmp_path / 'out/report.html').read_text()
    assert '<h2 id="zones">Zones</h2>' in page
    assert f'worst {foot["worst_um"]:.1f} µm at {foot["worst_point"]}' in page
    zones.write_text(ZONES.replace('0.0]]}', '-1.0]]}'))
    refused = paint('compare', file, '--zones', zones, '-o', tmp_path / 'out')
    assert_refused(refused, "experiment 'door'", "zone 'foot' holds no vertex")

"""`paint demo`, `compare`, `diagnose` and `refit` as a user runs them, on the sample door."""

import html
import os
import re
import shlex
import shutil
import subprocess
from itertools import product
from pathlib import Path

import pytest
import yaml

from booth import SAMPLES
from cli.command import assert_refused, figures_of, paint, ran, rows_of, told_in
from paint_deposition.cli.results import MARKER
from paint_deposition.files.model_file import read_model_file
from paint_deposition.inference.diagnosis.model_space import SURE
from paint_deposition.inference.diagnosis.verdict import percent
from paint_deposition.model.eq1_pattern import PATTERN

MEASURED = SAMPLES / 'measured_door'
HIDDEN = 'incidence_attraction'
DIAGNOSE = 'paint diagnose measured_door/campaign.yaml -o diagnosis'


@pytest.fixture(scope='module')
def demo(tmp_path_factory):
    """`paint demo` piped, on a display whose browser notes the pages that it is to open."""
    folder = tmp_path_factory.mktemp('demo')
    (folder / 'browser').write_text(f'#!/bin/sh\necho "$1" >> "{folder}/opened"\n')
    (folder / 'browser').chmod(0o755)
    display = {'DISPLAY': ':7', 'BROWSER': f'{folder}/browser %s'}
    command = ['paint', 'demo', '-o', folder / 'out']
    done = subprocess.run(command, env=os.environ | display, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout, folder / 'out'


@pytest.fixture(scope='module')
def door_alone(tmp_path_factory):
    """The door without its panel, and a model to start from, as a campaign: less to compute."""
    folder = tmp_path_factory.mktemp('door')
    shutil.copytree(MEASURED, folder, dirs_exist_ok=True)
    content = yaml.safe_load((folder / 'campaign.yaml').read_text())
    content = {'experiments': content['experiments'][1:], 'model': 'start.yaml'}
    (folder / 'campaign.yaml').write_text(yaml.safe_dump(content))
    (folder / 'start.yaml').write_text(
        'name: bell 7\nplanar: {K1_cm3_per_s: 1.0}\n'
        'uncertainty: {planar: {r_m: 9.0}, projection: {model_plane_m: 0.002}}\n'
        'history: [{added: pattern, rmse_um: 9}, {added: a wish, rmse_um: 8}]\n'
    )
    return folder / 'campaign.yaml'


@pytest.mark.slow
def test_the_demo_finds_the_hidden_effect(demo):
    printed, folder = demo
    found = told_in(folder / 'diagnosis/diagnosis.json')
    probability = found['classes'][0]['probability']
    assert probability > SURE
    assert f'  added {HIDDEN}: {percent(probability)}\n' in printed
    assert found['verdict'] == 'effect_missing'
    assert found['accepted'] == [HIDDEN]
    assert found['rmse_um']['holdout_after'] < found['rmse_um']['holdout_before']
    before = read_model_file(folder / 'diagnosis/model_before.yaml')
    after = read_model_file(folder / 'diagnosis/model.yaml')
    assert before.model.effects == ()
    assert [effect.id for effect in after.model.effects] == found['accepted']
    assert [step['added'] for step in after.history] == ['pattern', *found['accepted']]


@pytest.mark.slow
def test_the_page_of_the_demo_has_the_figures_of_the_files(demo):
    """The later models and films are the better ones."""
    _, folder = demo
    page = html.unescape((folder / 'demo.html').read_text().replace('&rarr;', '->'))
    shown = re.findall(
        r'class="label">([^<]*)</span>\s*(?:<span class="was">([^<]*) -> </span>)?'
        r'<span class="value">([^<]*)</span>', page
    )  # fmt: skip
    shown = {label: (before, after) for label, before, after in shown}
    film = told_in(folder / 'film/stats.json')
    assert shown['Film'] == ('', f'{film["mean_um"]:.1f}')
    errors = told_in(folder / 'diagnosis/diagnosis.json')['rmse_um']
    unseen = [m['rmse_um'] for m in told_in(folder / 'unseen/comparison.json')['models']]
    assert unseen[1] < 0.85 * unseen[0]
    better = told_in(folder / 'improved/improvement.json')
    assert better['sigma_n']['after'] < 0.5 * better['sigma_n']['before']
    for label, before, after in (
        ('Error at fitted points', f'{errors["before"]:.2f}', f'{errors["after"]:.2f}'),
        ('RMSE, 60 unseen readings', *(f'{one:.2f}' for one in unseen)),
        ('Standard deviation', *(f'{100 * better["sigma_n"][k]:.1f}' for k in better['sigma_n'])),
    ):
        assert shown[label] == (before, after)


@pytest.mark.slow
def test_the_page_of_the_demo_needs_nothing_else_and_opens_once(demo):
    printed, folder = demo
    page = (folder / 'demo.html').read_text()
    assert not re.findall(r'(?:src|href)="(?!data:)|<script|http-equiv="refresh"|url\(', page)
    assert len(re.findall(r'<img src="data:image/png;base64,', page)) == 5
    assert (folder.parent / 'opened').read_text() == f'{(folder / "demo.html").as_uri()}\n'
    steps = ('paint simulate ', 'paint diagnose ', 'paint compare ', 'paint improve ')
    places = [printed.index(f'$ {step}') for step in steps]
    assert places == sorted(places)


@pytest.mark.slow
def test_the_guide_comes_to_a_painted_door(repository, tmp_path, demo, undrawn):
    """Commands of docs/first_cell.md but those of nodes print its figures on a copy of samples."""
    page = (repository / 'docs/first_cell.md').read_text(encoding='utf-8')
    folder = shutil.copytree(SAMPLES, tmp_path / 'first_cell')
    shutil.copytree(demo[1] / 'diagnosis', folder / 'diagnosis')
    everything = told_in(folder / 'diagnosis/diagnosis.json')['reason']
    blocks = re.findall(r'```bash\n(.*?)```', page, re.DOTALL)
    for line in ''.join(block for block in blocks if ' &\n' not in block).splitlines():
        if line.startswith('paint ') and line != DIAGNOSE:
            done = ran(*shlex.split(line)[1:], cwd=folder)
            everything += done.stdout
    assert f'\n{DIAGNOSE}\n' in page
    for printed, written in {
        'film 17.0 µm mean': '17.0 µm on average',
        '8.0 to 23.4 µm': '8.0 to 23.4 µm',
        'The readings show incidence_attraction': 'the readings show incidence_attraction',
        '7 horizontal passes at 188 mm, 0.638 m/s': 'seven passes, 188 mm apart at 0.638 m/s',
        'sigma_n 4.2 → 2.8 %': 'by 4.2 % (σ_N)',
        '99.9 % of it within 20 ± 2 µm': '99.9 % of the door is within 2 µm of its 20 µm',
    }.items():
        assert printed in everything
        assert written in ' '.join(page.split())


@pytest.mark.slow
def test_a_diagnosis_writes_all_that_it_says(demo):
    folder = demo[1] / 'diagnosis'
    names = {path.name for path in folder.iterdir()}
    assert names == {
        MARKER, 'diagnosis.json', 'model.yaml', 'model_before.yaml', 'residuals.csv',
        'report.html', 'comparison.png',
    }  # fmt: skip
    rows = rows_of(folder / 'residuals.csv')
    readings = [row for part in ('panel', 'door') for row in rows_of(MEASURED / f'{part}.csv')]
    measured = [f'{float(reading["thickness_um"]):.3f}' for reading in readings]
    assert [row['thickness_um'] for row in rows] == measured
    residual = [float(row['thickness_um']) - float(row['predicted_um']) for row in rows]
    assert [float(row['residual_um']) for row in rows] == pytest.approx(residual, abs=2e-3)


@pytest.mark.slow
def test_compare_says_where_the_model_is_off(door_alone, tmp_path):
    done = ran('compare', door_alone, '-o', tmp_path)
    content = told_in(tmp_path / 'comparison.json')
    assert set(content) == {
        'geometry', 'readings', 'noise', 'left_out', 'misfits', 'regions', 'dependences',
        'notes', 'zones', 'provenance',
    }  # fmt: skip
    assert content['noise']['source'] == 'repeats'
    door = content['misfits'][0]
    assert (door['experiment'], door['kind'], door['readings']) == ('door', 'experiment', 72)
    # The start model sprays half of what the bell did, and is taken as it is.
    assert door['bias_um'] > 5.0
    squares = door['bias_um'] ** 2 + door['std_um'] ** 2 * 71 / 72
    assert door['rmse_um'] ** 2 == pytest.approx(squares)
    kinds = [misfit['kind'] for misfit in content['misfits']]
    assert {'group', 'pass'} <= set(kinds)
    assert f'door: 72 readings, bias +{door["bias_um"]:.2f} µm' in done.stdout
    assert 'misfit: door: ' in done.stdout
    p_values = [dependence['p_value'] for dependence in content['dependences']]
    assert p_values == sorted(p_values)


@pytest.mark.slow
def test_a_slip_among_repeats_is_left_out_and_named(door_alone, tmp_path):
    """In every file and in print; the readings' own file says how it was."""
    header, *rows = (door_alone.parent / 'door.csv').read_text().splitlines()
    readings = rows_of(door_alone.parent / 'door.csv')
    labels = [reading['point'] for reading in readings]
    slip = next(k for k, label in enumerate(labels) if labels.count(label) == 3)
    text = readings[slip]['thickness_um']
    rows[slip] = rows[slip].replace(f',{text}', f',{float(text) - 11.0:.2f}')
    (door_alone.parent / 'slip.csv').write_text('\n'.join([header, *rows]) + '\n')
    (door,) = yaml.safe_load(door_alone.read_text())['experiments']
    campaign = door_alone.with_name('slip.yaml')
    campaign.write_text(yaml.safe_dump({'experiments': [door | {'measurements': 'slip.csv'}]}))
    for name, *command in (('comparison', 'compare'), ('diagnosis', 'refit', '--add', 'none')):
        output = tmp_path / name
        done = ran(*command, campaign, '-o', output)
        lines = (done.stdout + done.stderr).splitlines()
        (told,) = (line for line in lines if 'left out of the fit' in line)
        note = told.partition(': ')[2]
        assert note.startswith(f"door: point '{labels[slip]}': {float(text) - 11.0:.4g} µm beside")
        assert told_in(output / f'{name}.json')['notes'][-1] == note
        assert f'point &#39;{labels[slip]}&#39;: ' in (output / 'report.html').read_text()
        residuals = rows_of(output / 'residuals.csv')
        assert [row['point'] for row in residuals] == labels
        assert [row['used'] == '1' for row in residuals] == [k != slip for k in range(len(rows))]
        assert residuals[slip]['predicted_um'] == ''


@pytest.mark.slow
def test_the_strongest_misfits_are_printed_and_how_many_more_there_are(door_alone, tmp_path):
    (door,) = yaml.safe_load(door_alone.read_text())['experiments']
    six = [door | {'name': f'door {k}'} for k in range(6)]
    campaign = door_alone.with_name('six.yaml')
    campaign.write_text(yaml.safe_dump({'experiments': six}))
    done = ran('refit', campaign, '--add', 'none', '-o', tmp_path / 'refit')
    regions = told_in(tmp_path / 'refit' / 'diagnosis.json')['regions']
    lines = (done.stdout + done.stderr).splitlines()
    shown = [line for line in lines if line.startswith('misfit: ')]
    strongest = [f'misfit: {one["experiment"]}: {one["description"]}' for one in regions[:5]]
    assert shown == strongest
    assert len(regions) > 5
    assert f'{len(regions) - 5} weaker misfits are in diagnosis.json' in lines


@pytest.mark.slow
def test_refit_adds_an_effect_by_its_id_and_carries_the_history_on(door_alone, tmp_path):
    content = figures_of('refit', door_alone, '--add', HIDDEN, '-o', tmp_path, '--json')
    assert content['accepted'] == [HIDDEN]
    assert content['classes'][0]['parameters']['attraction']['value'] > 0.5
    model = read_model_file(tmp_path / 'model.yaml')
    assert model.name == 'bell 7'
    assert model.uncertainty['projection'] == {'model_plane_m': 0.002}
    assert model.uncertainty['planar']['r_m'] < 0.1
    assert 0.0 < model.uncertainty[HIDDEN]['attraction'] < 1.0
    assert [step['added'] for step in model.history] == ['pattern', 'a wish', HIDDEN]
    assert model.history[0] == {'added': 'pattern', 'rmse_um': 9}
    errors = content['rmse_um']
    for step, when in zip(model.history[1:], ('before', 'after'), strict=True):
        assert step['rmse_um'] == pytest.approx(errors[when], abs=1e-4)
        assert step['holdout_rmse_um'] == pytest.approx(errors[f'holdout_{when}'], abs=1e-4)
        assert step['noise_floor_um'] == pytest.approx(errors['noise_floor'], abs=1e-4)
        assert step['campaign'] == str(door_alone)
    before = read_model_file(tmp_path / 'model_before.yaml')
    assert (before.name, before.history) == (model.name, model.history[:2])
    report = (tmp_path / 'report.html').read_text()
    assert '<td>+ a wish</td>' in report
    assert str(door_alone) in report


@pytest.mark.slow
def test_refit_adds_an_effect_of_ones_own(door_alone, tmp_path):
    own = shutil.copy(SAMPLES / 'my_effect.py', tmp_path)
    done = ran('refit', door_alone, '--add', own, '-o', tmp_path / 'out')
    assert 'added as asked: wake_loss' in done.stdout
    entry = yaml.safe_load((tmp_path / 'out/model.yaml').read_text())['effects'][0]
    assert entry['file'].endswith('my_effect.py')
    (effect,) = read_model_file(tmp_path / 'out/model.yaml').model.effects
    assert effect.id == 'wake_loss'


@pytest.mark.slow
def test_refit_writes_a_learned_law_as_an_effect_that_predicts_as_well(door_alone, tmp_path):
    """It is put into the model in place of the law, and compared."""
    file, output = tmp_path / 'my_incidence.py', tmp_path / 'out'
    learn = ('--add', 'learned:incidence_deg', '--as-effect', file, '-o', output)
    done = ran('refit', door_alone, *learn)
    content = told_in(output / 'diagnosis.json')
    best, *_ = content['classes'][0]['forms']
    assert best['formula'] in done.stdout
    model = yaml.safe_load((output / 'model.yaml').read_text())
    values = {name: found['value'] for name, found in best['parameters'].items()}
    own = {key: model[key] for key in ('planar', 'projection')}
    own['effects'] = [{'file': str(file), **values}]
    (tmp_path / 'own.yaml').write_text(yaml.safe_dump(own))
    both = ('--model', output / 'model.yaml', '--model', tmp_path / 'own.yaml')
    ran('compare', door_alone, *both, '-o', tmp_path / 'both')
    learned, own = (
        [float(r['residual_um']) for r in rows_of(tmp_path / f'both/residuals_{name}.csv')]
        for name in ('model', 'own')
    )
    assert sum(r**2 for r in own) < 1.3 * sum(r**2 for r in learned)
    again = paint('refit', door_alone, *learn)
    assert_refused(again, 'my_incidence.py is there already', 'give another name')


@pytest.mark.slow
def test_models_side_by_side_each_given_once(tmp_path, repository):
    start, other = repository / 'config/model.yaml', tmp_path / 'other.yaml'
    other.write_text(start.read_text().replace('K1_cm3_per_s: 1.9', 'K1_cm3_per_s: 2.4'))
    told = figures_of(
        'compare', SAMPLES / 'measured_door/unseen.yaml', '--model', start, '--model', other,
        '--json', '-o', tmp_path / 'out',
    )  # fmt: skip
    errors = {one['name']: one['rmse_um'] for one in told['models']}
    assert list(errors) == ['model', 'other']
    assert told['best'] == min(errors, key=errors.get)
    assert told['provenance']['models']['other']['planar']['K1_cm3_per_s'] == 2.4
    page = (tmp_path / 'out/report.html').read_text(encoding='utf-8')
    assert f'{told["best"]} has the smallest error' in page
    assert (tmp_path / 'out/residuals_other.csv').is_file()


@pytest.fixture(scope='module')
def jobs(tmp_path_factory) -> Path:
    """The sample's panel and door as campaigns of their own; the panel calibrated."""
    folder = tmp_path_factory.mktemp('jobs')
    shutil.copytree(SAMPLES / 'measured_door', folder, dirs_exist_ok=True)
    both = yaml.safe_load((folder / 'campaign.yaml').read_text())['experiments']
    for one in both:
        text = yaml.safe_dump({'experiments': [one]})
        (folder / f'{one["name"]}.yaml').write_text(text)
    ran('calibrate', folder / 'panel.yaml', '-o', folder / 'calibration')
    return folder


def refitted(jobs: Path, campaign: str, output: Path):
    """What a refit with nothing added prints, warnings included, and its figures."""
    given = ('--add', 'none', '--model', jobs / 'calibration/model.yaml')
    done = ran('refit', jobs / campaign, *given, '-o', output)
    return done.stdout + done.stderr, told_in(output / 'diagnosis.json')


@pytest.mark.slow
def test_the_calibration_is_the_prior_of_the_next_job(jobs: Path, tmp_path: Path):
    known = read_model_file(jobs / 'calibration/model.yaml').posterior
    assert known is not None
    assert known.names == tuple(coordinate.name for coordinate in PATTERN)
    # The sample's bell has the pattern of eq. (1).
    size, factor = known.footprint
    assert size < 0.06
    assert factor > 1.0
    text, figures = refitted(jobs, 'door.yaml', tmp_path)
    shift = figures['pattern_shift']
    assert set(shift) == {'standard_deviations', 'usual', 'by_coordinate'}
    assert 0.0 < shift['standard_deviations'] < shift['usual']
    assert f'pattern moved {shift["standard_deviations"]:.1f} standard deviations' in text
    assert 'The pattern moved' in (tmp_path / 'report.html').read_text()
    later = read_model_file(tmp_path / 'model.yaml').posterior
    assert set(known.readings) < set(later.readings)


@pytest.mark.slow
def test_the_readings_behind_a_calibration_do_not_count_twice(jobs: Path, tmp_path: Path):
    text, figures = refitted(jobs, 'campaign.yaml', tmp_path)
    assert figures['pattern_shift'] is None
    (note,) = (note for note in figures['notes'] if 'is not used' in note)
    assert 'rests on the readings of panel themselves' in note
    assert f'warning: {note}\n' in text
    assert note in (tmp_path / 'report.html').read_text()
    kinds = sorted((found['kind'], found['of']) for found in figures['random_effects'])
    assert kinds == [*product(('gauge zero', 'part level'), ('door', 'panel'))]

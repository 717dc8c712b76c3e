"""The guide docs/first_cell.md, command by command, and the diagnosis that it makes."""

import csv
import json
import re
import shlex
import shutil

import pytest

from booth import SAMPLES
from cli.command import paint
from conftest import REPOSITORY, blank_pictures
from paint_deposition.cli.results_folder import MARKER
from paint_deposition.files.model_file import read_model_file
from paint_deposition.inference.diagnosis.model_space import SURE
from paint_deposition.inference.diagnosis.verdict import percent

PAGE = (REPOSITORY / 'docs/first_cell.md').read_text(encoding='utf-8')
HIDDEN = 'incidence_attraction'


@pytest.fixture(scope='module')
def cell(tmp_path_factory):
    """A copy of the samples, and what each command of the guide said; those of nodes left out."""
    folder = tmp_path_factory.mktemp('guide') / 'first_cell'
    shutil.copytree(SAMPLES, folder)
    blocks = re.findall(r'```bash\n(.*?)```', PAGE, re.DOTALL)
    said = {}
    with blank_pictures():
        for line in '\n'.join(block for block in blocks if ' &\n' not in block).splitlines():
            if line.startswith('paint '):
                words = shlex.split(line)[1:]
                said[words[-1]] = paint(*words, cwd=folder)
    return folder, said


@pytest.fixture(scope='module')
def diagnosed(cell):
    folder, said = cell
    return said['diagnosis'], folder / 'diagnosis'


@pytest.mark.slow
def test_the_guide_comes_to_a_painted_door(cell):
    _, said = cell
    assert all(done.returncode == 0 for done in said.values()), said
    everything = ''.join(done.stdout for done in said.values())
    for printed, written in {
        'film 17.0 µm mean': '17.0 µm on average',
        '8.0 to 23.4 µm': '8.0 to 23.4 µm',
        f'The readings show {HIDDEN}': f'the readings show {HIDDEN}',
        '7 horizontal passes at 188 mm, 0.637 m/s': 'seven passes, 188 mm apart at 0.637 m/s',
        'sigma_n 4.2 to 2.7 %': 'by 4.2 % (σ_N)',
        '99.8 % of it within 20 ± 2 µm': '99.8 % of the door is within 2 µm of its 20 µm',
    }.items():
        assert printed in everything
        assert written in ' '.join(PAGE.split())


def table(path) -> list[dict[str, str]]:
    with path.open(newline='') as file:
        return list(csv.DictReader(file))


@pytest.mark.slow
def test_diagnose_names_the_hidden_effect(diagnosed):
    done, folder = diagnosed
    assert done.returncode == 0, done.stderr
    model, verdict, *_ = done.stdout.splitlines()
    assert model == 'model: fitted to the campaign, from a 50 mm bell'
    assert verdict.startswith(f'effect missing: The readings show {HIDDEN}.')
    assert 'diagnosis/report.html' in done.stdout
    content = json.loads((folder / 'diagnosis.json').read_text())
    probability = content['classes'][0]['probability']
    assert probability > SURE
    assert f'added {HIDDEN}: {percent(probability)}\n' in done.stdout
    assert content['verdict'] == 'effect_missing'
    assert content['accepted'] == [HIDDEN]
    assert content['rmse_um']['holdout_after'] < content['rmse_um']['holdout_before']
    # A model with it is expected beside one without: both can be simulated.
    before, after = (
        read_model_file(folder / f'{name}.yaml') for name in ('model_before', 'model')
    )
    assert before.model.effects == ()
    assert [effect.id for effect in after.model.effects] == [HIDDEN]
    assert [step['added'] for step in after.history] == ['pattern', HIDDEN]
    for name in ('panel', 'door'):
        assert f'{name}: {content["geometry"][name]["sentence"]}' in done.stdout


@pytest.mark.slow
def test_diagnose_writes_all_that_it_says(diagnosed):
    _, folder = diagnosed
    names = {path.name for path in folder.iterdir()}
    assert names == {
        MARKER, 'diagnosis.json', 'model.yaml', 'model_before.yaml', 'residuals.csv',
        'report.html', 'comparison.png',
    }  # fmt: skip
    rows = table(folder / 'residuals.csv')
    readings = table(SAMPLES / 'measured_door/panel.csv') + table(
        SAMPLES / 'measured_door/door.csv'
    )
    measured = [f'{float(reading["thickness_um"]):.3f}' for reading in readings]
    assert [row['thickness_um'] for row in rows] == measured
    residual = [float(row['thickness_um']) - float(row['predicted_um']) for row in rows]
    assert [float(row['residual_um']) for row in rows] == pytest.approx(residual, abs=2e-3)


@pytest.mark.slow
def test_a_diagnosed_model_predicts_readings_never_seen(diagnosed, tmp_path):
    _, folder = diagnosed
    errors = {}
    for name in ('model_before', 'model'):
        done = paint('compare', SAMPLES / 'measured_door/unseen.yaml', '--model',
                     folder / f'{name}.yaml', '-o', tmp_path / name, '--json')  # fmt: skip
        assert done.returncode == 0, done.stderr
        content = json.loads(done.stdout)
        assert content == json.loads((tmp_path / name / 'comparison.json').read_text())
        errors[name] = next(m for m in content['misfits'] if m['kind'] == 'experiment')['rmse_um']
    assert errors['model'] < 0.85 * errors['model_before']

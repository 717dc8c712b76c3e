"""Code of effect files runs only where the user named them, or allowed it."""

import shutil

import pytest
import yaml

from booth import SAMPLES
from cli.command import COARSE, assert_refused, paint
from cli.command import ran as succeeded

PANEL = SAMPLES / 'panel.stl'
RAPID = """! planned with a model, sha256 {0}
MODULE P
  CONST robtarget p1:=[[-300,-250,0],[0.7071068,-0.7071068,0,0],[0,0,0,0],[9E9,0,0,0,0,0]];
  PROC main()
    PaintL p1,v500,fine,tBell;
    PaintL Offs(p1,600,0,0),v500,fine,tBell;
  ENDPROC
ENDMODULE
"""


@pytest.fixture
def ran(tmp_path):
    """A file that appears when the code beside `model.yaml` runs."""
    ran = tmp_path / 'ran'
    (tmp_path / 'mine.py').write_text(f'open({str(ran)!r}, "w")\nimport sys\nsys.exit(0)\n')
    (tmp_path / 'model.yaml').write_text('effects: [{file: mine.py}]\n')
    return ran


def module(folder):
    (folder / 'passes.mod').write_text(RAPID.format(64 * '0'))
    return ('simulate', '--mesh', PANEL, '--trajectory', folder / 'passes.mod')


def recording(folder):
    shutil.copytree(SAMPLES / 'panel_577', folder / 'run')
    metadata = yaml.safe_load((folder / 'run/metadata.yaml').read_text())
    told = {'mesh_file': str(PANEL), 'model_file': str(folder / 'model.yaml')}
    metadata['rosbag2_bagfile_information']['custom_data'] = told
    (folder / 'run/metadata.yaml').write_text(yaml.safe_dump(metadata))
    return ('watch', folder / 'run')


def campaign(folder):
    entry = {
        'name': 'panel', 'mesh': str(PANEL), 'trajectory': str(SAMPLES / 'panel_577'),
        'state_topic': '/atomizer/state',
        'measurements': str(SAMPLES / 'panel_study/panel_577.csv'),
    }  # fmt: skip
    text = yaml.safe_dump({'experiments': [entry], 'model': 'model.yaml'})
    (folder / 'campaign.yaml').write_text(text)
    return ('compare', folder / 'campaign.yaml')


def sweep(folder):
    job = {'mesh': str(PANEL), 'trajectory': str(SAMPLES / 'panel_577'), 'model': 'model.yaml'}
    text = yaml.safe_dump({**job, 'grid': {'K2': [0.1, 0.2]}})
    (folder / 'sweep.yaml').write_text(text)
    return ('sweep', folder / 'sweep.yaml')


@pytest.mark.parametrize('data', [module, recording, campaign, sweep])
def test_code_that_only_data_name_runs_when_it_is_allowed(tmp_path, ran, data):
    words = data(tmp_path)
    more = () if words[0] == 'watch' else ('-o', tmp_path / 'out')
    refusal = f'{tmp_path}/mine.py is not run, because it is Python code', '--allow-effects'
    assert_refused(paint(*words, *more), *refusal)
    assert not ran.exists()
    done = paint(*words, *more, '--allow-effects')
    assert ran.exists()
    assert done.returncode == 2
    note, refusal = done.stderr.splitlines()
    assert note == f'note: running the code of effect file {tmp_path}/mine.py'
    assert refusal.startswith('paint: ')
    assert 'mine.py, line 3: SystemExit: 0; correct the file' in refusal
    # The leave is that of one command.
    ran.unlink()
    assert_refused(paint(*words, *more), 'is not run')
    assert not ran.exists()


def test_a_model_that_is_named_is_leave_for_its_effects(tmp_path, ran):
    done = paint(*module(tmp_path), *COARSE, '--model', tmp_path / 'model.yaml', '-o', tmp_path)
    assert 'SystemExit' in done.stderr
    assert ran.exists()
    # Another model that is named is taken without a look at that of the plan.
    (tmp_path / 'mine.py').write_text('1 / 0')
    (tmp_path / 'bell.yaml').write_text('effects: []\n')
    succeeded(*module(tmp_path), *COARSE, '--model', tmp_path / 'bell.yaml', '-o', tmp_path / 'o')

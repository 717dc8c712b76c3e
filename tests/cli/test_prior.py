"""What a calibration tells, used by the commands that follow it."""

import shutil
from itertools import product
from pathlib import Path

import pytest
import yaml

from booth import SAMPLES
from cli.command import ran, told_in
from paint_deposition.files.model_file import read_model_file
from paint_deposition.model.eq1_pattern import PATTERN

pytestmark = pytest.mark.slow


@pytest.fixture(scope='module')
def folder(tmp_path_factory) -> Path:
    """The sample's panel and door as campaigns of their own; the panel calibrated."""
    folder = tmp_path_factory.mktemp('jobs')
    shutil.copytree(SAMPLES / 'measured_door', folder, dirs_exist_ok=True)
    both = yaml.safe_load((folder / 'campaign.yaml').read_text())['experiments']
    for one in both:
        text = yaml.safe_dump({'experiments': [one]})
        (folder / f'{one["name"]}.yaml').write_text(text)
    ran('calibrate', folder / 'panel.yaml', '-o', folder / 'calibration')
    return folder


def refitted(folder: Path, campaign: str, output: Path):
    """What a refit with nothing added prints, warnings included, and its figures."""
    given = ('--add', 'none', '--model', folder / 'calibration/model.yaml')
    done = ran('refit', folder / campaign, *given, '-o', output)
    return done.stdout + done.stderr, told_in(output / 'diagnosis.json')


def test_the_calibration_is_the_prior_of_the_next_job(folder: Path, tmp_path: Path):
    known = read_model_file(folder / 'calibration/model.yaml').posterior
    assert known is not None
    assert known.names == tuple(coordinate.name for coordinate in PATTERN)
    # The sample's bell has the pattern of eq. (1).
    size, factor = known.footprint
    assert size < 0.06
    assert factor > 1.0
    text, figures = refitted(folder, 'door.yaml', tmp_path)
    shift = figures['pattern_shift']
    assert set(shift) == {'standard_deviations', 'usual', 'by_coordinate'}
    assert 0.0 < shift['standard_deviations'] < shift['usual']
    assert f'pattern moved {shift["standard_deviations"]:.1f} standard deviations' in text
    assert 'The pattern moved' in (tmp_path / 'report.html').read_text()
    later = read_model_file(tmp_path / 'model.yaml').posterior
    assert set(known.readings) < set(later.readings)


def test_the_readings_behind_a_calibration_do_not_count_twice(folder: Path, tmp_path: Path):
    text, figures = refitted(folder, 'campaign.yaml', tmp_path)
    assert figures['pattern_shift'] is None
    (note,) = (note for note in figures['notes'] if 'is not used' in note)
    assert 'rests on the readings of panel themselves' in note
    assert f'warning: {note}\n' in text
    assert note in (tmp_path / 'report.html').read_text()
    kinds = sorted((found['kind'], found['of']) for found in figures['random_effects'])
    assert kinds == [*product(('gauge zero', 'part level'), ('door', 'panel'))]

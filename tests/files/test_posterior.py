"""The posterior in a model file: what is written reads back, what is wrong is said in one line."""

from pathlib import Path

import numpy as np
import pytest
import yaml

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.effects.library.corner_slowdown import CornerSlowdown
from paint_deposition.errors import ModelError
from paint_deposition.files.model_file import read_model, read_model_file, write_model
from paint_deposition.inference.posterior import Posterior
from paint_deposition.model.eq1_pattern import PATTERN

MODEL = DepositionModel(effects=(CornerSlowdown(gain=0.5, length_m=0.2),))
NAMES = [*(c.name for c in PATTERN), 'corner_slowdown.gain', 'corner_slowdown.log_length_m']


def covariance() -> np.ndarray:
    root = np.random.default_rng(0).normal(size=(len(NAMES), len(NAMES)))
    return 1e-4 * root @ root.T


@pytest.fixture
def posterior() -> Posterior:
    return Posterior(
        mean={name: 0.1 * k for k, name in enumerate(NAMES)},
        covariance=dict(zip(NAMES, covariance().tolist(), strict=True)),
        readings=('0123456789ab',),
        process={'voltage_kv': 60.0},
    )


@pytest.fixture
def path(tmp_path: Path, posterior: Posterior) -> Path:
    write_model(tmp_path / 'model.yaml', MODEL, posterior=posterior)
    return tmp_path / 'model.yaml'


def test_a_posterior_reads_back(path: Path, posterior: Posterior):
    again = read_model_file(path).posterior
    assert again == posterior
    assert again.names == tuple(NAMES)
    assert again.centre == pytest.approx(0.1 * np.arange(len(NAMES)))
    assert again.matrix == pytest.approx(covariance())


def test_a_file_without_one_has_none(tmp_path: Path):
    write_model(tmp_path / 'model.yaml', MODEL)
    assert read_model_file(tmp_path / 'model.yaml').posterior is None


def spoilt(path: Path, change) -> str:
    """What is said of the file when its posterior has been changed so."""
    content = yaml.safe_load(path.read_text())
    change(content['posterior'])
    path.write_text(yaml.safe_dump(content, sort_keys=False))
    with pytest.raises(ModelError) as refused:
        read_model(path)
    message = str(refused.value)
    assert message.startswith(f'{path}: posterior')
    assert '\n' not in message
    return message


def fewer(section):
    del section['mean']['K2'], section['covariance']['K2']


@pytest.mark.parametrize(
    ('change', 'words'),
    [
        (lambda s: s['covariance']['K2'].__setitem__(0, 1.0), 'covariance is not symmetric: '),
        (lambda s: s['covariance']['log_K1'].__setitem__(0, -1.0), 'is not positive definite'),
        (lambda s: s['covariance']['r_m'].pop(), 'covariance.r_m has 8 numbers; expected 9'),
        (fewer, 'mean has no K2'),
        (lambda s: s['mean'].update(K2='much'), "mean.K2 is 'much'; expected a number"),
        (lambda s: s['mean'].update(K2=True), 'mean.K2 is True; expected a number'),
        (lambda s: s.pop('covariance'), "has no 'covariance'"),
        (lambda s: s.update(covarianc={}), "unknown key 'covarianc'; did you mean 'covariance'"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(path: Path, change, words: str):
    assert words in spoilt(path, change)

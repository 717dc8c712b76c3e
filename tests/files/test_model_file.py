"""Model files and written files: read back exactly, whole or not at all."""

import os
import stat
from pathlib import Path

import numpy as np
import pytest
import yaml

import refusals
from booth import SAMPLES
from paint_deposition.effects.catalogue import EFFECTS, LEARNED
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.effects.learned_laws import (
    LearnedFootprint,
    LearnedLaw,
    LearnedMap,
    PartGrid,
)
from paint_deposition.errors import ModelError
from paint_deposition.files.atomic import write_text
from paint_deposition.files.effect_file import load_effect_file
from paint_deposition.files.model_file import read_model, read_model_file, write_model
from paint_deposition.inference.fitting.parameters import Posterior
from paint_deposition.model.eq1_pattern import PATTERN, PlanarPattern


def refusal(path: Path) -> str:
    message = refusals.refusal(ModelError, read_model, path)
    assert message.startswith(str(path))
    return message


@pytest.mark.parametrize('effect', EFFECTS.values(), ids=lambda effect: effect.id)
def test_every_effect_reads_back(effect, tmp_path: Path):
    model = DepositionModel(effects=(effect.typical(),))
    write_model(tmp_path / 'model.yaml', model)
    assert read_model(tmp_path / 'model.yaml') == model


def test_shadows_of_the_projection_are_the_effect(file):
    for word, effects in (('true', (EFFECTS['occlusion'](strength=1.0),)), ('false', ())):
        path = file('model.yaml', f'projection: {{occlusion: {word}}}')
        assert read_model(path) == DepositionModel(effects=effects)
        write_model(path, read_model(path))
        assert read_model(path) == DepositionModel(effects=effects)


def test_the_text_is_plain_yaml_with_a_comment_on_every_number(tmp_path: Path):
    path = tmp_path / 'model.yaml'
    model = DepositionModel(effects=(EFFECTS['edge_build'].typical(),))
    write_model(path, model, header_comment='Door 7.\nFitted on Monday.')
    lines = path.read_text().splitlines()
    assert lines[:2] == ['# Door 7.', '# Fitted on Monday.']
    assert all('#' in line for line in lines if ': ' in line)
    content = yaml.safe_load(path.read_text())
    assert content['planar'] == DepositionModel().planar.model_dump()
    assert content['effects'] == [{'id': 'edge_build', 'gain': 0.25, 'length_m': 0.025}]


def test_name_uncertainty_and_history_read_back(tmp_path: Path):
    path = tmp_path / 'model.yaml'
    uncertainty = {'planar': {'K2': np.float64(0.01)}, 'effects': {'sag': {'run_m': 1e-7}}}
    history = [{'added': 'sag', 'p_value': np.float32(0.5), 'rmse_um': np.array([2.0, 0.75])}]
    write_model(path, DepositionModel(), history=history, uncertainty=uncertainty, name='yes: no')
    file = read_model_file(path)
    assert file.name == 'yes: no'
    assert file.uncertainty == {'planar': {'K2': 0.01}, 'effects': {'sag': {'run_m': 1e-7}}}
    assert file.history == [{'added': 'sag', 'p_value': 0.5, 'rmse_um': [2.0, 0.75]}]
    assert file.posterior is None


def test_a_users_effect_is_found_beside_the_model_file(tmp_path: Path):
    (tmp_path / 'effects').mkdir()
    (tmp_path / 'effects' / 'my_effect.py').write_text((SAMPLES / 'my_effect.py').read_text())
    own = load_effect_file(tmp_path / 'effects' / 'my_effect.py')
    model = DepositionModel(effects=(own.typical(), EFFECTS['sag'].typical()))
    path = tmp_path / 'models' / 'model.yaml'
    write_model(path, model)
    assert yaml.safe_load(path.read_text())['effects'][0]['file'] == '../effects/my_effect.py'
    assert read_model(path) == model


def learned(law: type[LearnedLaw]) -> LearnedLaw:
    """One whose numbers are none that a short decimal says."""
    third, kind = 1.0 / 3.0, law.kinds[-1]
    if law is LearnedMap:
        ends = {'low_m': (-third, 0.0), 'high_m': (0.1, third)}
        grid = PartGrid(part_m=(1.0, third, 2.0), **ends, columns=3, rows=2)
        return law(maps=(grid, grid), kind=kind, learned=(0.1, -third, 1e-7) * 4)
    if law is LearnedFootprint:
        return law(reach_m=third, learned=(0.1, -third, 1e-7, 0.0, 2.0) * 3)
    return law(low=0.1, high=0.2 + 1e-9, kind=kind, learned=(0.1, -third, 1e-7))


@pytest.mark.parametrize('law', LEARNED.values(), ids=LEARNED)
def test_a_learned_law_reads_back_to_the_bit(law, tmp_path: Path):
    path, made = tmp_path / 'model.yaml', learned(law)
    write_model(path, DepositionModel(effects=(made,)))
    assert read_model(path).effects == (made,)
    (entry,) = yaml.safe_load(path.read_text())['effects']
    assert (entry['id'], entry['covariate']) == ('learned', law.covariate)
    assert law.over in path.read_text()


MAP = 'covariate: place, maps: [{part_m: [1, 1, 1], high_m: [0.5, 0.5], rows: 2'


@pytest.mark.parametrize(('entry', 'message'), [
    ('covariate: tims_s', "'tims_s'; did you mean 'time_s'?"),
    ('low: 1', 'covariate is None; give that of the learned law'),
    ('covariate: time_s, high: -1', 'learned:time_s: high is -1; it must be above low, 0'),
    ('covariate: time_s, learned: [1]', 'learned has 1 values; give two or more'),
    ('covariate: time_s, sd: [1]', 'sd has 1 values and learned 2; give one for each'),
    ('covariate: time_s, sd: [0.1, -0.2]', 'sd has -0.2; a standard deviation is 0 or more'),
    ('covariate: edge_distance_m, low: 0.4, high: 0.5', 'must be above low'),
    (
        'covariate: height_fraction, kind: sum',
        "kind is 'sum'; expected 'factor' or 'addition': 1 + h times",
    ),
    ('covariate: time_s, learned: [0.1, .nan]', 'learned.1 is nan; expected a list'),
    ('covariate: time_s, kind: addition', "kind is 'addition'; over time_s give factor"),
    ('covariate: place, learned: [1, 2, 3]', 'has 3 values; its maps have 4 knots'),
    (f'{MAP}, columns: 1, low_m: [0, 0]}}]', 'columns is 1; expected 2 or more'),
    (f'{MAP}, columns: 2, low_m: [1, 0]}}]', 'high_m is (0.5, 0.5); it must be'),
    (f'{MAP}, columns: 2, low_m: 0}}]', 'low_m is 0; expected two numbers'),
    (f'{MAP}, columns: 2}}]', "has no 'maps.0.low_m'; give two numbers: lower"),
    ('covariate: footprint, learned: [1, 2]', 'has 2 values; give 5 for each of some radii'),
    ('covariate: footprint, reach_m: 0', 'reach_m is 0; expected a number above 0'),
])  # fmt: skip
def test_what_is_no_learned_law_is_said_in_one_line(file, entry: str, message: str):
    assert message in refusal(file('model.yaml', f'effects: [{{id: learned, {entry}}}]'))


def test_what_is_left_out_has_its_default(file):
    def read(text: str) -> DepositionModel:
        return read_model(file('model.yaml', text))

    assert read('planar: {K2: 0.3}') == DepositionModel(planar=PlanarPattern(K2=0.3))
    assert read('effects:').effects == ()
    assert read('planar: {K2: 1e-2}').planar.K2 == 0.01
    assert read('effects: [{id: air_drift}]').effects[0].is_neutral


@pytest.mark.parametrize(('text', 'message'), [
    ('planar: {K1_cm3_per_s: 0}', 'K1_cm3_per_s is 0; expected a number above 0 and up to'),
    ('planar: {K2: true}', 'K2 is True; expected a number'),
    ('planar: {K2: 3, K3: 4}', 'planar: K2 is 3; expected a number 0 to 1: K2, '
     'weight of the centred Gaussian [1] (and 1 more)'),
    ('planar: {K1: 2}', "planar: unknown key 'K1'; did you mean 'K1_cm3_per_s'"),
    ('planar: [1]', 'planar is [1]; expected a mapping (key: value)'),
    ('planr: {}', "model: unknown key 'planr'; did you mean 'planar'"),
    ('projection: {occlusion: maybe}', "occlusion is 'maybe'; expected true or false"),
    ('{projection: {occlusion: true}, effects: [{id: occlusion}]}', 'keep the effect'),
    ('effects: {id: sag}', "effects is {'id': 'sag'}; expected a list"),
    ('effects: [sag]', "effects.0 is 'sag'; expected a list of mappings"),
    ('effects: [{run_m: 0.1}]', 'effects, entry 1: has no id; give one of id, file'),
    ('effects: [{id: sag, file: x.py}]', 'entry 1: has id and file; give one of id, file'),
    ('effects: [{id: 7}]', 'effects, entry 1: id is 7; expected text'),
    ('effects: [{id: air_drfit}]', "'air_drfit'; did you mean 'air_drift'"),
    ('effects: [{id: sag}, {id: sag}]', "effects: 'sag' is listed twice; keep one"),
    ('effects: [{id: sag, run_m: -1}]', 'sag: run_m is -1; expected a number 0 to 0.03'),
    ('effects: [{id: sag, run: 0.1}]', "sag: unknown key 'run'; did you mean 'run_m'"),
    ('effects: [{id: sag, run_m: .nan}]', 'sag: run_m is nan; expected a number'),
    ('effects: [{file: none.py}]', 'none.py: cannot be read (No such file or directory)'),
    ('name: 3', 'name is 3; expected text'),
    ('history: [{}, 3]', 'history.1 is 3; expected a list of mappings'),
    ('', 'model is None; expected the keys name, planar'),
    ('planar: {K2: .1, K2: .2}', 'cannot be read as YAML (line 1: found duplicate key "K2"'),
    *((f'planar: {{K2: {value}}}', 'put such a value in quotes, without tags')
      for value in ('2024-13-45', '!!bool foo', '!!int ""', r'"\ud800"', f'0x{6000 * "f"}')),
    ('planar:\n  K2: [', 'cannot be read as YAML (line 2: '),
    ('brushes: {}', ': brushes is empty; give a brush by its number, or planar'),
    ('brushes: {0: {planar: {}}}', ': brushes: 0 is not a brush number; give 1, 2 and so on'),
    ('brushes: {1: 3}', ': brushes, 1 is 3; expected the keys '),
    ('brushes: {1: {planer: {}}}',
     ": brushes, 1: unknown key 'planer'; did you mean 'planar'?"),
    ('brushes: {1: {planar: {}, solids: 45}}',
     ': brushes, 1: solids is 45; expected a number'),
    ('brushes: {1: {planar: {K2: 2}}}', ': brushes, 1: planar: K2 is 2; expected a number 0 '),
    ('brushes: {1: {solids: 0.4}}',
     ': brushes, 1: planar is missing; calibrate the brush, or'),
    ('planar: {}\nbrushes: {1: {planar: {}}}',
     ': planar and brushes are both given; keep one'),
])  # fmt: skip
def test_what_is_wrong_is_said_in_one_line(file, text: str, message: str):
    assert message in refusal(file('model.yaml', text))


def test_a_missing_or_unreadable_file_is_named(tmp_path: Path):
    assert 'no such file; give a model YAML' in refusal(tmp_path / 'model.yaml')
    assert 'cannot be read' in refusal(tmp_path)
    (tmp_path / 'own.py').write_bytes(bytes(3_000_000))
    (tmp_path / 'model.yaml').write_text('effects: [{file: own.py}]')
    assert 'own.py has 3 MB; give a file of 2 MB' in refusal(tmp_path / 'model.yaml')
    (tmp_path / 'model.yaml').write_bytes(b'\xff\xfe\x00')
    assert 'is no text, such as a workbook or a bag' in refusal(tmp_path / 'model.yaml')


def test_a_failed_write_leaves_the_old_file(tmp_path: Path):
    path = tmp_path / 'model.yaml'
    write_model(path, DepositionModel())
    before = path.read_text()
    with pytest.raises(ValueError, match='object cannot be written'):
        write_model(path, DepositionModel(), history=[{'what': object()}])
    assert path.read_text() == before
    assert list(tmp_path.iterdir()) == [path]


CORNERS = DepositionModel(effects=(EFFECTS['corner_slowdown'](gain=0.5, length_m=0.2),))
NAMES = [*(c.name for c in PATTERN), 'corner_slowdown.gain', 'corner_slowdown.log_length_m']
ROOT = np.random.default_rng(0).normal(size=(len(NAMES), len(NAMES)))
COVARIANCE = 1e-4 * ROOT @ ROOT.T
POSTERIOR = Posterior(
    mean={name: 0.1 * k for k, name in enumerate(NAMES)},
    covariance=dict(zip(NAMES, COVARIANCE.tolist(), strict=True)),
    readings=('0123456789ab',), process={'voltage_kv': 60.0},
)  # fmt: skip


@pytest.fixture
def with_posterior(tmp_path: Path) -> Path:
    write_model(tmp_path / 'model.yaml', CORNERS, posterior=POSTERIOR)
    return tmp_path / 'model.yaml'


def test_a_posterior_reads_back(with_posterior: Path):
    again = read_model_file(with_posterior).posterior
    assert again == POSTERIOR
    assert again.names == tuple(NAMES)
    assert again.centre == pytest.approx(0.1 * np.arange(len(NAMES)))
    assert again.matrix == pytest.approx(COVARIANCE)


@pytest.mark.parametrize(('change', 'words'), [
    (lambda s: s['covariance']['K2'].__setitem__(0, 1.0), 'covariance is not symmetric: '),
    (lambda s: s['covariance']['log_K1'].__setitem__(0, -1.0), 'is not positive definite'),
    (lambda s: s['covariance']['r_m'].pop(), 'covariance.r_m has 8 numbers; expected 9'),
    (lambda s: [s[of].pop('K2') for of in ('mean', 'covariance')], 'mean has no K2'),
    (lambda s: s['mean'].update(K2=True), 'mean.K2 is True; expected a number'),
    (lambda s: s.pop('covariance'), "has no 'covariance'"),
    (lambda s: s.update(covarianc={}), "unknown key 'covarianc'; did you mean 'covariance'"),
])  # fmt: skip
def test_what_is_wrong_with_a_posterior_is_said_in_one_line(with_posterior, change, words):
    content = yaml.safe_load(with_posterior.read_text())
    change(content['posterior'])
    with_posterior.write_text(yaml.safe_dump(content, sort_keys=False))
    message = refusal(with_posterior)
    assert message.startswith(f'{with_posterior}: posterior')
    assert words in message


def test_files_have_the_rights_of_the_process_whose_umask_is_not_changed(tmp_path, monkeypatch):
    before = os.umask(0o027)
    # The mask belongs to the process: two threads that set it and put it back can leave it at 0.
    monkeypatch.setattr(os, 'umask', lambda mask: pytest.fail('the umask was changed'))
    write_text(tmp_path / 'film.csv', 'x_m,y_m')
    monkeypatch.undo()
    assert stat.S_IMODE((tmp_path / 'film.csv').stat().st_mode) == 0o640
    assert os.umask(before) == 0o027

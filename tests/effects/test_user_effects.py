"""A user's own effect: one file, taken in like those of the project or refused with a remedy."""

import importlib.util
import pickle
import sys
from pathlib import Path

import numpy as np
import pytest
from numba import njit

from booth import SAMPLES, painted, panel, path_of, serpentine
from paint_deposition.effects.catalogue import EFFECTS, TRIAL_RAY, effect_class, load_effect_file
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import ModelError
from paint_deposition.files.model_file import write_model
from paint_deposition.kernel.laws import Ray, in_precision

SAMPLE = (SAMPLES / 'my_effect.py').read_text()


@pytest.fixture
def own(tmp_path: Path):
    """Writes a file of an effect: the sample with something replaced."""

    def write(*changes: tuple[str, str]) -> Path:
        text = SAMPLE
        for before, after in changes:
            assert before in text
            text = text.replace(before, after)
        path = tmp_path / 'own.py'
        path.write_text(text)
        return path

    return write


@pytest.mark.slow
def test_the_sample_is_short_and_paints_less_the_faster_the_gun():
    assert len(SAMPLE.splitlines()) <= 30
    effect = load_effect_file(SAMPLES / 'my_effect.py')
    assert effect.id == 'wake_loss'
    path = path_of(serpentine((0.0,), speed_m_per_s=0.5))
    plain = painted(panel(), path).raw_um
    film = painted(panel(), path, effect(loss_per_m_per_s=0.4)).raw_um
    np.testing.assert_allclose(film, plain * np.exp(-0.4 * 0.5), atol=1e-9 * plain.max())


def test_a_law_may_use_all_of_the_ray_and_numbers_of_its_module(own):
    path = own(
        ('* ray.speed_m_per_s', '* ray.standoff_ratio'),
        ('return exp', 'return GAIN * (1 + ray.x_m / 3 - ray.y_m**2) * ray.cos_incidence * exp'),
        ('class WakeLoss', 'GAIN = 0.7\n\n\nclass WakeLoss'),
    )  # fmt: skip
    law = load_effect_file(path).flux_factor
    compiled = njit(in_precision(law, np.float32))(TRIAL_RAY, np.float32(0.5))
    assert compiled == pytest.approx(law(Ray(*map(float, TRIAL_RAY)), 0.5), rel=1e-6)


def test_the_same_file_is_the_same_class_and_can_go_to_another_process(own):
    path = own()
    effect = load_effect_file(path)
    assert load_effect_file(str(path)) is effect
    assert effect.file == path
    assert pickle.loads(pickle.dumps(effect.typical())) == effect.typical()


@pytest.mark.parametrize(
    ('changes', 'message'),
    [
        ([('(Effect)', '')], 'has no effect; define one class that derives from Effect'),
        ([("id = 'wake_loss'", "id = 'sag'")], "the id 'sag' is that of an effect of the project"),
        ([("    id = 'wake_loss'\n", '')], 'has no id; add a line id = '),
        ([("id = 'wake_loss'", "id = 'Wake loss'")], 'use small letters, digits and _'),
        ([("    family = 'time'\n", '')], 'has no family'),
        ([('loss_per_m_per_s: float =', 'loss_per_m_per_s =')], 'line 10: PydanticUserError'),
        ([('= parameter(\n        0.0, low', '= dict(\n        low')], 'without parameter(...)'),
        ([("unit='1/(m/s)'", "unit='1/(m/s)', role='shape'")], 'has no amplitude'),
        ([('typical=0.2, ', '')], 'line 17: TypeError: an amplitude needs its typical size'),
        ([('typical=0.2', 'typical=0.0')], 'is absent at its typical size'),
        ([('low=0.0', 'low=0.1')], 'outside its bounds; widen them'),
        ([('    @staticmethod\n', '')], 'defines flux_factor with self; put @staticmethod before'),
        ([('ray: Ray, loss_per_m_per_s: float', 'ray')], 'flux_factor(ray, loss_per_m_per_s)'),
        ([('flux_factor', 'flux')], 'does nothing; define one of flux_factor, pattern_scale'),
        ([('return exp', "return open('x').read() + exp")], 'flux_factor that does not compile'),
        ([('return exp', 'return -exp')], 'a factor is 0 or more'),
        ([('return exp', 'retrun exp')], 'SyntaxError'),
        ([('kernel.fast_math', 'kernel.fast_maths')], 'line 7: ModuleNotFoundError'),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_in_one_line_with_its_remedy(own, changes, message):
    path = own(*changes)
    with pytest.raises(ModelError) as refused:
        load_effect_file(path)
    assert message in str(refused.value)
    assert str(refused.value).startswith(str(path))
    assert '\n' not in str(refused.value)


def test_two_effects_in_a_file_are_refused(own):
    path = own()
    path.write_text(SAMPLE + '\n\nclass Other(WakeLoss):\n    id = "other"\n')
    with pytest.raises(ModelError, match=r'has several effects \(WakeLoss, Other\)'):
        load_effect_file(path)


@pytest.mark.parametrize(
    ('place', 'body', 'message'),
    [
        ('on_film(self, film_um, points)', 'return film_um[:2]', 'not return a finite film'),
        ('on_gauge(self, film_um, points)', 'return film_um / 0.0 * 0.0', 'not return a finite'),
        ('on_film(self, film_um, points)', 'return points.no_such', 'fails (AttributeError'),
        ('on_path(self, path, context)', 'return None', 'return path.with_(...)'),
    ],
)
def test_places_are_tried_out(own, place, body, message):
    path = own(('    @staticmethod', f'    def {place}:\n        {body}\n\n    @staticmethod'))
    with np.errstate(all='ignore'), pytest.raises(ModelError) as refused:
        load_effect_file(path)
    assert message in str(refused.value)


def test_a_missing_file_is_named(tmp_path: Path):
    with pytest.raises(ModelError, match=r'nothing\.py: cannot be read \(No such file'):
        load_effect_file(tmp_path / 'nothing.py')


def test_an_unknown_id_is_answered_with_the_nearest():
    assert effect_class('air_drift') is EFFECTS['air_drift']
    with pytest.raises(ModelError, match=r"'air_drfit'; did you mean 'air_drift'\?"):
        effect_class('air_drfit')
    with pytest.raises(ModelError, match='there are: incidence_attraction, '):
        effect_class('???')


def test_a_class_of_a_script_has_no_file_that_a_model_could_name(own, tmp_path):
    spec = importlib.util.spec_from_file_location('script', own())
    script = sys.modules['script'] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    model = DepositionModel(effects=(script.WakeLoss(loss_per_m_per_s=0.3),))
    with pytest.raises(ModelError, match="effect 'wake_loss' has no file; put WakeLoss in a file"):
        write_model(tmp_path / 'out.yaml', model)

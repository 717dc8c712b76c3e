"""A user's own effect: one file, taken in like those of the project or refused with a remedy."""

import importlib.util
import os
import pickle
import subprocess
import sys
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from numba import njit

import paint_deposition as pd
from booth import SAMPLES, painted, panel, path_of, serpentine
from paint_deposition.effects.base import Effect, PathContext, SprayPath
from paint_deposition.errors import ModelError
from paint_deposition.files.effect_file import NEEDS, PLACES, TRIAL_RAYS, load_effect_file
from paint_deposition.kernel.eq2_flux import Ray, in_precision

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
        ('return exp', 'shape = GAIN * (1 + ray.x_m / 3 - ray.y_m**2) * ray.cos_incidence\n'
         '        return 1 + loss_per_m_per_s * shape * exp'),
        ('class WakeLoss', 'GAIN = 0.7\n\n\nclass WakeLoss'),
    )  # fmt: skip
    law = load_effect_file(path).flux_factor
    for ray in TRIAL_RAYS:
        compiled = njit(in_precision(law, np.float32))(ray, np.float32(0.5))
        assert compiled == pytest.approx(law(Ray(*map(float, ray)), 0.5), rel=1e-6)


def test_the_same_file_is_the_same_class_and_one_of_a_script_has_none(own, tmp_path):
    path = own()
    effect = load_effect_file(path)
    assert load_effect_file(str(path)) is effect
    assert effect.file == path
    assert pickle.loads(pickle.dumps(effect.typical())) == effect.typical()
    spec = importlib.util.spec_from_file_location('script', own())
    script = sys.modules['script'] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    model = pd.DepositionModel(effects=(script.WakeLoss(loss_per_m_per_s=0.3),))
    with pytest.raises(ModelError, match="effect 'wake_loss' has no file; put WakeLoss in a file"):
        pd.write_model(tmp_path / 'out.yaml', model)


def line(text: str) -> list[tuple[str, str]]:
    return [("    family = 'time'\n", f"    family = 'time'\n    {text}\n")]


def with_place(head: str, body: str) -> list[tuple[str, str]]:
    method = f'    def {head}:\n        {body}\n\n'
    return [('    @staticmethod', f'{method}    @staticmethod')]


def film(body: str) -> list[tuple[str, str]]:
    return with_place('on_film(self, film_um, points)', body)


def along(body: str) -> list[tuple[str, str]]:
    return with_place('on_path(self, path, context)', body)


def shape(name: str, low: str) -> str:
    rest = f"{low}, high=2.0, unit='m', role='shape', description='l'"
    return f'{name}: float = parameter(2.0, {rest})'


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
        ([("low=0.0", 'low=0.1'), ("unit='1/(m/s)'", "unit='1/(m/s)', role='shape'"),
          ('0.0, low', '0.2, low')], 'has no amplitude'),
        ([('typical=0.2, ', '')], 'line 17: TypeError: an amplitude needs its typical size'),
        ([('typical=0.2', 'typical=0.0')], 'is absent at its typical size'),
        ([('low=0.0', 'low=0.1')], 'outside its bounds; widen them'),
        ([('    @staticmethod\n', '')], 'defines flux_factor with self; put @staticmethod before'),
        ([('ray: Ray, loss_per_m_per_s: float', 'ray')], 'flux_factor(ray, loss_per_m_per_s)'),
        ([('flux_factor', 'flux')], 'does nothing; define one of flux_factor, pattern_scale'),
        ([('return exp', "return open('x').read() + exp")], 'flux_factor that does not compile'),
        ([('return exp', 'return -exp')], 'a factor is 0 or more'),
        ([('return exp', 'retrun exp')], 'SyntaxError'),
        ([('speed_m_per_s)\n', 'speed_m_per_s)\n\n\nclass Other(WakeLoss):\n    id = "other"\n')],
         'has several effects (WakeLoss, Other)'),
        ([('kernel.fast_math', 'kernel.fast_maths')], 'line 7: ModuleNotFoundError'),
        (film('return film_um[:2]'), 'not return a finite film'),
        (with_place('on_gauge(self, film_um, points)', 'return film_um / 0.0 * 0.0'),
         'not return a finite'),
        (film('return points.no_such'), 'fails (AttributeError'),
        (along('return None'), 'return path.with_(...)'),
        (film('film_um += 1.0; return film_um'), 'has an on_film that changes what it is given'),
        (film('return film_um.tolist()'), 'return an array with one finite number a point'),
        (film('return film_um + (film_um > 9.0) * points.edge_distance_m'),
         'has an on_film that does not return a finite film'),
        (film('return film_um * 1.1'), 'has an on_film that changes something at the neutral'),
        (along('path.flow[:] = 1.0; return path'), 'has an on_path that changes what it is given'),
        (along('return path.with_(flow=path.flow[:, None])'), 'gives flow the shape'),
        (along('return path.with_(dwell_s=path.dwell_s / 0.0)'), 'gives dwell_s that is not fin'),
        (along('return path.with_flow_scaled(-0.2)'), 'gives flow of -0.2; give 0 or more'),
        # A law that is there at its neutral value is not absent there.
        ([('return exp', 'return 1.0 + ray.speed_m_per_s * exp')], 'it must be 1 there'),
        (with_place('shadow(self)', 'return 0.5'), 'has a shadow of 0.5 at the neutral values'),
        (with_place('shadow(self)', 'return 2.0'), 'has a shadow of 2; give 0 to 1'),
        (with_place('widening(self)', 'return 0.5'), 'has a widening of 0.5; give 1 to inf'),
        ([('flux_factor', 'pattern_scale')], 'has a pattern_scale and no widening'),
        ([('high=2.0', "high=float('inf')")], 'loss_per_m_per_s high=inf; give a finite number'),
        ([('0.0, low', 'False, low')], 'loss_per_m_per_s neutral=False; give a number'),
        ([("unit='1/(m/s)'", "unit='1/(m/s)', role='size'")], "the role 'size'; give 'amplitude'"),
        ([('_per_s: float', '_per_s: int')], 'as int; a fit varies it: declare it as float'),
        (line(shape('length_m', 'low=0.0')), 'gives the shape length_m low=0; a length or time'),
        (line(shape('length_m', 'low=2.0')), 'low=2 and high=2; high must be above low'),
        (line(shape('shadow', 'low=1.0')), 'has a parameter shadow, a name that every effect has'),
        (line("needs = 'volts'"), "has needs = 'volts'; give one of voltage, draught"),
        (line("free_law = 'sum'"), "has free_law = 'sum'; give one of factor, addition"),
        (line("covariates = 'time_s'"), "has covariates = 'time_s'; give names, ('time_s',)"),
        (line("covariates = ('time',)"), "'time', which is none; did you mean 'time_s'"),
        (line("covariates = ('time_s',); free_law = 'addition'"), 'over time_s a law is a factor'),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_in_one_line_with_its_remedy(own, changes, message):
    path = own(*changes)
    with np.errstate(all='ignore'), pytest.raises(ModelError) as refused:
        load_effect_file(path)
    assert message in str(refused.value)
    assert str(refused.value).startswith(str(path))
    assert '\n' not in str(refused.value)


def test_the_page_on_ones_own_effect_names_what_there_is(repository: Path):
    text = (repository / 'docs/own_effect.md').read_text(encoding='utf-8')
    assert (SAMPLES / 'my_effect.py').relative_to(repository).as_posix() in text
    for name in Ray._fields:
        assert f'`{name}`' in text
    for place in (*PLACES, 'widening'):
        assert f'`{place}(' in text
        assert hasattr(Effect, place)
    columns = (field.name for of in (SprayPath, PathContext) for field in fields(of))
    for name in (*columns, 'downhill', 'across', 'slope_per_m', *NEEDS[1:]):
        assert f'`{name}`' in text or f"`'{name}'`" in text or f"'{name}'`" in text


IMPORTED = """
from numba import njit

@njit
def raised(x):
    return x + {lift}
"""
EFFECT = """
from raising import raised
from paint_deposition.effects.base import Effect, Ray, parameter

GAIN = 2.0

class Scaled(Effect):
    id = 'scaled'
    family = 'own'
    a: float = parameter(0.0, low=0.0, high=1.0, typical=0.5, unit='1', description='a')

    @staticmethod
    def flux_factor(ray: Ray, a: float) -> float:
        return 1.0 + GAIN * a * raised(a)
"""
# One run: the law, compiled and kept on disk as a kernel is, and how often it was found there.
RUN = """
import sys

from paint_deposition.effects.base import Ray
from paint_deposition.files.effect_file import load_effect_file
from paint_deposition.kernel.compiler import named_for_its_code, njit
from paint_deposition.kernel.eq2_flux import product

law = load_effect_file(sys.argv[1]).flux_factor
factor = product([(law, 1)], float)

def scaled(ray, parameters):
    return factor(ray, parameters)

compiled = njit(cache=True)(named_for_its_code(scaled, [law]))
print(compiled(Ray(0.1, 0.2, 1.7, 0.6, 0.4), (0.5,)))
print(sum(compiled.stats.cache_hits.values()))
"""


@pytest.mark.slow
def test_what_is_edited_between_runs_counts_in_the_next_and_what_is_not_is_found_again(tmp_path):
    """Also in a file that the effect's file imports, whatever Numba goes by."""
    (tmp_path / 'run.py').write_text(RUN)
    (tmp_path / 'own.py').write_text(EFFECT)
    environment = {k: v for k, v in os.environ.items() if k != 'NUMBA_CACHE_DIR'}
    for lift, hits in ((0.25, 0), (0.25, 1), (0.75, 0)):
        (tmp_path / 'raising.py').write_text(IMPORTED.format(lift=lift))
        command = [sys.executable, '-B', tmp_path / 'run.py', tmp_path / 'own.py']
        done = subprocess.run(command, capture_output=True, text=True, env=environment)
        assert done.returncode == 0, done.stderr
        factor, found = done.stdout.split()
        assert float(factor) == pytest.approx(1.0 + 2.0 * 0.5 * (0.5 + lift))
        assert int(found) == hits

"""Every effect and learned law there is: the library's, and those in Python files of users."""

import functools
import hashlib
import importlib
import inspect
import pkgutil
import re
import sys
import traceback
from collections.abc import Callable, Mapping
from contextvars import ContextVar
from pathlib import Path
from types import MappingProxyType, ModuleType
from typing import Any

import numpy as np

from paint_deposition.effects import library
from paint_deposition.effects.base import Effect, PathContext
from paint_deposition.effects.learned.curves import CURVES
from paint_deposition.effects.learned.law import LearnedFootprint, LearnedLaw, LearnedMap
from paint_deposition.errors import ModelError, did_you_mean
from paint_deposition.kernel.compiler import njit
from paint_deposition.kernel.laws import Ray, in_precision
from paint_deposition.model.eq2_projection import Projection
from paint_deposition.motion.path import SprayPath
from paint_deposition.motion.path_builder import spray_path
from paint_deposition.motion.trajectory import Trajectory
from paint_deposition.part.points import SurfacePoints

# In the order in which people look for causes.
FAMILIES = (
    'incidence', 'curvature', 'boundary', 'standoff', 'lateral shift', 'order', 'level', 'time',
    'visibility',
)  # fmt: skip


# Effect classes by id, family by family: one a file of the library.
for module in pkgutil.iter_modules(library.__path__, f'{library.__name__}.'):
    importlib.import_module(module.name)
EFFECTS: Mapping[str, type[Effect]] = MappingProxyType(
    {
        effect.id: effect
        for effect in sorted(
            (c for c in Effect.__subclasses__() if c.__module__.startswith(library.__name__)),
            key=lambda effect: (FAMILIES.index(effect.family), effect.id),
        )
    }
)
# Learned laws by covariate.
LEARNED: Mapping[str, type[LearnedLaw]] = MappingProxyType(
    {**CURVES, LearnedMap.covariate: LearnedMap, LearnedFootprint.covariate: LearnedFootprint}
)


def effect_class(effect_id: str) -> type[Effect]:
    """The class of an effect of the library, or of a learned law, as 'learned:time_s'.

    Raises:
        ModelError: there is none of that id; names the nearest.
    """
    family, is_learned, covariate = effect_id.partition(':')
    if is_learned and family == 'learned':
        return learned_law(covariate)
    if effect_id in EFFECTS:
        return EFFECTS[effect_id]
    raise ModelError(f'no effect is called {effect_id!r}; {did_you_mean(effect_id, EFFECTS)}')


def learned_law(covariate: str) -> type[LearnedLaw]:
    """The class of the learned law over a covariate.

    Raises:
        ModelError: there is none over it; names the nearest.
    """
    if covariate in LEARNED:
        return LEARNED[covariate]
    raise ModelError(
        f'no learned law has the covariate {covariate!r}; {did_you_mean(covariate, LEARNED)}'
    )


LAWS = ('flux_factor', 'pattern_scale')
PLACES = (*LAWS, 'on_path', 'on_film', 'on_gauge', 'shadow')
# A ray on which laws are tried out: at the model plane, 0.6 rad off the normal.
TRIAL_RAY = Ray(*np.array([0.1, -0.05, 1.0, 0.825, 0.5], dtype=np.float32))

# Whether code may run that data name, and not the user: --allow-effects.
effects_allowed = ContextVar('effects_allowed', default=False)

_loaded: dict[tuple[Path, str], type[Effect]] = {}


def load_effect_file(path: str | Path) -> type[Effect]:
    """``read_effect_file`` and ``try_effect``."""
    effect = read_effect_file(path)
    try_effect(effect, path)
    return effect


def load_unnamed_effect_file(path: str | Path) -> type[Effect]:
    """``load_effect_file`` for a file that only data name: a campaign, a recording, results.

    Raises:
        ModelError: such code is not allowed.
    """
    if not effects_allowed.get():
        raise ModelError(
            f'effect file {path} is not run, because it is Python code that you did not name; if '
            'you trust it, give --allow-effects, or its model yourself, with --model'
        )
    return load_effect_file(path)


def read_effect_file(path: str | Path) -> type[Effect]:
    """The class of a user's own effect: a Python file with one class derived from Effect.

    The same class while the file is the same. The file is run: load only what you would run
    yourself. Its laws are not compiled yet; ``try_effect`` does that.

    Raises:
        ModelError: the file cannot be read or run, its class is not sound, or its id is taken.
    """
    path = Path(path)
    if path.exists() and not path.is_file():
        raise ModelError(f'{path} is no file; give the file of an effect')
    try:
        source = path.read_bytes()
    except OSError as error:
        raise ModelError(
            f'{path}: cannot be read ({error.strerror}); give the file of an effect'
        ) from None
    return effect_of(path, source)


def effect_of(path: Path, source: bytes) -> type[Effect]:
    """``read_effect_file`` for the content of a file, wherever it may be."""
    key = (path.resolve(), hashlib.sha256(source).hexdigest())
    if key not in _loaded:
        module = _run(path, source, key[1])
        classes = [
            value
            for value in vars(module).values()
            if inspect.isclass(value)
            and issubclass(value, Effect)
            and value.__module__ == module.__name__
        ]
        if len(classes) > 1:
            names = ', '.join(c.__name__ for c in classes)
            raise ModelError(f'{path}: has several effects ({names}); keep one a file')
        if not classes:
            raise ModelError(f'{path}: has no effect; define one class that derives from Effect')
        (effect,) = classes
        if problem := _problem_with(effect):
            raise ModelError(f'{path}: {effect.__name__} {problem}')
        effect.file, effect.file_content = key[0], source
        _loaded[key] = effect
    effect = _loaded[key]
    if effect.id in EFFECTS:
        raise ModelError(
            f'{path}: the id {effect.id!r} is that of an effect of the project; choose another'
        )
    return effect


@functools.cache
def try_effect(effect: type[Effect], path: str | Path) -> None:
    """Compile the laws of an effect and use it on a short path and a few points.

    Raises:
        ModelError: it does not compile, fails or gives no usable result; ``path`` names its file.
    """
    laws = (_problem_with_law(effect, name) for name in LAWS)
    problem = next(filter(None, laws), None) or _problem_with_places(effect.typical())
    if problem:
        raise ModelError(f'{path}: {effect.__name__} {problem}')


def _run(path: Path, source: bytes, digest: str) -> ModuleType:
    # Not through the import system: that would keep stale byte code beside the user's file.
    sys.stderr.write(f'note: running the code of effect file {path}\n')
    module = ModuleType(f'paint_effect_{digest[:16]}')
    module.__file__ = str(path)
    sys.modules[module.__name__] = module
    try:
        exec(compile(source, str(path), 'exec'), module.__dict__)
    except (Exception, SystemExit) as error:
        del sys.modules[module.__name__]
        frames = traceback.extract_tb(error.__traceback__)
        lines = [frame.lineno for frame in frames if frame.filename == str(path)]
        if isinstance(error, SyntaxError):
            lines = [error.lineno]
        line = f', line {lines[-1]}' if lines else ''
        raise ModelError(
            f'{path}{line}: {type(error).__name__}: {_one_line(error)}; correct the file'
        ) from None
    return module


def _one_line(error: BaseException) -> str:
    """The telling line of a message; compilers begin theirs with how far they came."""
    text = re.sub(r'\x1b\[[0-9;]*m', '', str(error))
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    telling = [line for line in lines if not line.startswith('Failed in ')]
    return (telling or lines or [type(error).__name__])[0]


def _problem_with(effect: type[Effect]) -> str | None:
    """What is wrong and how to put it right, or None."""
    for name in ('id', 'family'):
        value = getattr(effect, name, None)
        if not isinstance(value, str) or not value:
            return f"has no {name}; add a line {name} = '...'"
    if not re.fullmatch('[a-z][a-z0-9_]*', effect.id):
        return f'has the id {effect.id!r}; use small letters, digits and _'
    own = [name for name in effect.model_fields if name not in Effect.model_fields]
    for name, field in ((name, effect.model_fields[name]) for name in own):
        if not isinstance(field.json_schema_extra, dict) or 'role' not in field.json_schema_extra:
            return f'declares {name} without parameter(...); give its unit and bounds there'
    if not effect.amplitudes():
        return 'has no amplitude; declare one with parameter(0.0, low=..., high=..., typical=...)'
    for name, described in effect.parameters().items():
        values = [described['low'], described['neutral'], described['high']]
        if sorted(values) != values or not values[0] <= described['typical'] <= values[2]:
            return f'has a neutral or typical {name} outside its bounds; widen them'
    if effect.typical().is_neutral:
        return 'is absent at its typical size; make typical differ from neutral'
    if all(getattr(effect, place) is getattr(Effect, place) for place in PLACES):
        return f'does nothing; define one of {", ".join(PLACES)}'
    return None


def _problem_with_law(effect: type[Effect], name: str) -> str | None:
    law = getattr(effect, name)
    if law is None:
        return None
    if not isinstance(inspect.getattr_static(effect, name), staticmethod):
        return f'defines {name} with self; put @staticmethod before it'
    wanted = ['ray', *effect.parameters()]
    if list(inspect.signature(law).parameters)[1:] != wanted[1:]:
        return f'must define {name}({", ".join(wanted)}): the ray, then all its parameters'
    values = np.array(effect.typical().values(), dtype=np.float32)
    try:
        result = njit(error_model='numpy')(in_precision(law, np.float32))(TRIAL_RAY, *values)
    except Exception as error:
        return (
            f'has a {name} that does not compile ({_one_line(error)}); keep to arithmetic, min, '
            'max and kernel.fast_math'
        )
    if not isinstance(result, float) or not np.isfinite(result) or result < 0.0:
        return f'has a {name} that gives {result!r} on an ordinary ray; a factor is 0 or more'
    return None


def _problem_with_places(effect: Effect) -> str | None:
    """Try the effect on a short path and a few points."""
    square = np.array([[x, 0.0, z] for x in (0.0, 0.1) for z in (0.0, 0.1)])
    points = SurfacePoints(square, np.tile([0.0, -1.0, 0.0], (4, 1)))
    context = PathContext(Projection(), points.down, points.outward, points.centre_m)
    positions_m = np.linspace([0.0, -0.25, 0.05], [0.03, -0.25, 0.05], 4)
    toward_y = np.tile([-np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)], (4, 1))
    path, _ = spray_path(Trajectory(np.arange(4) * 20_000_000, positions_m, toward_y))
    trials: dict[str, Callable[[], Any]] = {
        'on_path': lambda: effect.on_path(path, context),
        'on_film': lambda: effect.on_film(np.full(4, 20.0), points),
        'on_gauge': lambda: effect.on_gauge(np.full(4, 20.0), points),
    }
    for place, trial in trials.items():
        try:
            result = trial()
        except Exception as error:
            return f'has an {place} that fails ({type(error).__name__}: {_one_line(error)})'
        if place == 'on_path':
            if not isinstance(result, SprayPath) or len(result) != len(path):
                return 'has an on_path that does not return a path; return path.with_(...)'
        elif np.shape(result) != (4,) or not np.isfinite(result).all():
            return f'has an {place} that does not return a finite film; return one value a point'
    return None

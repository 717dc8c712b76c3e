"""Users' own effects: Python files, each with one class, and its trial: what is wrong with it."""

import functools
import hashlib
import inspect
import math
import re
import sys
import traceback
from collections.abc import Callable
from contextvars import ContextVar
from dataclasses import fields
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from paint_deposition.effects.base import Effect, PathContext
from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.effects.learned_curves import CURVES
from paint_deposition.errors import ModelError, did_you_mean
from paint_deposition.files.atomic import MOST_YAML_MB, read_file
from paint_deposition.kernel.compiler import njit
from paint_deposition.kernel.eq2_flux import Ray, in_precision
from paint_deposition.model.eq2_projection import Projection
from paint_deposition.motion.path import SprayPath
from paint_deposition.motion.path_builder import spray_path
from paint_deposition.motion.trajectory import Trajectory
from paint_deposition.part.points import SurfacePoints

# Whether code may run that data name, and not the user: --allow-effects.
effects_allowed = ContextVar('effects_allowed', default=False)

LAWS = ('flux_factor', 'pattern_scale')
PLACES = (*LAWS, 'on_path', 'on_film', 'on_gauge', 'shadow')
# Covariates over which a law may be off: the names of the report.
COVARIATES = (*CURVES, 'tool_x_m', 'tool_y_m')
NEEDS = ('', 'voltage', 'draught')
FREE_LAWS = ('', 'factor', 'addition')
# Rays on which laws are tried out: at the model plane and beyond it.
TRIAL_RAYS = tuple(
    Ray(*np.array(ray, dtype=np.float32))
    for ray in ([0.1, -0.05, 1.0, 0.825, 0.5], [0.1, 0.2, 1.7, 0.6, 0.4])
)
# What of a path the kernel cannot do without.
FINITE = ('position_m', 'rotation', 'velocity_m_per_s', 'dwell_s', 'flow', 'pattern_shift_m')

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
        source = read_file(path, ModelError, MOST_YAML_MB)
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
        if problem := problem_in_words(effect):
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
    problem = next(filter(None, (_problem_with_law(effect, name) for name in LAWS)), None)
    if problem is None:
        typical = effect.typical()
        with np.errstate(all='ignore'):
            problem = (
                _problem_with_figures(typical)
                or _problem_with_places(typical)
                or _problem_with_places(typical.absent, changes=False)
            )
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
            f'{path}{line}: {type(error).__name__}: {one_line(error)}; correct the file'
        ) from None
    return module


# --- the trial: what is wrong with a class, and how to put it right


def problem_in_words(effect: type[Effect]) -> str | None:
    """What is wrong with the declarations of a class and how to put it right, or None."""
    for name in ('id', 'family'):
        value = getattr(effect, name, None)
        if not isinstance(value, str) or not value:
            return f"has no {name}; add a line {name} = '...'"
    if not re.fullmatch('[a-z][a-z0-9_]*', effect.id):
        return f'has the id {effect.id!r}; use small letters, digits and _'
    own = [name for name in effect.model_fields if name not in Effect.model_fields]
    for name in own:
        if problem := _problem_with_field(effect, name):
            return problem
    if not effect.amplitudes():
        return 'has no amplitude; declare one with parameter(0.0, low=..., high=..., typical=...)'
    if all(getattr(effect, place) is getattr(Effect, place) for place in PLACES):
        return f'does nothing; define one of {", ".join(PLACES)}'
    if effect.acts('pattern_scale') and not effect.acts('widening'):
        return (
            'has a pattern_scale and no widening, beyond which the spray is cut off; define '
            'widening(self): how many times wider than the pattern it can get, at least 1'
        )
    # The lines that a diagnosis goes by.
    for name, known in (('needs', NEEDS), ('free_law', FREE_LAWS)):
        if getattr(effect, name) not in known:
            return f'has {name} = {getattr(effect, name)!r}; give one of {", ".join(known[1:])}'
    if isinstance(effect.covariates, str):
        return f'has covariates = {effect.covariates!r}; give names, ({effect.covariates!r},)'
    for name in effect.covariates:
        if name not in COVARIATES:
            return f'has the covariate {name!r}, which is none; {did_you_mean(name, COVARIATES)}'
        if effect.free_law and name in CURVES and effect.free_law not in CURVES[name].kinds:
            return (
                f'has free_law = {effect.free_law!r}; over {name} a law is a '
                f'{" or ".join(CURVES[name].kinds)}'
            )
    return None


def _problem_with_field(effect: type[Effect], name: str) -> str | None:
    if name in Effect.__annotations__ or hasattr(Effect, name):
        return f'has a parameter {name}, a name that every effect has already; call it otherwise'
    described = effect.model_fields[name].json_schema_extra
    if not isinstance(described, dict) or 'role' not in described:
        return f'declares {name} without parameter(...); give its unit and bounds there'
    annotation = effect.model_fields[name].annotation
    if annotation is not float:
        kind = getattr(annotation, '__name__', annotation)
        return f'declares {name} as {kind}; a fit varies it: declare it as float'
    role = described['role']
    if role not in ('amplitude', 'shape'):
        return f"gives {name} the role {role!r}; give 'amplitude' or 'shape'"
    values: dict[str, Any] = {key: described[key] for key in ('low', 'neutral', 'typical', 'high')}
    for key, value in values.items():
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            return f'gives {name} {key}={value!r}; give a number'
        if not math.isfinite(value):
            return f'gives {name} {key}={value!r}; give a finite number'
    low, neutral, typical, high = values.values()
    if not low < high:
        return f'gives {name} low={low:g} and high={high:g}; high must be above low'
    if not (low <= neutral <= high and low <= typical <= high):
        return f'has a neutral or typical {name} outside its bounds; widen them'
    if role == 'shape' and low <= 0.0:
        return f'gives the shape {name} low={low:g}; a length or time scale is above 0'
    if role == 'amplitude' and typical == neutral:
        return f'is absent at its typical size, {name}={typical:g}; let it differ from neutral'
    return None


def one_line(error: BaseException) -> str:
    """The telling line of a message; compilers begin theirs with how far they came."""
    text = re.sub(r'\x1b\[[0-9;]*m', '', str(error))
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    telling = [line for line in lines if not line.startswith('Failed in ')]
    return (telling or lines or [type(error).__name__])[0]


def _problem_with_law(effect: type[Effect], name: str) -> str | None:
    law = getattr(effect, name)
    if law is None:
        return None
    if not isinstance(inspect.getattr_static(effect, name), staticmethod):
        return f'defines {name} with self; put @staticmethod before it'
    wanted = ['ray', *effect.parameters()]
    if list(inspect.signature(law).parameters)[1:] != wanted[1:]:
        return f'must define {name}({", ".join(wanted)}): the ray, then all its parameters'
    typical = effect.typical()
    compiled = njit(error_model='numpy')(in_precision(law, np.float32))
    for ray in TRIAL_RAYS:
        try:
            result, neutral = (
                compiled(ray, *np.array(one.values(), dtype=np.float32))
                for one in (typical, typical.absent)
            )
        except Exception as error:
            return (
                f'has a {name} that does not compile ({one_line(error)}); keep to arithmetic, '
                'min, max and kernel.fast_math'
            )
        if not isinstance(result, float) or not np.isfinite(result) or result < 0.0:
            return f'has a {name} that gives {result!r} on an ordinary ray; a factor is 0 or more'
        if not abs(neutral - 1.0) < 1e-5:
            return f'has a {name} that gives {neutral:g} at the neutral values; it must be 1 there'
    return None


def _problem_with_figures(effect: Effect) -> str | None:
    for name, low, high in (('widening', 1.0, np.inf), ('shadow', 0.0, 1.0)):
        try:
            value = float(getattr(effect, name)())
            neutral = float(getattr(effect.absent, name)())
        except Exception as error:
            return f'has a {name} that fails ({type(error).__name__}: {one_line(error)})'
        if not (np.isfinite(value) and low <= value <= high):
            return f'has a {name} of {value:g}; give {low:g} to {high:g}'
        if neutral != low:
            return f'has a {name} of {neutral:g} at the neutral values; it must be {low:g} there'
    return None


def _problem_with_places(effect: Effect, changes: bool = True) -> str | None:
    """Try the effect on a short path and a few points, which nothing may change in place.

    Args:
        changes: whether it may change anything at all: not at the neutral values.
    """
    square = np.array([[x, 0.0, z] for x in (0.0, 0.1) for z in (0.0, 0.1)])
    points = SurfacePoints(
        square, np.tile([0.0, -1.0, 0.0], (4, 1)),
        edge_distance_m=np.array([0.0, 0.01, 0.05, np.inf]),
        curvature_per_m=np.array([-4.0, 0.0, 4.0, 8.0]),
    )  # fmt: skip
    film_um = np.array([20.0, 5.0, 0.0, 40.0])
    context = PathContext(Projection(), points.down, points.outward, points.centre_m)
    positions_m = np.linspace([0.0, -0.25, 0.05], [0.06, -0.25, 0.05], 7)
    toward_y = np.tile([-np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)], (7, 1))
    path, _ = spray_path(Trajectory(
        np.arange(7) * 20_000_000, positions_m, toward_y,
        trigger_stamps_ns=np.array([30_000_000, 90_000_000]), trigger_flow=np.array([1.0, 0.0]),
    ))  # fmt: skip
    columns = (getattr(path, column.name) for column in fields(path))
    for given in (film_um, points.edge_distance_m, points.curvature_per_m, *columns):
        given.flags.writeable = False
    trials: dict[str, tuple[Any, Callable[[], Any]]] = {
        'on_path': (path, lambda: effect.on_path(path, context)),
        'on_film': (film_um, lambda: effect.on_film(film_um, points)),
        'on_gauge': (film_um, lambda: effect.on_gauge(film_um, points)),
    }
    for place, (given, trial) in trials.items():
        try:
            result = trial()
        except Exception as error:
            if 'read-only' in str(error):
                return f'has an {place} that changes what it is given; return a new array instead'
            return f'has an {place} that fails ({type(error).__name__}: {one_line(error)})'
        if problem := _problem_with_result(result, given):
            return f'has an {place} that {problem}'
        if not changes and not _same(result, given):
            return f'has an {place} that changes something at the neutral values; it must not'
    return None


def _problem_with_result(result: Any, given: SprayPath | np.ndarray) -> str | None:
    """What is wrong with what became of a path, or of a film."""
    if isinstance(given, np.ndarray):
        sound = isinstance(result, np.ndarray) and result.shape == given.shape
        if sound and result.dtype.kind in 'fiu' and np.isfinite(result).all():
            return None
        return (
            'does not return a finite film; return an array with one finite number a point, also '
            'on bare metal and where edge_distance_m is inf'
        )
    if not isinstance(result, SprayPath):
        return 'does not return a path; return path.with_(...)'
    for name in (column.name for column in fields(given)):
        value, wanted = getattr(result, name), getattr(given, name).shape
        if not isinstance(value, np.ndarray) or value.shape != wanted:
            return f'gives {name} the shape {np.shape(value)}; give an array {wanted}'
        if name in FINITE and not np.isfinite(value).all():
            return f'gives {name} that is not finite; give finite numbers'
        if name in ('flow', 'dwell_s') and value.min() < 0.0:
            return f'gives {name} of {value.min():g}; give 0 or more'
    return None


def _same(result: Any, given: Any) -> bool:
    if isinstance(given, SprayPath):
        return all(_same(getattr(result, c.name), getattr(given, c.name)) for c in fields(given))
    return bool(np.allclose(result, given, rtol=1e-9, atol=1e-12, equal_nan=True))

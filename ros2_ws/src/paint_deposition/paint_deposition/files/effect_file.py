"""Users' own effects: Python files, each with one class."""

import functools
import hashlib
import inspect
import sys
import traceback
from contextvars import ContextVar
from pathlib import Path
from types import ModuleType

from paint_deposition.effects.base import Effect
from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.errors import ModelError
from paint_deposition.files.effect_trial import one_line, problem_in_use, problem_in_words

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
    if problem := problem_in_use(effect):
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

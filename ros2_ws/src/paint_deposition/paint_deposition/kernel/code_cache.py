"""Compiled kernels kept on disk, under names for everything that went into them."""

import hashlib
import inspect
import sys
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any, TypeVar

import numba
import numpy as np

Compiled = TypeVar('Compiled', bound=Callable[..., Any])


def identity(laws: Sequence[Callable[..., float]], *variant: object) -> str:
    """A name for the code of laws, of everything that is compiled with them, and the variant.

    Compiled code refers to the laws' modules by name, so those names are part of it: the module
    of a user's own effect is named by its source.
    """
    parts = [_code_around(), repr((numba.__version__, variant)).encode()]
    for law in laws:
        parts.extend(_compiled_with(law, set()))
    return hashlib.sha256(b'\0'.join(parts)).hexdigest()[:24]


@cache
def _code_around() -> bytes:
    return b'\0'.join(file.read_bytes() for file in sorted(Path(__file__).parent.glob('*.py')))


def _compiled_with(value: Any, seen: set[int]) -> Iterator[bytes]:
    """What a function or constant brings into compiled code, with all that it names in turn."""
    function = getattr(value, 'py_func', value)
    if isinstance(function, FunctionType):
        if id(function.__code__) in seen:
            return
        seen.add(id(function.__code__))
        code = function.__code__
        yield code.co_code + repr((code.co_consts, code.co_names, code.co_varnames)).encode()
        yield _source_of(function.__module__)
        named = inspect.getclosurevars(function)
        for name, other in sorted((dict(named.globals) | dict(named.nonlocals)).items()):
            yield name.encode()
            yield from _compiled_with(other, seen)
    elif isinstance(value, ModuleType):
        yield _source_of(value.__name__)
    elif isinstance(value, np.ndarray):
        yield repr((value.dtype, value.shape)).encode() + value.tobytes()
    elif isinstance(value, (int, float, complex, str, tuple)):
        yield repr(value).encode()


@cache
def _source_of(module: str) -> bytes:
    """A module's name and a digest of its file; NumPy's functions are Numba's own in its code."""
    file = None if module == 'numpy' else getattr(sys.modules.get(module), '__file__', None)
    try:
        source = Path(file).read_bytes() if file else b''
    except OSError:
        source = b''
    return module.encode() + hashlib.sha256(source).digest()


def named_for_its_code(
    function: Compiled, laws: Sequence[Callable[..., Any]] | None = None, *variant: object
) -> Compiled:
    """Name a function for all that will be compiled with it, for ``numba.njit(cache=True)``.

    Numba keeps compiled code in a file for each qualified name and compares only the time of the
    function's own source file. With this name a change in what the function calls is seen too, and
    processes that compile different variants at once cannot swap them. What the function calls
    must be defined before it, and it must not enclose compiled functions: those differ in every
    process, so that nothing would be found again. ``laws`` are the functions whose code makes it
    another than others of its name, by default its own; ``variant`` is what else does.
    """
    functions = [function] if laws is None else laws
    function.__qualname__ = f'{function.__qualname__}-{identity(functions, *variant)}'
    return function

"""Numba's compiler for one kind of processor, and compiled kernels kept on disk.

What is compiled on one machine then serves all of its kind, so that a wheel can bring compiled
code. The kind belongs to a target of its own in Numba's sense: other compiled functions of the
same process, a user's own, are made for the processor at hand as ever. Kernels are kept under
names for everything that went into them.
"""

import hashlib
import inspect
import sys
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any, TypeVar

import llvmlite.binding as llvm
import numba
import numpy as np
from numba import config
from numba.core.codegen import JITCPUCodegen, get_host_cpu_features
from numba.core.registry import CPUDispatcher, CPUTarget
from numba.core.target_extension import CPU, dispatcher_registry, jit_registry, target_registry

# Servers of Intel since 2017 and of AMD since 2022; Intel since Haswell (2013) and AMD since
# Excavator (2015). Each with what it has that older ones lack, and what LLVM is told of it: by
# itself it uses half of a vector of 512 bits, because the first such processors slowed down.
KINDS = {
    'x86-64-v4': ('avx512f avx512bw avx512cd avx512dq avx512vl', '-prefer-256-bit'),
    'x86-64-v3': ('avx2 bmi2 f16c fma lzcnt movbe', ''),
}


def kinds_at_hand() -> list[str]:
    """The KINDS whose code this processor runs, the newest first."""
    has = llvm.get_host_cpu_features()
    return [kind for kind, (needs, _) in KINDS.items() if all(map(has.get, needs.split()))]


KIND = config.CPU_NAME or next(iter(kinds_at_hand()), llvm.get_host_cpu_name())
FEATURES = config.CPU_FEATURES
if FEATURES is None:
    FEATURES = KINDS[KIND][1] if KIND in KINDS else get_host_cpu_features()
TARGET_NAME = f'paint-{KIND}'


class Code(JITCPUCodegen):
    """Numba's code generator for the kind of processor."""

    def _get_host_cpu_name(self) -> str:
        return KIND

    def _get_host_cpu_features(self) -> str:
        return FEATURES


class Dispatcher(CPUDispatcher):
    """Functions that are compiled for the target."""

    targetdescr = CPUTarget(TARGET_NAME)


def njit(*functions: Callable[..., Any], nopython: bool = True, **options: Any) -> Any:
    """Numba's ``njit`` for the kind of processor."""
    return numba.jit(*functions, nopython=nopython, _target=TARGET_NAME, **options)


# What Numba's own functions and the overloads of `fast_math` are compiled by within ours.
target = type(TARGET_NAME, (CPU,), {})
target_registry[TARGET_NAME] = target
dispatcher_registry[target] = Dispatcher
jit_registry[target] = njit
Dispatcher.targetdescr.target_context._internal_codegen = Code(TARGET_NAME)

Compiled = TypeVar('Compiled', bound=Callable[..., Any])


# What compiles and calls it counts as its code, too.
AROUND = b'\0'.join(file.read_bytes() for file in sorted(Path(__file__).parent.glob('*.py')))


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
    another than others of its name, by default its own; ``variant`` is what else does. Compiled
    code refers to the laws' modules by name, so those names count too: the module of a user's own
    effect is named by its source.
    """
    parts = [AROUND, repr((numba.__version__, variant)).encode()]
    for law in [function] if laws is None else laws:
        parts.extend(_compiled_with(law, set()))
    digest = hashlib.sha256(b'\0'.join(parts)).hexdigest()[:24]
    function.__qualname__ = f'{function.__qualname__}-{digest}'
    return function

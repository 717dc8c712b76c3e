"""Numba's compiler, set to one kind of processor for the functions of this package alone.

What is compiled on one machine then serves all of its kind, so that a wheel can bring compiled
code. The kind belongs to a target of its own in Numba's sense: other compiled functions of the
same process, a user's own, are made for the processor at hand as ever.
"""

from collections.abc import Callable
from functools import cached_property
from typing import Any

import llvmlite.binding as llvm
import numba
from numba import config
from numba.core.codegen import JITCPUCodegen, get_host_cpu_features
from numba.core.cpu import CPUContext
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


def compiler_for(kind: str) -> Callable[..., Any]:
    """Numba's ``njit`` for a kind of processor; call it once for each."""
    if config.CPU_FEATURES is not None:
        features = config.CPU_FEATURES
    else:
        features = KINDS[kind][1] if kind in KINDS else get_host_cpu_features()
    name = f'paint-{kind}'

    class Code(JITCPUCodegen):
        def _get_host_cpu_name(self) -> str:
            return kind

        def _get_host_cpu_features(self) -> str:
            return features

    class Context(CPUContext):
        def init(self) -> None:
            super().init()
            self._internal_codegen = Code(name)

    class Descriptor(CPUTarget):
        @cached_property
        def _toplevel_target_context(self) -> Context:
            return Context(self.typing_context, self._target_name)

    class Dispatcher(CPUDispatcher):
        targetdescr = Descriptor(name)

    def njit(*functions: Callable[..., Any], nopython: bool = True, **options: Any) -> Any:
        return numba.jit(*functions, nopython=nopython, _target=name, **options)

    # What Numba's own functions and the overloads of `fast_math` are compiled by within ours.
    target = type(name, (CPU,), {})
    target_registry[name] = target
    dispatcher_registry[target] = Dispatcher
    jit_registry[target] = njit
    return njit


KIND = config.CPU_NAME or next(iter(kinds_at_hand()), llvm.get_host_cpu_name())
njit = compiler_for(KIND)

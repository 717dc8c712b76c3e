"""Numba's compiler, set to one kind of processor instead of the one at hand.

What is compiled on one machine then serves the others, so that a wheel can bring compiled code.
The setting is that of the whole process; the package compiles through this `njit` alone.
"""

import llvmlite.binding as llvm
from numba import config, njit

__all__ = ['njit']

# Intel since Haswell (2013), AMD since Excavator (2015), by what tells them from older ones.
KIND = 'x86-64-v3'
ITS_FEATURES = ('avx2', 'bmi2', 'f16c', 'fma', 'lzcnt', 'movbe')

# Unless the user's NUMBA_CPU_NAME names another kind, or this processor is no such.
_has = llvm.get_host_cpu_features()
if config.CPU_NAME is None and all(_has.get(feature) for feature in ITS_FEATURES):
    config.CPU_NAME = KIND
    config.CPU_FEATURES = ''

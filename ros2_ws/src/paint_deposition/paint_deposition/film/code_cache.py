"""Compiled kernels kept on disk, and told apart by everything that went into them."""

import hashlib
import inspect
from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import CodeType
from typing import Any

import numba
from numba.core.caching import FunctionCache, IndexDataCacheFile

from paint_deposition.effects.base import Ray


def identity(laws: list[Callable[..., float]], *variant: object) -> str:
    """A name for the code of laws, of everything that is compiled with them, and the variant."""
    parts = [_code_around(), repr((numba.__version__, variant)).encode()]
    for law in laws:
        parts.append(_fingerprint(law.__code__))
        named = {n: law.__globals__.get(n) for n in sorted(law.__code__.co_names)}
        numbers = {n: v for n, v in named.items() if isinstance(v, (int, float))}
        parts.append(repr(numbers).encode())
    return hashlib.sha256(b'\0'.join(parts)).hexdigest()[:24]


@cache
def _code_around() -> bytes:
    files = [*sorted(Path(__file__).parent.glob('*.py')), Path(inspect.getfile(Ray))]
    return b'\0'.join(file.read_bytes() for file in files)


def _fingerprint(code: CodeType) -> bytes:
    return code.co_code + repr((code.co_consts, code.co_names, code.co_varnames)).encode()


class CodeCache(FunctionCache):
    """Numba's cache on disk, for a function that depends on laws as well as on its own code.

    Numba tells functions apart by what they enclose, which for compiled functions differs in
    every process, so that nothing would ever be found again. It also numbers the variants of a
    function in one index: two processes that compile at the same time give one number to
    different variants, and one of them is later loaded for the other. Here each has its own file.

    Args:
        function: what will be compiled.
        name: its ``identity``.
    """

    def __init__(self, function: Callable[..., Any], name: str) -> None:
        super().__init__(function)
        self._identity = name
        stamp = self._impl.locator.get_source_stamp()
        self._cache_file = IndexDataCacheFile(self._cache_path, f'kernel-{name}', stamp)

    def _index_key(self, sig: Any, codegen: Any) -> Any:
        return sig, codegen.magic_tuple(), self._identity

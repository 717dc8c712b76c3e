"""Laws of effects made ready for the kernel: in its precision, and multiplied."""

from collections.abc import Callable, Mapping, Sequence
from types import CodeType, FunctionType
from typing import Any, NamedTuple

from numba.core.dispatcher import Dispatcher
from numba.extending import register_jitable

from paint_deposition.kernel.compiler import named_for_its_code, njit


class Ray(NamedTuple):
    """One straight ray from the emission point to a surface point, inside the kernel."""

    # Where it pierces the model plane, tool axes [m].
    x_m: float
    y_m: float
    standoff_ratio: float  # distance along the bell's axis over Omega [1]
    cos_incidence: float  # cosine of the angle to the surface normal, above 0 [1]
    speed_m_per_s: float  # of the atomizer [m/s]


Law = Callable[..., float]
# One call left in the hot loop keeps it from being vectorised: a law of many parameters would be
# thought too large to inline, and make the loop twenty times as slow.
_inlined = register_jitable(forceinline=True)


def in_precision(law: Law, real: type) -> Law:
    """The law with its numbers in the kernel's precision.

    A literal 1.0 is of double precision, and one is enough to carry a whole loop over single
    precision into double and halve its speed. So the numbers in the law's code, and those of its
    module that it names, are replaced by ones of type ``real``. What the law's author compiled
    for it to call is compiled anew, for the kernel's kind of processor.
    """
    code, known = law.__code__, law.__globals__
    constants = tuple(_as_real(value, real) for value in code.co_consts)
    named = {name: _as_real(known[name], real) for name in code.co_names if name in known}
    return with_names(law, named, code.replace(co_consts=constants))


def with_names(
    function: Callable[..., Any], names: Mapping[str, object], code: CodeType | None = None
) -> FunctionType:
    """The function with other values for names of its module, and other code."""
    return FunctionType(
        code or function.__code__, {**function.__globals__, **names}, function.__name__,
        function.__defaults__, function.__closure__,
    )  # fmt: skip


def _as_real(value: object, real: type) -> object:
    if isinstance(value, Dispatcher):
        return _compiled_anew(value)
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return real(value) if is_number else value


def _compiled_anew(compiled: Dispatcher) -> Dispatcher:
    """A compiled function, and those that it calls by name, for the kernel's kind of processor."""
    function = compiled.py_func
    known = function.__globals__
    called = {name: known[name] for name in function.__code__.co_names if name in known}
    others = {
        name: _compiled_anew(other)
        for name, other in called.items()
        if isinstance(other, Dispatcher) and other is not compiled
    }
    return njit(**compiled.targetoptions)(with_names(function, others))


def product(laws: Sequence[tuple[Law, int]], real: type, offset: int = 0) -> Law:
    """The laws' product as one function (ray, parameters) for compiled code.

    Each law comes with how many parameters it takes; from ``offset`` on they lie in the flat ones.
    """
    if not laws:

        def one(ray, parameters):
            return real(1.0)

        return register_jitable(named_for_its_code(one, [], real.__name__))
    (law, count), rest = laws[0], laws[1:]
    variant = [count for _, count in laws], real.__name__, offset
    functions = [law for law, _ in laws]
    # Symbols of compiled code from different processes can share a name: each names its code.
    head = _inlined(named_for_its_code(in_precision(law, real), functions[:1], *variant))
    end = offset + count
    tail = product(rest, real, end)

    def both(ray, parameters):
        return head(ray, *parameters[offset:end]) * tail(ray, parameters)

    return _inlined(named_for_its_code(both, functions, *variant))

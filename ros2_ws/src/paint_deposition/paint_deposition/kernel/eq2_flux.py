"""Eq. (2), the hot loop: its flux with eq. (1) summed over sub-steps and surface points.

Points come in blocks that lie together; a block out of the pattern's reach is skipped whole, and
within a block the loop over points is one SIMD loop without calls or branches. Each point's sum
runs over the sub-steps in order, so that the film does not depend on how the path was cut into
calls or on the number of threads.

``compile_kernel`` makes the loop for a set of effects: their laws are made ready for it, in its
precision, and inlined. Compiled code is kept on disk, under a name that covers the laws' code.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from types import CodeType, FunctionType
from typing import Any, NamedTuple

import numpy as np
from numba.core.dispatcher import Dispatcher
from numba.extending import register_jitable
from numba.np.unsafe.ndarray import to_fixed_tuple

from paint_deposition.kernel.blocks import LARGEST_BLOCK
from paint_deposition.kernel.compiler import named_for_its_code, njit
from paint_deposition.kernel.fast_math import exp2


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


# Columns of a sub-step's row: emission point, tool axes x and y times Omega, tool axis z, shift
# of the pattern on the model plane, dwell times relative flow times Omega^2, speed.
ORIGIN, AXIS_X, AXIS_Y, AXIS_Z, SHIFT, WEIGHT, SPEED = 0, 3, 6, 9, 12, 14, 15
STEP_COLUMNS = 16
# Constants of a brush: Omega; logarithms to base 2 of the ring's and the centre's gain; r; the
# Gaussians' log2(e) / (2 sigma^2); K3 cos and sin of phi; nearest distance along the axis; reach
# on the model plane; share stopped by shadows.
OMEGA, RING, CENTRE, RADIUS, NARROW1, NARROW2, COS, SIN, NEAREST, REACH, SHADOW = range(11)
MODEL_CONSTANTS = 11
# What the film is made of when it is kept apart, each at its gain: the even ring, what the
# asymmetry along x and y adds to it, the centred Gaussian, and the moments of both Gaussians from
# which the film's derivatives by r, sigma1 and sigma2 follow.
EVEN, BY_COS, BY_SIN, CENTRED, OUTWARD, SPREAD1, SPREAD2 = range(7)
TERMS = 7
# Sub-steps, a power of two, summed in the points' precision before they join the film.
FLUSH = 32


@njit(fastmath=True, error_model='numpy')
def within_reach(sphere, step, c):
    """Whether a block's sphere meets the cone that the pattern fills on a sub-step."""
    if step[WEIGHT] == 0:
        return False
    dx = sphere[0] - step[ORIGIN]
    dy = sphere[1] - step[ORIGIN + 1]
    dz = sphere[2] - step[ORIGIN + 2]
    along = dx * step[AXIS_Z] + dy * step[AXIS_Z + 1] + dz * step[AXIS_Z + 2]
    if along + sphere[3] < c[NEAREST]:
        return False
    x = dx * step[AXIS_X] + dy * step[AXIS_X + 1] + dz * step[AXIS_X + 2]
    y = dx * step[AXIS_Y] + dy * step[AXIS_Y + 1] + dz * step[AXIS_Y + 2]
    shift = np.sqrt(step[SHIFT] * step[SHIFT] + step[SHIFT + 1] * step[SHIFT + 1])
    # x and y are times Omega: the cone is x^2 + y^2 < (reach along)^2.
    reach, omega = c[REACH] + shift, c[OMEGA]
    limit = reach * along + np.sqrt(reach * reach + omega * omega) * sphere[3]
    return x * x + y * y < limit * limit


# What a variant is compiled with; ``compile_kernel`` puts the variant's own in their place.
real: type = np.float32
factor = scale = product([], real)
moves_pattern = shadowed = separate_terms = False
parameter_count = 0


def paint_block(
    block, p, n, seen, film, recent, terms, done, spheres, bounds, steps, first, tracing, brush,
    constants, parameters,
):  # fmt: skip
    """Paint one block; arguments as those of ``accumulate``."""
    sphere, part = spheres[block], slice(bounds[block], bounds[block + 1])
    px, py, pz = p[0, part], p[1, part], p[2, part]
    nx, ny, nz = n[0, part], n[1, part], n[2, part]
    settled, newest = film[part], recent[part]
    sums = np.zeros(TERMS * LARGEST_BLOCK if separate_terms else 0)
    one, zero, tiny = real(1.0), real(0.0), real(1e-30)
    for m in range(len(steps)):
        if (done + m) & (FLUSH - 1) == 0:
            for i in range(len(newest)):
                settled[i] += newest[i]
                newest[i] = zero
        step, c = steps[m], constants[brush[m]]
        if not within_reach(sphere, step, c):
            continue
        omega, ring, centre, r = c[OMEGA], c[RING], c[CENTRE], c[RADIUS]
        narrow1, narrow2, cos, sin = c[NARROW1], c[NARROW2], c[COS], c[SIN]
        nearest, shadow = c[NEAREST], c[SHADOW]
        ox, oy, oz = step[ORIGIN], step[ORIGIN + 1], step[ORIGIN + 2]
        xx, xy, xz = step[AXIS_X], step[AXIS_X + 1], step[AXIS_X + 2]
        yx, yy, yz = step[AXIS_Y], step[AXIS_Y + 1], step[AXIS_Y + 2]
        zx, zy, zz = step[AXIS_Z], step[AXIS_Z + 1], step[AXIS_Z + 2]
        shift_x, shift_y, speed = step[SHIFT], step[SHIFT + 1], step[SPEED]
        weight, law = step[WEIGHT], to_fixed_tuple(parameters, parameter_count)
        run = first[tracing[m], block]
        not_hidden = seen[run : run + len(px)]
        for i in range(len(px)):
            dx, dy, dz = px[i] - ox, py[i] - oy, pz[i] - oz
            along = dx * zx + dy * zy + dz * zz
            facing = -(dx * nx[i] + dy * ny[i] + dz * nz[i])
            lit = (along > nearest) & (facing > zero)
            distance = along if along > nearest else one
            nearness = one / distance
            x = (dx * xx + dy * xy + dz * xz) * nearness - shift_x
            y = (dx * yx + dy * yy + dz * yz) * nearness - shift_y
            magnification = facing * nearness * nearness * nearness
            ray_length = np.sqrt(dx * dx + dy * dy + dz * dz)
            ray = Ray(x, y, distance / omega, facing / (ray_length + tiny), speed)
            if moves_pattern:
                s = scale(ray, law)
                x, y, magnification = x * s, y * s, magnification * s * s
            rho2 = x * x + y * y + tiny
            per_rho = one / np.sqrt(rho2)
            rho = rho2 * per_rho
            f = one + (y * cos - x * sin) * per_rho
            near, far = rho - r, rho + r
            g_near, g_far = exp2(ring - narrow1 * near**2), exp2(ring - narrow1 * far**2)
            g1 = g_near + g_far
            g2 = exp2(centre - narrow2 * rho2)
            if separate_terms:
                share = weight * magnification * factor(ray, law)
                if shadowed:
                    share *= one - shadow * (one - not_hidden[i])
                share = share if lit else zero
                sums[EVEN * LARGEST_BLOCK + i] += share * g1
                sums[BY_COS * LARGEST_BLOCK + i] += share * g1 * y * per_rho
                sums[BY_SIN * LARGEST_BLOCK + i] -= share * g1 * x * per_rho
                sums[CENTRED * LARGEST_BLOCK + i] += share * g2
                inner, outer = share * f * g_near * near, share * f * g_far * far
                sums[OUTWARD * LARGEST_BLOCK + i] += inner - outer
                sums[SPREAD1 * LARGEST_BLOCK + i] += inner * near + outer * far
                sums[SPREAD2 * LARGEST_BLOCK + i] += share * g2 * rho2
            else:
                flux = (f * g1 + g2) * weight * magnification * factor(ray, law)
                if shadowed:
                    flux *= one - shadow * (one - not_hidden[i])
                newest[i] += flux if lit else zero
    if separate_terms:
        for k in range(TERMS):
            for i in range(len(px)):
                terms[k, bounds[block] + i] = sums[k * LARGEST_BLOCK + i]


def accumulate(
    first_block, last_block, p, n, seen, film, recent, terms, done, spheres, bounds, steps, first,
    tracing, brush, constants, parameters,
):  # fmt: skip
    """Add the path's film to ``film``, on the points of the blocks before ``last_block``.

    The newest contributions stay in ``recent``, in the points' precision, and move into
    ``film`` every FLUSH sub-steps of the whole path, wherever the calls were cut.

    Args:
        first_block, last_block: the blocks to paint, the second not among them.
        p, n: (3, V) points and outward normals, single or double precision, in blocks.
        seen: (N,) uint8, 1 where a point is seen, in runs of a block's points.
        film: (V,) float64 [um], updated in place.
        recent: (V,) [um], updated in place; the film is the sum of both.
        terms: (7, V) [um], written where they are kept apart, then of this path alone; film and
            recent are empty then.
        done: sub-steps of the path in earlier calls.
        spheres: (B, 4) centre and radius of each block [m].
        bounds: (B + 1,) first point of each block.
        steps: (M, 16) sub-steps, from ``layout.step_rows``.
        first: (S, B) where in ``seen`` the run of a tracing and a block begins.
        tracing: (M,) row of ``first`` for each sub-step.
        brush: (M,) row of ``constants`` for each sub-step.
        constants: (B, 11) of each brush, from ``layout.model_constants``.
        parameters: (n,) of the laws, or one unused number.
    """
    for block in range(first_block, last_block):
        paint_block(
            block, p, n, seen, film, recent, terms, done, spheres, bounds, steps, first, tracing,
            brush, constants, parameters,
        )  # fmt: skip


@lru_cache(maxsize=64)
def compile_kernel(
    flux_factors: tuple[tuple[Law, int], ...],
    pattern_scales: tuple[tuple[Law, int], ...],
    shadowed: bool,
    real: type,
    separate_terms: bool = False,
) -> Callable[..., None]:
    """The kernel with these laws inlined.

    Args:
        flux_factors, pattern_scales: each a law and how many parameters it takes; parameters are
            passed in one row for each brush, those of the flux factors first.
        shadowed: whether lines of sight count.
        real: precision of the points, np.float32 or np.float64.
        separate_terms: whether the film's terms are kept apart instead of summed.
    """
    first_scale = sum(count for _, count in flux_factors)
    names = {
        'real': real,
        'factor': product(flux_factors, real),
        'scale': product(pattern_scales, real, first_scale),
        'moves_pattern': bool(pattern_scales),
        'shadowed': shadowed,
        'separate_terms': separate_terms,
        'parameter_count': first_scale + sum(count for _, count in pattern_scales),
    }
    laws = [law for law, _ in (*flux_factors, *pattern_scales)]
    counts = [[count for _, count in group] for group in (flux_factors, pattern_scales)]
    variant = counts, shadowed, real.__name__, separate_terms
    block = named_for_its_code(with_names(paint_block, names), laws, *variant)
    # Inlined by force: else the process that compiles it runs another copy than those that find
    # it on disk, with another last bit.
    block = njit(fastmath=True, error_model='numpy', forceinline=True)(block)
    whole = with_names(accumulate, names | {'paint_block': block})
    whole = named_for_its_code(whole, laws, *variant)
    return njit(cache=True, nogil=True, fastmath=True, error_model='numpy')(whole)

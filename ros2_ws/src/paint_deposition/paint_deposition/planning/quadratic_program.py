"""The best density of paint along the path: a quadratic program, solved by Clarabel.

The film is linear in the density of paint y = flow times slowness [s/m]. The acceleration along
the path, v dv/ds = - y' f^2 / y^3, is not; |y'| <= a y^3 / f^2 is taken with its tangent at the
last solution. The right-hand side is convex, so the tangent lies below it: whatever keeps to the
tangent keeps to the limit.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import clarabel
import numpy as np
from scipy.sparse import csc_matrix, csr_matrix, diags, identity, vstack

from paint_deposition.errors import PaintError
from paint_deposition.planning.nodes import BEND, FASTEST, JOINT, LEAD, Nodes
from paint_deposition.planning.planned_film import Band
from paint_deposition.planning.requests import ImproveRequest

# As in ``nodes``.
SLOWEST, ACCELERATION, JERK = 'the least speed', 'the acceleration', 'the jerk'
FLOW = 'the range of the flow'
LIMITS = frozenset((FASTEST, BEND, LEAD, JOINT, SLOWEST, ACCELERATION, JERK, FLOW))

# Names (R,), matrix (R, size) and limits (R,) of constraints ``matrix @ x <= limit``.
Constraints = tuple[np.ndarray, csr_matrix, np.ndarray]


@dataclass(frozen=True)
class Problem:
    """What is to be minimised over densities and flows."""

    # For each model, the best known first: (n, V) film [um] for a density of 1 s/m at each node.
    films: Sequence[np.ndarray]
    target_um: float  # film wanted
    bands: Sequence[Band]  # of the points
    given_flow: np.ndarray  # (m,) of each opening in the original programme
    # Of the path.
    nodes: Nodes
    bounds: tuple[np.ndarray, np.ndarray]  # greatest speeds and their limits, see speed_bounds
    request: ImproveRequest  # of the user
    # Paint of the original programme at the mean film wanted [s at the calibrated flow].
    original_s: float
    open_ends: np.ndarray  # (n,) bool, nodes at which the gun may be closed
    left_out: frozenset[str] = frozenset()  # names of limits that are left out

    def films_um(self, density: np.ndarray) -> list[np.ndarray]:
        """(V,) film of each model for a density of paint (n,) [um]."""
        return [density @ films for films in self.films]

    def relaxed(self) -> 'Problem':
        """Without weights and limits, except that on the flow: for evenness alone."""
        weights = dict.fromkeys(('paint_weight', 'time_weight', 'smoothness'), 0.0)
        return replace(
            self,
            request=self.request.model_copy(update=weights),
            bands=(),
            open_ends=np.ones(len(self.nodes), dtype=bool),
            left_out=LIMITS - {FLOW},
        )


def solve(
    problem: Problem, density: np.ndarray, flow: np.ndarray, rounds: int = 8
) -> tuple[np.ndarray, np.ndarray, tuple[str, ...]]:
    """Minimise in ``rounds`` at most; the first tangents are taken at the start.

    Start and solution are a density of paint (n,) [s/m] and the flow of each opening (m,); the
    names of the limits that bind come last.

    Raises:
        PaintError: the limits contradict each other; names one of them.
    """
    count, binding = len(problem.nodes), ()
    least, most = problem.request.flow
    for _ in range(rounds):
        constraints = names, rows, limit = _constraints(problem, density, flow)
        matrix, linear = _objective(problem, density, flow)
        answer = _minimise(matrix, linear, constraints)
        if answer is None:
            contradicting = 'the limits'
            for name in dict.fromkeys(names.tolist()):
                others = names != name
                without = names[others], rows[others], limit[others]
                if name in LIMITS and _minimise(matrix, linear, without) is not None:
                    contradicting = f'{name} with the other limits'
                    break
            raise PaintError(f'no motion along this path keeps {contradicting}; allow more')
        values, multipliers = answer
        # A multiplier times a density is what its limit costs, in the units of the objective. A
        # constraint that costs more than this, in units of sigma_n squared, binds.
        costly = names[multipliers * float(values[:count].mean()) > 1e-6]
        flow, limits = values[count:], LIMITS
        if least >= most:
            flow, limits = problem.given_flow, LIMITS - {FLOW}
        binding = tuple(name for name in dict.fromkeys(costly.tolist()) if name in limits)
        before, density = density, np.maximum(values[:count], 0.0)
        if np.abs(density - before).max() / np.abs(density).max() < 3e-3:
            break
    return density, flow, binding


def _objective(
    problem: Problem, density: np.ndarray, flow: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Matrix and vector of x'Mx / 2 + v'x: evenness, hinges, paint, time, smoothness, flows."""
    nodes, request, count = problem.nodes, problem.request, len(problem.nodes)
    # The unknowns are densities, and a flow for each opening.
    size = count + len(flow)
    matrix, linear = np.zeros((size, size)), np.zeros(size)
    share = 2.0 / (len(problem.films) * problem.films[0].shape[1])
    # The mean of the best known film is held at the target by this weight. The levels of the
    # other models are free: holding them too would cost evenness.
    weight, level = 30.0, problem.films[0].mean(axis=1) / problem.target_um
    matrix[:count, :count] += 2.0 * weight * np.outer(level, level)
    linear[:count] -= 2.0 * weight * level
    for films in problem.films:
        scaled = films / problem.target_um
        error = density @ films / problem.target_um - 1.0
        uneven = scaled - scaled.mean(axis=1, keepdims=True)
        matrix[:count, :count] += share * uneven @ uneven.T
        for beyond, edge, weight in _hinges(problem, error):
            some = scaled[:, beyond]
            matrix[:count, :count] += share * weight * some @ some.T
            linear[:count] -= share * weight * (1.0 + edge) * some.sum(axis=1)
    # Length that each node stands for: slowness times this sums to the time [m].
    pairs = nodes.followed
    steps_m = nodes.travel_m[pairs + 1] - nodes.travel_m[pairs]
    weights = np.zeros(count)
    np.add.at(weights, pairs, 0.5 * steps_m)
    np.add.at(weights, pairs + 1, 0.5 * steps_m)
    linear[:count] += request.paint_weight * weights / problem.original_s
    at_nodes = flow[nodes.opening]
    linear[:count] += request.time_weight * weights / (at_nodes * problem.original_s)
    seconds = np.bincount(nodes.opening, weights * density / at_nodes, len(flow))
    linear[count:] -= request.time_weight * seconds / (flow * problem.original_s)
    mean = float(weights @ density / weights.sum())
    unit = np.eye(size)
    slope = (unit[pairs + 1] - unit[pairs]) / mean
    # Smoothness is that of slowness over this length [m].
    slope *= (0.1 / steps_m)[:, np.newaxis]
    matrix += 2.0 * request.smoothness / len(pairs) * slope.T @ slope
    # Keeps the problem definite where no film says more, and flows where they are.
    matrix[np.diag_indices(count)] += 1e-9 * matrix.max()
    matrix[np.arange(count, size), np.arange(count, size)] += 1e-4
    linear[count:] -= 1e-4 * flow
    return matrix, linear


def _hinges(problem: Problem, error: np.ndarray) -> list[tuple[np.ndarray, float, float]]:
    """Points beyond an edge of the film / target - 1, that edge, and what they count more."""
    request, found = problem.request, []
    for points, target, off in problem.bands:
        sides = [(1.0, off, 3.0), (-1.0, -off, 3.0)] if off is not None else []
        # The film's bounds are kept where possible.
        for side, bound_um in ((-1.0, request.film_min_um), (1.0, request.film_max_um)):
            if bound_um is not None:
                sides.append((side, bound_um / target - 1.0, 100.0))
        for side, edge, weight in sides:
            beyond = points & (side * (error - edge) > 0.0)
            if beyond.any():
                found.append((beyond, edge, weight))
    return found


def _constraints(problem: Problem, density: np.ndarray, flow: np.ndarray) -> Constraints:
    slowness = density / flow[problem.nodes.opening]
    nodes, limits, count = problem.nodes, problem.request, len(problem.nodes)
    unit = identity(count + len(flow), format='csr')
    # At each node: the density, and the flow of its opening.
    y, f, closable = unit[:count], unit[count + nodes.opening], problem.open_ends
    greatest, limited_by = problem.bounds
    none = np.zeros(1)
    least = np.minimum(limits.speed_min_m_per_s, 0.999 * greatest)
    rows: list[tuple[str, csr_matrix, np.ndarray]] = [
        (SLOWEST, y - diags(1.0 / least) @ f, none),
        ('positive', -y[closable], none),
    ]
    for name in (FASTEST, BEND, LEAD, JOINT):  # y >= f / v
        some = np.flatnonzero((limited_by == name) & ~closable)
        rows.append((name, diags(1.0 / greatest[some]) @ f[some] - y[some], none))
    # Nodes from which the gun sprays on to the next one for certain.
    pairs = nodes.followed
    pairs = pairs[~closable[pairs] & ~closable[pairs + 1]]
    reach = limits.acceleration_m_per_s2 * (nodes.travel_m[pairs + 1] - nodes.travel_m[pairs])
    rise = y[pairs + 1] - y[pairs]
    for node in (pairs, pairs + 1):
        # y^3 / f^2 about (y0, f0) is 3 (y0/f0)^2 y - 2 (y0/f0)^3 f.
        ratio = slowness[node]
        most = diags(3.0 * reach * ratio**2) @ y[node] - diags(2.0 * reach * ratio**3) @ f[pairs]
        rows += [(ACCELERATION, rise - most, none), (ACCELERATION, -rise - most, none)]
    # y^4 / f^3, for the change of slowness by the jerk alone.
    inner = pairs[:-1][np.diff(pairs) == 1] + 1
    reach = (
        limits.jerk_m_per_s3 * (0.5 * (nodes.travel_m[inner + 1] - nodes.travel_m[inner - 1])) ** 2
    )
    ratio = slowness[inner]
    bend = y[inner + 1] - 2.0 * y[inner] + y[inner - 1]
    most = diags(4.0 * reach * ratio**3) @ y[inner] - diags(3.0 * reach * ratio**4) @ f[inner]
    rows += [(JERK, bend - most, none), (JERK, -bend - most, none)]
    rows.append((FLOW, unit[count:], limits.flow[1] * problem.given_flow))
    rows.append((FLOW, -unit[count:], -limits.flow[0] * problem.given_flow))
    names, matrices, ends = zip(
        *(row for row in rows if row[1].shape[0] and row[0] not in problem.left_out), strict=True
    )
    counts = [matrix.shape[0] for matrix in matrices]
    limit = [np.broadcast_to(end, n) for end, n in zip(ends, counts, strict=True)]
    return np.repeat(names, counts), vstack(matrices, format='csr'), np.concatenate(limit)


def _minimise(
    matrix: np.ndarray, linear: np.ndarray, constraints: Constraints
) -> tuple[np.ndarray, np.ndarray] | None:
    """The solution and the multipliers of all constraints, or None if infeasible."""
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    _, rows, limit = constraints
    solver = clarabel.DefaultSolver(
        csc_matrix(np.triu(matrix)), linear, csc_matrix(rows), limit,
        [clarabel.NonnegativeConeT(len(limit))], settings,
    )  # fmt: skip
    answer = solver.solve()
    if answer.status not in (clarabel.SolverStatus.Solved, clarabel.SolverStatus.AlmostSolved):
        return None
    return np.array(answer.x), np.array(answer.z)

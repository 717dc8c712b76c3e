"""Evidence of sets of explanations, and the search for the best ones.

The directions of each explanation are orthogonal to each other, so that the widest one of a set
costs next to nothing and only the others' products are factorised.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import njit

from paint_deposition.inference.diagnosis.evidence import KNOWN_NOISE, Principal, log_bayes_factor

# Log prior share of an explanation that contradicts physics.
NEVER = -1e6


class Directions(NamedTuple):
    """The directions of all explanations, whitened, those of each orthogonal to each other.

    Attributes:
        gram: (N, N) their products. scores: (N,) products with the deviations.
        square: of the deviations' length.
        start: (K + 1,) first direction of each explanation, and N.
        signed: (q, N) sums of each explanation's amplitudes whose sign is known.
        sides: (K, q) that sign, +1 or -1; 0 where an explanation has fewer.
        freedom: degrees of freedom of the noise estimate. readings: how many.
    """

    gram: np.ndarray
    scores: np.ndarray
    square: float
    start: np.ndarray
    signed: np.ndarray
    sides: np.ndarray
    freedom: float
    readings: int

    @staticmethod
    def of(
        explanations: Sequence[Principal], deviation: np.ndarray, freedom: float
    ) -> 'Directions':
        """From the directions of each explanation and the whitened deviations (P,)."""
        together = np.hstack([e.columns for e in explanations])
        start = np.cumsum([0, *(e.columns.shape[1] for e in explanations)])
        signed = np.zeros((max(len(e.sides) for e in explanations), start[-1]))
        sides = np.zeros((len(explanations), len(signed)))
        for k, explanation in enumerate(explanations):
            known = len(explanation.sides)
            signed[:known, start[k] : start[k + 1]] = explanation.signed
            sides[k, :known] = explanation.sides
        return Directions(
            together.T @ together, together.T @ deviation, float(deviation @ deviation), start,
            signed, sides, min(freedom, 2.0 * KNOWN_NOISE), len(deviation),
        )  # fmt: skip

    def amplitudes(self, chosen: Sequence[int], sizes: Sequence[float]) -> list[np.ndarray]:
        """Posterior means of the amplitudes along chosen explanations together, of each."""
        widths = np.diff(self.start)[list(chosen)]
        rows = np.concatenate([np.arange(*self.start[k : k + 2]) for k in chosen])
        scale = np.repeat(np.asarray(sizes, dtype=float), widths)
        precision = np.eye(len(rows)) + self.gram[np.ix_(rows, rows)] * np.outer(scale, scale)
        mean = scale * np.linalg.solve(precision, scale * self.scores[rows])
        return np.split(mean, np.cumsum(widths)[:-1])


@njit(cache=True, nogil=True)
def log_evidence(directions, chosen, sizes):
    """(S,) log Bayes factors of chosen explanations (c,) together, at S sets of sizes (S, c)."""
    start, gram = directions.start, directions.gram
    # The widest comes first: its directions are orthogonal, so that they cost least.
    widths = start[chosen + 1] - start[chosen]
    order = np.argsort(-widths)
    orthogonal, n = widths[order[0]], widths.sum()
    rows, member = np.empty(n, np.int64), np.empty(n, np.int64)
    most = len(chosen) * directions.sides.shape[1]
    signed, sides = np.zeros((most, n)), np.empty(most)
    at = known = 0
    for m in order:
        k, width = chosen[m], widths[m]
        rows[at : at + width] = np.arange(start[k], start[k + 1])
        member[at : at + width] = m
        for q in range(directions.sides.shape[1]):
            if directions.sides[k, q] != 0.0:
                signed[known, at : at + width] = directions.signed[q, start[k] : start[k + 1]]
                sides[known] = directions.sides[k, q]
                known += 1
        at += width
    products = np.empty((n, n))
    for i in range(n):
        products[i, i] = gram[rows[i], rows[i]]
        for j in range(i if i >= orthogonal else 0):
            products[i, j] = gram[rows[i], rows[j]]
    scores, found = directions.scores[rows], np.empty(len(sizes))
    for s in range(len(sizes)):
        found[s] = log_bayes_factor(
            products, scores, directions.square, signed[:known], sides[:known], sizes[s][member],
            directions.freedom, directions.readings, orthogonal,
        )  # fmt: skip
    return found


@njit(cache=True, nogil=True)
def log_evidence_of_each(directions, chosen, sizes):
    """(M,) log Bayes factors of M sets of chosen explanations (M, c), of sizes (M, c)."""
    found = np.empty(len(chosen))
    for m in range(len(chosen)):
        found[m] = log_evidence(directions, chosen[m], sizes[m : m + 1])[0]
    return found


@njit(cache=True, nogil=True)
def refine(directions, log_share, first, last, all_sizes, chosen, sizes, sweeps):
    """Choose the best explanation and size of one cause after the other, in place.

    Until none of them changes any more, but a number of times each at the most.

    Args:
        directions: of all explanations.
        log_share: (K, S) log prior share of each at every size.
        first, last: (c,) numbers of the explanations, from and up to, of each cause.
        all_sizes: (S,) of amplitudes.
        chosen, sizes: (c,) what to start from, and what is found.
        sweeps: how many times.
    """
    best, unchanged = -np.inf, 0
    for step in range(sweeps * len(chosen)):
        member = step % len(chosen)
        kept, kept_size = chosen[member], sizes[member]
        unchanged += 1
        tried = np.empty((len(all_sizes), len(chosen)))
        tried[:] = sizes
        tried[:, member] = all_sizes
        for k in range(first[member], last[member]):
            chosen[member] = k
            values = log_evidence(directions, chosen, tried)
            for other in chosen:
                values += log_share[other].max()
            for s, size in enumerate(all_sizes):
                if log_share[k, s] > NEVER and values[s] > best:
                    best = values[s]
                    if k != kept or size != kept_size:
                        kept, kept_size, unchanged = k, size, 0
        chosen[member], sizes[member] = kept, kept_size
        if unchanged >= len(chosen) - 1 and step >= len(chosen) - 1:
            break

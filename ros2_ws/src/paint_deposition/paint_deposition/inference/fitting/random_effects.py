"""Random effects: differences between parts and gauge sessions that have no cause of interest.

They are independent for every part and session. Only differences count: what all have in common
is for K1 and the effects to explain. Parts and sessions of which no reading is used have none: the
model predicts them at the centre of their prior, as it predicts a part that is still unpainted. A
part that was painted with something switched off has a level of its own, independent of the
others. Smooth random fields over parts and covariates are given by roots of their covariances.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.distance import cdist

from paint_deposition.inference.readings.campaign import Campaign

# Parts painted alike differ in their mean film by about this share: 4 % was found for clearcoat
# on 40 panels, the gauge and the booth's day included.
LEVEL_SHARE = 0.03
# Without voltage, or without the booth's air, another share of the paint arrives.
OTHER_LEVEL_SHARE = 0.3
# The gauge's zero shifts by about this much from session to session and from operator to operator;
# 0.3 to 1 um are usual [um].
SESSION_UM = 0.7


@dataclass(frozen=True)
class RandomEffects:
    """Random effects of one kind."""

    kind: str  # 'part level', or 'gauge zero'
    unit: str  # of their amounts
    names: tuple[str, ...]
    mixing: np.ndarray  # (n, n) amounts in the unit for amplitudes of unit variance
    columns: np.ndarray  # (P, n) directions over the noise, for amplitudes of unit variance


@dataclass(frozen=True)
class Amount:
    """The estimate of one random effect."""

    # Which, and of what part or session.
    kind: str
    of: str
    # Posterior mean and standard deviation.
    value: float
    sd: float
    unit: str  # of both

    @property
    def is_notable(self) -> bool:
        """Whether it differs from zero by more than chance would have it."""
        return abs(self.value) > 2.0 * self.sd

    def __str__(self) -> str:
        return f'{self.kind} of {self.of}: {self.value:+.2f} ± {self.sd:.2f} {self.unit}'


def random_effects(
    campaign: Campaign, measured_um: np.ndarray, sigma_um: np.ndarray, used: np.ndarray
) -> tuple[RandomEffects, ...]:
    """A film level per part and a gauge zero per session, where there are several.

    Args:
        campaign: whose readings name their session; those of a part that do not are a session
            of their own.
        measured_um, sigma_um: (P,) the points and their standard deviations [um].
        used: (P,) bool, the points that the model is fitted to.
    """
    names = tuple(experiment.name for experiment in campaign.experiments)
    part_of, off = _parts(campaign)
    known = part_of[used].any(axis=0)
    mixing = np.diag(OTHER_LEVEL_SHARE * (off & known)) + LEVEL_SHARE * _contrasts(known & ~off)
    level = RandomEffects(
        'part level', '%', names, 100.0 * mixing,
        part_of @ mixing * (measured_um / sigma_um)[:, np.newaxis],
    )  # fmt: skip
    readings = campaign.readings
    sessions = tuple(dict.fromkeys(readings.session.tolist()))
    # Repeats at one point may belong to several sessions.
    shares = np.column_stack([
        np.bincount(readings.owner, readings.session == session) / readings.repeats
        for session in sessions
    ])  # fmt: skip
    zeros = SESSION_UM * _contrasts(shares[used].any(axis=0))
    zero = RandomEffects(
        'gauge zero', 'µm', sessions, zeros, shares @ zeros / sigma_um[:, np.newaxis]
    )
    return tuple(effects for effects in (level, zero) if effects.mixing.any())


def levels_untold(
    campaign: Campaign, film_um: np.ndarray, sigma_um: np.ndarray, used: np.ndarray
) -> np.ndarray:
    """(P, n) directions of the levels of parts with something off that no reading used (P,) tells.

    Of a film (P,) that may be off by more than a little, unlike the one that was measured.
    """
    part_of, off = _parts(campaign)
    untold = off & ~part_of[used].any(axis=0)
    return OTHER_LEVEL_SHARE * part_of[:, untold] * (film_um / sigma_um)[:, np.newaxis]


def _parts(campaign: Campaign) -> tuple[np.ndarray, np.ndarray]:
    """(P, E) which part a point is on, and (E,) which were painted with something off."""
    off = np.array([bool(experiment.switched_off) for experiment in campaign.experiments])
    return campaign.experiment_of[:, np.newaxis] == np.arange(len(off)), off


def amounts(
    mean: np.ndarray, covariance: np.ndarray, effects: tuple[RandomEffects, ...]
) -> tuple[Amount, ...]:
    """Estimates of the random effects.

    Args:
        mean, covariance: (n,) and (n, n) of the amplitudes of nuisance directions, the first of
            which are those of the random effects; see ``Fit.amplitudes``.
    """
    found, first = [], 0
    for kind in effects:
        count = len(kind.names)
        rows = slice(first, first + count)
        values = kind.mixing @ mean[rows]
        deviations = np.sqrt(np.diag(kind.mixing @ covariance[rows, rows] @ kind.mixing.T))
        for name, value, sd in zip(kind.names, values, deviations, strict=True):
            found.append(Amount(kind.kind, name, float(value), float(sd), kind.unit))
        first += count
    return tuple(found)


def _contrasts(known: np.ndarray) -> np.ndarray:
    """(n, n) amounts without what all those of n that are known (n,) have in common."""
    return np.diag(1.0 * known) - np.outer(known, known) / max(np.count_nonzero(known), 1)


Correlation = Callable[[ArrayLike], np.ndarray]


def smooth(away: ArrayLike) -> np.ndarray:
    """Correlation at a distance over its length: that of a field without any edge."""
    return np.exp(-0.5 * np.square(away))


def with_edges(away: ArrayLike) -> np.ndarray:
    """Correlation of a field that may bend sharply: Matérn's with smoothness 3/2."""
    scaled = np.sqrt(3.0) * np.asarray(away)
    return (1.0 + scaled) * np.exp(-scaled)


def root_of_field(
    places: np.ndarray, length: float, negligible: float, correlation: Correlation = smooth
) -> np.ndarray:
    """(N, n) square root of the covariance of a field of unit variance; not to be changed.

    Args:
        places: (N,) or (N, D) where its values are.
        negligible: directions below this share of the largest variance are left out.
        correlation: at a distance over the length.
    """
    places = np.ascontiguousarray(places, dtype=float).reshape(len(places), -1)
    return _root(places.tobytes(), places.shape, length, negligible, correlation)


# While models change, most places and lengths stay.
@lru_cache(128)
def _root(
    places: bytes, shape: tuple[int, int], length: float, negligible: float,
    correlation: Correlation,
) -> np.ndarray:  # fmt: skip
    at = np.frombuffer(places).reshape(shape)
    values, vectors = np.linalg.eigh(correlation(cdist(at, at) / length))
    kept = values > negligible * values[-1]
    root = vectors[:, kept] * np.sqrt(values[kept])
    root.flags.writeable = False
    return root

"""Gauge readings of a painted part, and their residuals beside a prediction."""

import hashlib
from collections.abc import Mapping, Sized
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtrc

from paint_deposition.errors import ReadingsError
from paint_deposition.film.statistics import DEFAULT_PAINTED_ABOVE_UM


@dataclass(frozen=True)
class Readings:
    """Readings as taken; several may share a point.

    Attributes:
        positions_m: (N, 3) in the mesh frame [m].
        thickness_um: (N,) [um].
        point: (N,) labels; readings with one label were taken at one point.
        group: (N,) labels of the column or row; '' where none.
        sigma_um: (N,) standard deviation of one reading [um], nan where not stated.
        normals: (N, 3) outward normals, or None.
        source: the file they came from, for messages.
        session: (N,) labels of the gauge session; '' where none.
        layer: (N,) names of the coats that are read, as in 'base+clear'; '' is all of them.
        understood: how their file was read, in one line for the user; '' for none.
        zero_is_film: whether the user says that a reading of 0 is one.
        unit_is_guessed: whether nobody said what the unit of the positions is.
        doubts: what in their file may be no reading, for the user.
        heading: what their file calls the film.
    """

    positions_m: np.ndarray
    thickness_um: np.ndarray
    point: np.ndarray
    group: np.ndarray
    sigma_um: np.ndarray
    normals: np.ndarray | None = None
    source: str = 'readings'
    session: np.ndarray = field(default_factory=lambda: np.array(''))
    understood: str = ''
    zero_is_film: bool = False
    unit_is_guessed: bool = False
    doubts: tuple[str, ...] = ()
    layer: np.ndarray = field(default_factory=lambda: np.array(''))
    heading: str = 'thickness_um'

    def __post_init__(self) -> None:
        for name in ('session', 'layer'):
            labels = np.broadcast_to(getattr(self, name), len(self.thickness_um))
            object.__setattr__(self, name, labels)

    def __repr__(self) -> str:
        return f'Readings({len(self)} from {self.source}, mean {self.thickness_um.mean():.1f} µm)'

    def __len__(self) -> int:
        return len(self.thickness_um)

    @staticmethod
    def of(positions_m: ArrayLike, thickness_um: Sized, **columns: Any) -> 'Readings':
        """Readings with defaults for the columns not given: every one a point of its own."""
        count = len(thickness_um)
        defaults = {'point': np.array([f'{k + 1}' for k in range(count)]),
                    'group': np.full(count, ''), 'sigma_um': np.full(count, np.nan)}  # fmt: skip
        positions, film = (np.asarray(each, dtype=float) for each in (positions_m, thickness_um))
        return Readings(positions, film, **(defaults | columns))

    @staticmethod
    def joined(parts: Mapping[str, 'Readings']) -> 'Readings':
        """Readings of named parts, one part after the other; labels of points name the part.

        So does the session where a part's readings have none. The normals are left out.
        """
        columns = ('positions_m', 'thickness_um', 'group', 'sigma_um')
        sessions = [np.where(part.session == '', n, part.session) for n, part in parts.items()]
        return Readings(
            point=np.array([f'{name}: {p}' for name, part in parts.items() for p in part.point]),
            source=', '.join(part.source for part in parts.values()),
            session=np.concatenate(sessions),
            **{c: np.concatenate([getattr(p, c) for p in parts.values()]) for c in columns},
        )

    def select(self, rows: np.ndarray | slice) -> 'Readings':
        """The chosen rows, by mask or indices."""
        names = (
            'positions_m', 'thickness_um', 'point', 'group', 'sigma_um', 'normals', 'session',
            'layer',
        )  # fmt: skip
        columns = {n: getattr(self, n) for n in names}
        some: dict[str, Any] = {n: c if c is None else c[rows] for n, c in columns.items()}
        return replace(self, **some)

    @cached_property
    def owner(self) -> np.ndarray:
        """(N,) point of each reading, one of P; they are in order of first appearance."""
        _, first, owner = np.unique(self.point, return_index=True, return_inverse=True)
        return np.argsort(np.argsort(first))[owner]

    @cached_property
    def first(self) -> np.ndarray:
        """(P,) row of each point's first reading."""
        return np.unique(self.owner, return_index=True)[1]

    @cached_property
    def repeats(self) -> np.ndarray:
        """(P,) number of readings at each point."""
        return np.bincount(self.owner)

    @cached_property
    def mean_um(self) -> np.ndarray:
        """(P,) readings averaged over their repeats [um]."""
        return np.bincount(self.owner, self.thickness_um) / self.repeats

    @property
    def fingerprint(self) -> str:
        """Twelve hexadecimal digits that identify these readings."""
        table = np.column_stack([self.positions_m, self.thickness_um])
        return hashlib.sha256(np.ascontiguousarray(table).tobytes()).hexdigest()[:12]


def require_repeats_close(readings: Readings) -> None:
    """Refuse a point label that is used at two places.

    Raises:
        ReadingsError: naming the label and the distance.
    """
    first = readings.first[readings.owner]
    apart = np.linalg.norm(readings.positions_m - readings.positions_m[first], axis=1)
    worst = int(np.argmax(apart)) if len(apart) else 0
    # Repeats further apart were not taken at one point [m].
    if len(apart) and apart[worst] > 0.03:
        raise ReadingsError(
            f"{readings.source}: point '{readings.point[worst]}' is used {apart[worst]:.3f} m "
            'apart; give each place a label of its own'
        )


def root_mean_square(values: np.ndarray) -> float:
    """Root mean square of some values, 0 if there are none."""
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0


def beyond_noise_um(rmse_um: float, noise_um: float) -> float:
    """What an error is without the noise in it [um], 0 if that explains all of it."""
    return float(np.sqrt(max(rmse_um**2 - noise_um**2, 0.0)))


@dataclass(frozen=True)
class Residuals:
    """Measured and predicted film; residual = measured minus predicted."""

    # (N,) films [um].
    measured_um: np.ndarray
    predicted_um: np.ndarray
    sigma_um: np.ndarray  # (N,) standard deviations of the measurements [um]

    def __len__(self) -> int:
        return len(self.measured_um)

    def select(self, rows: np.ndarray | slice) -> 'Residuals':
        """The chosen rows, by mask or indices."""
        return Residuals(self.measured_um[rows], self.predicted_um[rows], self.sigma_um[rows])

    @property
    def residual_um(self) -> np.ndarray:
        """(N,) measured minus predicted [um]."""
        return self.measured_um - self.predicted_um

    @property
    def bias_um(self) -> float:
        """Mean residual [um]."""
        return float(self.residual_um.mean())

    @property
    def rmse_um(self) -> float:
        """Root mean square residual [um]."""
        return root_mean_square(self.residual_um)

    @property
    def painted(self) -> np.ndarray:
        """(N,) whether the model predicts paint there."""
        return self.predicted_um > DEFAULT_PAINTED_ABOVE_UM

    @property
    def sd_um(self) -> float:
        """Sample standard deviation of the residuals, with N - 1 [um]; 0 for a single one."""
        return float(self.residual_um.std(ddof=1)) if len(self) > 1 else 0.0

    @property
    def chi_square(self) -> float:
        """Sum of squared residuals, each over its standard deviation."""
        whitened = self.residual_um / self.sigma_um
        return float(whitened @ whitened)

    @property
    def chi_square_per_reading(self) -> float:
        """About 1 where only the gauge's noise is left."""
        return self.chi_square / len(self)

    @property
    def p_value(self) -> float:
        """Probability that noise alone gives at least this chi-square."""
        return float(chdtrc(len(self), self.chi_square))

    @property
    def worst(self) -> int:
        """Row of the residual that is largest in magnitude."""
        return int(np.argmax(np.abs(self.residual_um)))

    def figures(self) -> dict[str, Any]:
        """The statistics as results name them."""
        return {
            'readings': len(self),
            'bias_um': self.bias_um,
            'rmse_um': self.rmse_um,
            'std_um': self.sd_um,
            'chi_square_per_reading': self.chi_square_per_reading,
            'p_value': self.p_value,
        }


def is_worse(before: Residuals, after: Residuals) -> bool:
    """Whether a model is further off the same readings by more than their noise explains."""
    noise_um = root_mean_square(before.sigma_um)
    return after.rmse_um > before.rmse_um + noise_um * np.sqrt(2.0 / len(before))

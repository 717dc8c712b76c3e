"""Gauge readings of a painted part."""

import hashlib
from collections.abc import Mapping, Sized
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from paint_deposition.errors import ReadingsError


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

    @property
    def fingerprint(self) -> str:
        """Twelve hexadecimal digits that identify these readings."""
        table = np.column_stack([self.positions_m, self.thickness_um])
        return hashlib.sha256(np.ascontiguousarray(table).tobytes()).hexdigest()[:12]


@dataclass(frozen=True)
class PointMeans:
    """Readings averaged over their repeats: one row a point, in order of first appearance."""

    first: np.ndarray  # (P,) row of the point's first reading
    repeats: np.ndarray  # (P,) number of readings
    mean_um: np.ndarray  # (P,) [um]
    owner: np.ndarray  # (N,) point of each reading

    @staticmethod
    def of(readings: Readings) -> 'PointMeans':
        """Average readings that share a point."""
        _, first, owner = np.unique(readings.point, return_index=True, return_inverse=True)
        order = np.argsort(first)
        rank = np.empty_like(order)
        rank[order] = np.arange(len(order))
        owner = rank[owner]
        repeats = np.bincount(owner)
        mean = np.bincount(owner, readings.thickness_um) / repeats
        return PointMeans(first[order], repeats, mean, owner)


# Repeats further apart than this were not taken at one point [m].
SAME_POINT_M = 0.03


def require_repeats_close(readings: Readings) -> None:
    """Refuse a point label that is used at two places.

    Raises:
        ReadingsError: naming the label and the distance.
    """
    means = PointMeans.of(readings)
    apart = np.linalg.norm(
        readings.positions_m - readings.positions_m[means.first][means.owner], axis=1
    )
    worst = int(np.argmax(apart)) if len(apart) else 0
    if len(apart) and apart[worst] > SAME_POINT_M:
        raise ReadingsError(
            f"{readings.source}: point '{readings.point[worst]}' is used {apart[worst]:.3f} m "
            'apart; give each place a label of its own'
        )

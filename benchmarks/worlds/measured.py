"""What was measured: footprints and repeats of real sprays, levels of panels, scatter of a gauge.

The tables lie beside the repository, see ``available``.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

DATA = Path(__file__).resolve().parents[3] / 'shared' / 'data'
Curve = tuple[np.ndarray, np.ndarray]


def available() -> bool:
    """Whether the measured tables are there."""
    return (DATA / 'patternator_two_nozzles.csv').is_file()


@dataclass(frozen=True)
class Measured:
    """Shapes and repeats; offsets in half widths at half height, films in their peak."""

    fans: tuple[Curve, ...]
    track: Curve
    ring: Curve
    remainders: tuple[Curve, ...]
    levels: np.ndarray
    gauge_um: np.ndarray


@cache
def measured() -> Measured:
    rows = _table('patternator_two_nozzles')
    fans, remainders = [], []
    for nozzle, height in dict.fromkeys(zip(rows['nozzle'], rows['boom_height_in'], strict=True)):
        of_spray = rows[(rows['nozzle'] == nozzle) & (rows['boom_height_in'] == height)]
        count = len(np.unique(of_spray['repetition']))
        films = np.array(of_spray['collected_ml']).reshape(count, -1)
        mean = films.mean(axis=0)
        offset = np.arange(len(mean)) - np.average(np.arange(len(mean)), weights=mean)
        offset /= 0.5 * np.count_nonzero(mean > 0.5 * mean.max())
        fans.append((offset, mean / mean.max()))
        level = films @ mean / (mean @ mean)
        rest = (films - level[:, None] * mean) * np.sqrt(count / (count - 1.0)) / mean.max()
        remainders += [(offset, one) for one in rest]
    track = _table('travelling_gun_transect_1d_collapse')
    ring = _table('magnetron_static_radial_130mm')
    panels = _table('clearcoat_40_panels_um')['thickness_um']
    varnish = _table('varnish_dft_operator_gate_day_mils')['thickness'].reshape(-1, 2)
    film = ring['thickness_arb_likely_nm']
    return Measured(
        tuple(fans),
        (track['station_ft'] / 90.0, track['depth_in'] / track['depth_in'].max()),
        (ring['r_from_centre_mm'] / 115.0, film / film.max()),
        tuple(remainders),
        panels / panels.mean() - 1.0,
        25.4 * (varnish[:, 0] - varnish[:, 1]) / np.sqrt(2.0),
    )


def _table(name: str) -> np.ndarray:
    """Columns by the names of the table's head."""
    return np.genfromtxt(DATA / f'{name}.csv', delimiter=',', names=True, dtype=None,
                         encoding='utf8')  # fmt: skip

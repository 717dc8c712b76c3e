"""Campaigns rebuilt from real sprays: what one nozzle laid into one-inch troughs at three heights.

The table (``patternator_two_nozzles.csv``) is never shipped. Its lengths are scaled by 1:4, its
volumes so that the highest reading of each nozzle is 30 um. Each spray is one straight pass across
a panel, the TCP at the nozzle's mouth; the troughs are readings in one line across the pass. What
eq. (2) lacks is known: the width grows as the height to a power below 1, and the volume stays.
"""

from __future__ import annotations

import csv
from collections import defaultdict
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np
import yaml
from benchmarks.worlds.record import Part
from scipy.spatial.transform import Rotation

NOZZLES = ('E8003', 'PSERQ8004')
HEIGHTS_IN = (20, 30, 40)
SCALE_M_PER_IN = 0.0254 / 4.0
PEAK_UM = 30.0
PANEL_M = (0.5, 0.8)  # along the pass, across it
SPEED_M_PER_S, POSE_EVERY_S, RUN_M = 0.2, 0.05, 1.5
# How the panel hangs, as columns of the way of the pass, of the troughs, and off the panel.
HANGING = {
    'column': np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
    'row': np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]),
    'lying': np.eye(3),
}

Spray = tuple[int, int]  # height in inches, repetition


@cache
def sprays(table: Path, nozzle: str) -> dict[Spray, np.ndarray]:
    """(troughs, 2) offset across the pass [m] and film [um] of each spray of a nozzle."""
    found = defaultdict(list)
    with table.open(newline='') as file:
        for row in csv.DictReader(file):
            if row['nozzle'] == nozzle:
                spray = int(row['boom_height_in']), int(row['repetition'])
                found[spray].append((float(row['trough_in']), float(row['collected_ml'])))
    peak = max(ml for rows in found.values() for _, ml in rows)
    factors = (SCALE_M_PER_IN, PEAK_UM / peak)
    return {spray: np.array(rows) * factors for spray, rows in found.items()}


def spray_campaign(
    table: Path,
    nozzle: str,
    folder: Path,
    *,
    heights_in: Sequence[int] = HEIGHTS_IN,
    as_repeats: bool = False,
    hanging: str = 'column',
    told_times: float = 1.0,
    told_off_m: float = 0.0,
) -> Path:
    """Write the campaign of a nozzle into an empty folder and return its ``campaign.yaml``.

    Args:
        table, nozzle, folder, heights_in: what of the table is written where.
        as_repeats: the sprays of one height are repeats on one panel (an experiment for each
            height) instead of panels of their own (an experiment for each spray).
        hanging: 'column' and 'row' for the line of readings on an upright panel, 'lying' for one
            that looks up.
        told_times, told_off_m: the recorded poses have the true standoff so many times, and so
            much beside it [m].
    """
    chosen = {s: rows for s, rows in sprays(table, nozzle).items() if s[0] in heights_in}
    parts: dict[str, list[Spray]] = defaultdict(list)
    for height, repetition in chosen:
        name = f'height_{height}' + ('' if as_repeats else f'_spray_{repetition}')
        parts[name].append((height, repetition))
    folder.mkdir(parents=True, exist_ok=True)
    frame = HANGING[hanging]

    def told_m(height_in: float) -> float:
        return told_times * height_in * SCALE_M_PER_IN + told_off_m

    along, across = 0.5 * PANEL_M[0], 0.5 * PANEL_M[1]
    corners = np.array(
        [[-along, -across, 0], [along, -across, 0], [along, across, 0], [-along, across, 0]]
    )
    panel = corners @ frame.T, np.array([[0, 1, 2], [0, 2, 3]])
    entries = []
    for name, of_part in parts.items():
        offset_m, film_um = np.concatenate([chosen[spray] for spray in of_part]).T
        # Where there are several sprays of a part, their troughs are repeats.
        trough = np.array([f'T{round(m / SCALE_M_PER_IN):+d}' for m in offset_m.tolist()])
        read = np.outer(offset_m, frame[:, 1]), trough, film_um, None
        motion = one_pass(frame, told_m(of_part[0][0]))
        part = Part(name, *panel, *motion, *read, *3 * (np.empty(0),))
        entries.append(part.write(folder))
    plane_m = told_m(float(np.median(heights_in)))
    (folder / 'model.yaml').write_text(yaml.safe_dump(_start(chosen, plane_m)))
    path = folder / 'campaign.yaml'
    path.write_text(yaml.safe_dump({'model': 'model.yaml', 'experiments': entries}))
    return path


def _start(chosen: dict[Spray, np.ndarray], plane_m: float) -> dict:
    """A first guess of the pattern from the first spray: the volume and the width of one pass."""
    offset_m, film_um = next(iter(chosen.values())).T
    volume = float(np.sum(film_um) * SCALE_M_PER_IN * SPEED_M_PER_S)
    spread_m = float(np.sqrt(np.average(offset_m**2, weights=film_um)))
    planar = {'K1_cm3_per_s': volume, 'K2': 0.3, 'K3': 0.0, 'phi_rad': 0.0, 'r_m': spread_m,
              'sigma1_m': 0.5 * spread_m, 'sigma2_m': spread_m}  # fmt: skip
    return {'planar': planar, 'projection': {'model_plane_m': plane_m, 'emission_offset_m': 0.0}}


def one_pass(frame: np.ndarray, standoff_m: float) -> tuple[np.ndarray, ...]:
    """Stamps [ns], positions, quaternions and trigger: open from well before the panel on."""
    time_s = np.arange(0.0, RUN_M / SPEED_M_PER_S + POSE_EVERY_S, POSE_EVERY_S)
    stamps = 1_700_000_000_000_000_000 + np.rint(time_s * 1e9).astype(np.int64)
    way = np.zeros((len(time_s), 3))
    way[:, 0], way[:, 2] = SPEED_M_PER_S * time_s - 0.5 * RUN_M, standoff_m
    # The tool's z looks at the panel, its x along the troughs.
    tool = Rotation.from_matrix(frame @ np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]])).as_quat()
    return stamps, way @ frame.T, np.tile(tool, (len(time_s), 1)), stamps[:1], np.array([True])

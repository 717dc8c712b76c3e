"""A line: the same programme on part after part over days, with what changes hidden in it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import datetime, timezone
from pathlib import Path

import numpy as np
import trimesh
import yaml

from .draw import stream
from .files import STATE_TOPIC, write_bag, write_readings
from .gauge import GaugeNoise, measure
from .shop import PARCELS, Campaign, generate

FIRST = datetime(2026, 11, 2, 6, 0, tzinfo=timezone.utc)
# Every so many of the controller's poses is recorded.
THINNED = 3
# Parts of a line differ less in their level than the panels of many jobs.
LINE_NOISE = GaugeNoise(level=0.015)


@dataclass(frozen=True)
class Hidden:
    """What happens on the line.

    Attributes:
        step: the film of all parts from row ``step_at`` on, as a factor.
        amplitude: of the hidden effect, a share of that painted, over the parts' rows 0 to n - 1;
            it is ``first`` until row ``since`` and grows linearly to ``last``.
    """

    step_at: int = 0
    step: float = 1.0
    since: int = 0
    first: float = 1.0
    last: float = 1.0

    def amount(self, row: int, count: int) -> float:
        """Share of the effect on a part."""
        grown = max(row - self.since, 0) / max(count - 1 - self.since, 1)
        return self.first + (self.last - self.first) * grown


def painted_job(
    seed: int, truth: str | None, amplitude: float | None, readings: int, parcels: int = PARCELS
) -> Campaign:
    """One part of the line with the effect hidden in it, painted once for all parts."""
    return generate(
        seed, truth, experiments=('door',), readings=readings, repeats=0, heldout=1,
        amplitude=amplitude, parcels=parcels, mesh_edge_m=0.03, style='columns',
    )  # fmt: skip


def film_um(job: Campaign, row: int, count: int, hidden: Hidden) -> np.ndarray:
    """(n,) film at the job's points on one part of the line, before its own level [um]."""
    readings = job.experiments[0].readings
    marks = readings.expected_um - readings.clean_um
    factor = hidden.step if row >= hidden.step_at else 1.0
    return factor * (readings.clean_um + hidden.amount(row, count) * marks)


def taken_on(row: int, points: int, points_a_part: int | None) -> np.ndarray:
    """Which of the job's points the gauge takes on a part: all, or some in rotation."""
    turns = 1 if points_a_part is None else points // points_a_part
    return np.arange(points)[row % turns :: turns]


def write_line(
    job: Campaign, folder: Path, count: int, hidden: Hidden, *, seed: int = 0,
    noise: GaugeNoise = LINE_NOISE, minutes: float = 90.0, points_a_part: int | None = None,
) -> list[str]:  # fmt: skip
    """Write ``count`` runs with their readings, line.yaml and a model; returns the runs' names.

    The model is the true bell as a calibration finds it: a little off. With ``points_a_part`` the
    gauge takes so many of the job's points on each part, in rotation.
    """
    folder.mkdir(parents=True)
    (part,) = job.experiments
    trimesh.Trimesh(part.vertices_m, part.faces, process=False).export(folder / 'door.stl')
    pattern = dict(job.truth['pattern'])
    projection = {key: pattern.pop(key) for key in ('model_plane_m', 'emission_offset_m')}
    planar = {key: pattern[key] for key in
              ('K1_cm3_per_s', 'K2', 'K3', 'phi_rad', 'r_m', 'sigma1_m', 'sigma2_m')}  # fmt: skip
    planar['K1_cm3_per_s'] *= 1.02
    planar['sigma2_m'] *= 1.02
    text = yaml.safe_dump({'planar': planar, 'projection': projection})
    (folder / 'model.yaml').write_text(text)
    told = {'mesh': 'door.stl', 'model': 'model.yaml', 'state_topic': STATE_TOPIC,
            'max_edge_length_m': 0.05}  # fmt: skip
    (folder / 'line.yaml').write_text(yaml.safe_dump(told))
    names, readings = [], part.readings
    for row in range(count):
        begun = FIRST.timestamp() + 60.0 * minutes * row
        when = datetime.fromtimestamp(begun, timezone.utc)
        names.append(f'{when:%Y-%m-%d_%H%M}_door_{row + 1:03d}')
        moved_ns = int(begun) * 10**9 - int(part.log.stamps_ns[0])
        log = replace(
            part.log, stamps_ns=part.log.stamps_ns[::THINNED] + moved_ns,
            positions_m=part.log.positions_m[::THINNED],
            quaternions_xyzw=part.log.quaternions_xyzw[::THINNED],
            trigger_stamps_ns=part.log.trigger_stamps_ns + moved_ns,
        )  # fmt: skip
        write_bag(log, folder / names[-1], part.plan.flow)
        film = film_um(job, row, count, hidden)
        shown = measure(readings.point, film, film, noise, stream(1000 * seed + row, 80))
        table = replace(readings, thickness_um=shown.thickness_um)
        taken = taken_on(row, len(readings), points_a_part)
        write_readings(table.select(taken), folder / f'{names[-1]}.csv', False)
    return names

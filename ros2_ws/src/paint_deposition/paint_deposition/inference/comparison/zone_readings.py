"""The readings of each zone beside its target, as on an acceptance sheet."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from paint_deposition.inference.readings.campaign import Campaign
from paint_deposition.inference.readings.residuals import Residuals
from paint_deposition.part.zones import Zone


@dataclass(frozen=True)
class ZoneReadings:
    """The readings of a zone of a part; figures are None where it has none."""

    experiment: str  # name
    name: str  # of the zone
    target_um: float
    tolerance_um: float
    readings: int
    mean_um: float | None = None  # measured
    min_um: float | None = None
    max_um: float | None = None
    mean_predicted_um: float | None = None
    within: float | None = None  # share of the readings within the tolerance, 0 to 1
    # The reading furthest from the target, and its point.
    worst_um: float | None = None
    worst_point: str | None = None

    @staticmethod
    def of(experiment: str, zone: Zone, found: Residuals, points: np.ndarray) -> ZoneReadings:
        """The readings (n,) of a zone, and the points (n,) where they were taken."""
        wanted = experiment, zone.name, zone.target_um, zone.tolerance_um
        measured = found.measured_um
        if not len(measured):
            return ZoneReadings(*wanted, 0)
        off = np.abs(measured - zone.target_um)
        return ZoneReadings(
            *wanted, len(measured), float(measured.mean()), float(measured.min()),
            float(measured.max()), float(found.predicted_um.mean()),
            float(np.mean(off <= zone.tolerance_um)), float(measured[off.argmax()]),
            str(points[off.argmax()]),
        )  # fmt: skip

    @property
    def verdict(self) -> str:
        """'accepted', how many readings are out, or that there are none."""
        if self.within is None:
            return 'not measured'
        out = self.readings - round(self.within * self.readings)
        return f'{out} of {self.readings} out' if out else 'accepted'

    @property
    def sentence(self) -> str:
        """The zone in a line."""
        band = f'{self.name}, {self.target_um:g} ± {self.tolerance_um:g} µm'
        if self.within is None:
            return f'{self.experiment}: {band}: no readings'
        return (
            f'{self.experiment}: {band}: {self.readings} readings, {self.mean_um:.1f} µm measured '
            f'and {self.mean_predicted_um:.1f} µm predicted on average, '
            f'{100 * self.within:.0f} % within, worst {self.worst_um:.1f} µm at {self.worst_point}'
        )

    def to_dict(self) -> dict[str, Any]:
        """An entry of ``zones`` in the files of results."""
        return asdict(self) | {'verdict': self.verdict}


def zone_readings(campaign: Campaign, readings: Residuals) -> tuple[ZoneReadings, ...]:
    """The zones of each experiment, by the residuals of all N readings used."""
    owner, found = campaign.experiment_of[campaign.means.owner], []
    for number, experiment in enumerate(campaign.experiments):
        of, own = experiment.zones_of_points, readings.select(owner == number)
        if of is None:
            continue
        points = experiment.readings.point
        for k, zone in enumerate(of.zones.zones):
            inside = (of.number == k)[experiment.means.owner]
            found.append(
                ZoneReadings.of(experiment.name, zone, own.select(inside), points[inside])
            )
    return tuple(found)

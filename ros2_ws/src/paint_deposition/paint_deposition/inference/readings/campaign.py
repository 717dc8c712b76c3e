"""A campaign: painted parts with their gauge readings, ready to be compared with the model."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from paint_deposition.errors import ReadingsError
from paint_deposition.film.common_film import ONE_FILM, TOTAL, WetFilms
from paint_deposition.inference.readings.gauge_noise import left_out_lines
from paint_deposition.inference.readings.places import (
    columns_or_rows,
    refuse_off_surface,
    refuse_other_side,
)
from paint_deposition.inference.readings.readings import Readings
from paint_deposition.motion.path import SprayPath
from paint_deposition.part.points import SurfacePoints, angles_rad
from paint_deposition.part.surface import Surface
from paint_deposition.part.zones import Zones

# Half the width of the stencil from which the film's slope at a reading is taken [m].
STENCIL_M = 0.006


@dataclass(frozen=True)
class Experiment:
    """One painted part: the surface, the path that painted it, the readings taken on it."""

    name: str  # for reports
    surface: Surface  # the refined part
    path: SprayPath  # sub-steps of the recorded motion
    readings: Readings  # those that are used; the means of their P points are what is fitted
    # The P measured points on the surface, followed by the stencils around them from which the
    # film's slope is taken.
    points: SurfacePoints
    taken: Readings  # all readings
    used: np.ndarray  # (N,) which of them are used
    # Where mesh, trajectory and readings came from, for reports.
    files: dict[str, str] = field(default_factory=dict)
    # Of the process, by name, where known.
    settings: Mapping[str, float] = field(default_factory=dict)
    # Of the cell while the part was painted: 'voltage', 'draught'.
    switched_off: frozenset[str] = frozenset()
    frame_id: str = ''  # of the recorded poses, '' where not known
    films: WetFilms = ONE_FILM  # what is read, as wet films that sub-steps of the path laid
    layer: str = TOTAL  # what is read, by the names of its coats
    zones: Zones | None = None  # of the vertices of the surface, each with a target
    target: tuple[float, float] | None = None  # its own target and tolerance [um]

    @staticmethod
    def of(
        name: str, surface: Surface, path: SprayPath, readings: Readings, **known: Any
    ) -> 'Experiment':
        """Match readings to the surface; those without groups get the rows or columns found.

        ``known`` are other attributes.

        Raises:
            ReadingsError: readings too far off the surface or on its other side, or of several
                layers.
        """
        if len(layers := dict.fromkeys(readings.layer.tolist())) > 1:
            raise ReadingsError(
                f'{readings.source}: readings of the layers {", ".join(map(repr, layers))}, and '
                'nothing says which motion laid which; name the coats (coats: in a campaign, '
                '--coat with simulate), or the one column to read (columns: {thickness: ...})'
            )
        first, owner = readings.first, readings.owner
        normals = None if readings.normals is None else readings.normals[first]
        positions = readings.positions_m[first]
        places_m, outward, distance_m = surface.locate(positions, normals)
        refuse_off_surface(surface, readings, distance_m)
        if normals is not None:
            refuse_other_side(readings, angles_rad(outward, normals))
        points = surface.at(positions, normals, stencil_m=STENCIL_M)
        if not readings.group.astype(bool).any():
            lines = columns_or_rows(surface, path, places_m)
            readings = replace(readings, group=lines[owner])
        used = np.ones(len(readings), dtype=bool)
        return Experiment(name, surface, path, readings, points, readings, used, **known)

    def with_readings(self, readings: Readings) -> 'Experiment':
        """The part with other readings; raises what ``of`` does."""
        found = Experiment.of(self.name, self.surface, self.path, readings)
        matched = ('readings', 'points', 'taken', 'used')
        return replace(self, **{name: getattr(found, name) for name in matched})

    def read_as(self, readings: Readings) -> 'Experiment':
        """The part with other films read at the same points; nothing is matched anew."""
        used = np.ones(len(readings), dtype=bool)
        return replace(self, readings=readings, taken=readings, used=used)

    def without(self, left_out: np.ndarray) -> 'Experiment':
        """The part without some of the readings (N,) that were used.

        Raises:
            ReadingsError: no reading is left.
        """
        if not left_out.any():
            return self
        if left_out.all():
            raise ReadingsError(
                f'{self.readings.source}: its {len(left_out)} readings contradict each other; '
                'measure again'
            )
        used = self.used.copy()
        used[used] = ~left_out
        return replace(self.with_readings(self.taken.select(used)), taken=self.taken, used=used)

    def __len__(self) -> int:
        return len(self.readings.first)

    @cached_property
    def brushes(self) -> frozenset[int]:
        """Numbers of the brushes that painted the part."""
        return frozenset(np.unique(self.path.brush[self.path.flow > 0.0]).tolist())

    @cached_property
    def measured_points(self) -> SurfacePoints:
        """The P measured points without the stencils."""
        return self.points.select(slice(0, len(self)))

    @cached_property
    def off_surface_m(self) -> np.ndarray:
        """(P,) how far each point was moved onto the surface [m]."""
        taken = self.readings.positions_m[self.readings.first]
        return np.linalg.norm(taken - self.measured_points.positions_m, axis=1)

    @property
    def understood(self) -> str:
        """How the readings were read and how far off the surface they were, in one line."""
        median, largest = 1e3 * np.median(self.off_surface_m), 1e3 * self.off_surface_m.max()
        moved = f'moved onto the surface by {median:.1f} mm (median), {largest:.1f} mm at most'
        return f'{self.readings.understood or self.readings.source}; {moved}'

    @cached_property
    def zones_of_points(self) -> Zones | None:
        """The zones of the P measured points; None without zones."""
        points = self.measured_points
        return self.zones and self.zones.at(points.positions_m, points.normals)

    @property
    def groups(self) -> np.ndarray:
        """(P,) group label of each point."""
        return self.readings.group[self.readings.first]


@dataclass(frozen=True)
class Campaign:
    """Experiments under one process setting, or with a few brushes.

    Arrays over the N readings or the P points of a campaign hold those of the first experiment
    first, then those of the second, and so on.

    Attributes:
        experiments: at least one.
        model_file: the start model's file, or None.
        name: that of its file, '' for none; errors compare within one campaign only.
        head: what the report says of part and batch, by key.
        target_um, tolerance_um: the film wanted outside of zones, and what it may differ [um];
            None: not known.
        scan: with the readings that were condensed to these, means of cells; None: none were.

    Raises:
        ReadingsError: two experiments have one name.
    """

    experiments: tuple[Experiment, ...]
    model_file: str | None = None
    name: str = ''
    head: Mapping[str, str] = field(default_factory=dict)
    target_um: float | None = None
    tolerance_um: float | None = None
    scan: 'Campaign | None' = None

    def __repr__(self) -> str:
        names = ', '.join(e.name for e in self.experiments)
        return f'Campaign({len(self.readings)} readings on {names})'

    def __post_init__(self) -> None:
        names = [experiment.name for experiment in self.experiments]
        if twice := [name for name in names if names.count(name) > 1]:
            raise ReadingsError(f"two experiments are called '{twice[0]}'; rename one")

    def __len__(self) -> int:
        return len(self.readings.first)

    @cached_property
    def readings(self) -> Readings:
        """The N readings that are used; the label of a point names its experiment."""
        return Readings.joined({e.name: e.readings for e in self.experiments})

    @cached_property
    def experiment_of(self) -> np.ndarray:
        """(P,) number of the experiment of each point."""
        return np.repeat(np.arange(len(self.experiments)), [len(e) for e in self.experiments])

    @cached_property
    def positions_m(self) -> np.ndarray:
        """(P, 3) measured points on the surfaces [m]."""
        return np.concatenate([e.measured_points.positions_m for e in self.experiments])

    def target_of(self, experiment: Experiment) -> tuple[float, float]:
        """Target and tolerance of the film read [um]; 0 is none, as for some of the coats."""
        wanted = experiment.target or (self.target_um or 0.0, self.tolerance_um or 0.0)
        return wanted if experiment.layer == TOTAL else (0.0, 0.0)

    @property
    def brushes(self) -> frozenset[int]:
        """Numbers of the brushes that painted its parts."""
        return frozenset[int]().union(*(e.brushes for e in self.experiments))

    @property
    def settings(self) -> dict[str, float]:
        """Mean over the experiments of each setting of the process that is known."""
        names = dict.fromkeys(name for e in self.experiments for name in e.settings)
        known = {n: [e.settings[n] for e in self.experiments if n in e.settings] for n in names}
        return {name: float(np.mean(values)) for name, values in known.items()}

    def without(self, left_out: np.ndarray) -> 'Campaign':
        """The campaign without some of its readings (N,).

        Raises:
            ReadingsError: an experiment has no reading left.
        """
        owner = self.experiment_of[self.readings.owner]
        kept = (e.without(left_out[owner == k]) for k, e in enumerate(self.experiments))
        return replace(self, experiments=tuple(kept))

    @property
    def fingerprints(self) -> tuple[str, ...]:
        """Of the readings of each experiment, as they were taken."""
        return tuple(e.taken.fingerprint for e in (self.scan or self).experiments)

    @property
    def understood(self) -> tuple[str, ...]:
        """How the readings of each experiment were read, a line each."""
        return tuple(f'{e.name}: {e.understood}' for e in self.experiments)

    @property
    def notes(self) -> tuple[str, ...]:
        """A line for each point at which readings were left out."""
        return tuple(
            f'{e.name}: {line}'
            for e in self.experiments
            for line in left_out_lines(e.taken, e.used)
        )

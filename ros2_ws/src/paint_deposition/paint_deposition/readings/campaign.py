"""A campaign: painted parts with their gauge readings, ready to be compared with the model."""

from dataclasses import dataclass, field, replace

import numpy as np

from paint_deposition.errors import ReadingsError
from paint_deposition.motion.path import SprayPath
from paint_deposition.part.points import SurfacePoints
from paint_deposition.part.surface import Surface
from paint_deposition.readings.outliers import left_out_lines
from paint_deposition.readings.readings import PointMeans, Readings

# Readings further from the surface, or facing more away from it, do not belong to the part.
MAX_DISTANCE_M = 0.02
MAX_ANGLE_RAD = np.radians(60.0)
# Distance to the neighbours from which the film's slope at a reading is taken [m].
STENCIL_M = 0.006


@dataclass(frozen=True)
class Experiment:
    """One painted part: the surface, the path that painted it, the readings taken on it.

    Attributes:
        name: for reports.
        surface: the refined part.
        path: sub-steps with what lies ahead known.
        readings: those that are used.
        means: the readings averaged over repeats; its P points are what is fitted.
        taken: all readings; used: (N,) which of them are used.
        points: the P places on the surface, with covariates and slope stencils behind them.
        files: where mesh, trajectory and readings came from, for reports.
    """

    name: str
    surface: Surface
    path: SprayPath
    readings: Readings
    means: PointMeans
    points: SurfacePoints
    taken: Readings
    used: np.ndarray
    files: dict[str, str] = field(default_factory=dict)

    @staticmethod
    def of(
        name: str,
        surface: Surface,
        path: SprayPath,
        readings: Readings,
        files: dict[str, str] | None = None,
    ) -> 'Experiment':
        """Match readings to the surface.

        Raises:
            ReadingsError: readings too far off the surface or on its other side.
        """
        means = PointMeans.of(readings)
        normals = None if readings.normals is None else readings.normals[means.first]
        positions = readings.positions_m[means.first]
        place = surface.locate(positions, normals)
        _refuse_far(readings, means, place.distance_m)
        if normals is not None:
            _refuse_other_side(readings, means, place.angle_rad)
        points = surface.at(positions, normals, stencil_m=STENCIL_M)
        used = np.ones(len(readings), dtype=bool)
        return Experiment(
            name, surface, path, readings, means, points, readings, used, files or {}
        )

    def without(self, left_out: np.ndarray) -> 'Experiment':
        """The same part without some of the readings (N,) that were used.

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
        kept = Experiment.of(
            self.name, self.surface, self.path, self.taken.select(used), self.files
        )
        return replace(kept, taken=self.taken, used=used)

    def __len__(self) -> int:
        return len(self.means.mean_um)

    @property
    def groups(self) -> np.ndarray:
        """(P,) group label of each point."""
        return self.readings.group[self.means.first]


@dataclass(frozen=True)
class Campaign:
    """Experiments under one process setting.

    Attributes:
        experiments: at least one.
        model_file: the start model's file, or None.
        name: that of its file, '' for none; errors compare within one campaign only.
    """

    experiments: tuple[Experiment, ...]
    model_file: str | None = None
    name: str = ''

    def __len__(self) -> int:
        return sum(len(experiment) for experiment in self.experiments)

    @property
    def reading_count(self) -> int:
        """Readings that are used, repeats counted singly."""
        return sum(len(experiment.readings) for experiment in self.experiments)

    def without(self, left_out: np.ndarray) -> 'Campaign':
        """The same without some of the readings, (N,) in the order of the experiments.

        Raises:
            ReadingsError: an experiment has no reading left.
        """
        ends = np.cumsum([len(experiment.readings) for experiment in self.experiments])
        parts = zip(self.experiments, np.split(left_out, ends[:-1]), strict=True)
        return replace(self, experiments=tuple(e.without(rows) for e, rows in parts))

    @property
    def notes(self) -> tuple[str, ...]:
        """Readings that were left out, a line for each point."""
        return tuple(
            f'{experiment.name}: {line}'
            for experiment in self.experiments
            for line in left_out_lines(experiment.taken, experiment.used)
        )


def _refuse_far(readings: Readings, means: PointMeans, distance_m: np.ndarray) -> None:
    far = np.flatnonzero(distance_m > MAX_DISTANCE_M)
    if not len(far):
        return
    worst = far[np.argmax(distance_m[far])]
    where = ', '.join(f'{value:.3f}' for value in readings.positions_m[means.first[worst]])
    raise ReadingsError(
        f"{readings.source}: {len(far)} of {len(distance_m)} points lie off the part's surface, "
        f"point '{readings.point[means.first[worst]]}' at ({where}) m by {distance_m[worst]:.3f} "
        f'm (limit {MAX_DISTANCE_M:g}); give positions in the mesh frame, in metres'
    )


def _refuse_other_side(readings: Readings, means: PointMeans, angle_rad: np.ndarray) -> None:
    away = np.flatnonzero(angle_rad > MAX_ANGLE_RAD)
    if len(away):
        worst = away[np.argmax(angle_rad[away])]
        raise ReadingsError(
            f'{readings.source}: {len(away)} of {len(angle_rad)} normals point away from the '
            f"surface, point '{readings.point[means.first[worst]]}' by "
            f'{np.degrees(angle_rad[worst]):.0f} deg; give outward normals'
        )

"""Node `model_comparison`: compares gauge readings with the film of a model during painting."""

from collections.abc import Mapping
from functools import partial
from pathlib import Path

import numpy as np
from geometry_msgs.msg import Point
from paint_msgs.msg import ComparisonStats
from std_srvs.srv import Trigger
from visualization_msgs.msg import Marker, MarkerArray

from paint_deposition.errors import PaintError, ReadingsError
from paint_deposition.files.gauge_readings import read_readings
from paint_deposition.inference.comparison.regions import interpolation_matrix
from paint_deposition.inference.readings.campaign import Experiment
from paint_deposition.inference.readings.gauge_noise import gauge_noise
from paint_deposition.inference.readings.plausibility import readings_in_doubt, zeros_in_doubt
from paint_deposition.inference.readings.readings import Residuals
from paint_deposition.motion.path import SprayPath
from paint_deposition.nodes import topics
from paint_deposition.nodes.node import OK, WARN, Status, Task
from paint_deposition.nodes.painting.film_display import legend
from paint_deposition.nodes.painting.painting_node import PaintingNode
from paint_deposition.nodes.painting.painting_parameters import PAINTING
from paint_deposition.nodes.parameters import CONFIGURED, NodeParameter, fixed
from paint_deposition.nodes.topics import coloured_mesh, header
from paint_deposition.part.points import SurfacePoints
from paint_deposition.part.surface import Surface, turned
from paint_deposition.report.colour_scales import ColourScale, residual_scale


class ModelComparison(PaintingNode):
    """Paints the points of gauge readings and publishes their residuals.

    A residual, measured minus predicted, starts as the whole reading and falls to what the model
    does not explain. The film is computed in double precision at the readings; the colours around
    them are for display only.
    """

    NAME = 'model_comparison'
    PARAMETERS = PAINTING | dict(
        **fixed(
            'the film is painted where they were taken; clean the node up or restart it',
            CONFIGURED,
            measurements_file=NodeParameter(
                '',
                'Gauge readings, CSV with x_m,y_m,z_m,thickness_um in the frame of the mesh '
                '[path]',
            ),
        ),
        color_max_um=NodeParameter(
            0.0,
            'Residual at the ends of the colours; 0: a quarter of the thickest reading [µm]',
            (0.0, 10_000.0),
        ),
    )
    PRECISION = 'double'

    def _configure(self) -> Mapping[str, Task]:
        if not self.values['measurements_file']:
            raise PaintError('model_comparison: measurements_file is empty: give gauge readings')
        self._is_read = False
        self.readings = read_readings(self.values['measurements_file'])
        self.get_logger().info(self.readings.understood)
        self._noise = gauge_noise(self.readings)
        tasks = super()._configure()
        latched = partial(self.create_publisher, qos_profile=topics.LATCHED)
        self._mesh_publisher = latched(Marker, 'comparison/mesh')
        self._stats_publisher = latched(ComparisonStats, 'comparison/stats')
        self._legend_publisher = latched(MarkerArray, 'comparison/legend')
        self.create_service(Trigger, '~/compare', lambda *_: self._compare())
        self._legend_publisher.publish(legend(self._scale, self.surface, self.frame.frame_id))
        self.publish()
        return {**tasks, 'comparison': self.status}

    # --- the part and its readings

    def _points_on(self, surface: Surface) -> tuple[Surface, SurfacePoints]:
        motionless = SprayPath.empty()
        try:
            self._experiment = Experiment.of('live', surface, motionless, self.readings)
        except ReadingsError:
            # Until the gun tells which side of an open sheet is outward, readings with normals do.
            if self._is_read:
                raise
            surface = turned(surface)
            self._experiment = Experiment.of('live', surface, motionless, self.readings)
        self._is_read = True
        return surface, self._experiment.points

    def _surface_changed(self) -> None:
        super()._surface_changed()
        surface = self.surface
        for doubt in readings_in_doubt(surface, self.readings, np.zeros(len(self.readings))):
            self.get_logger().warning(doubt)
        frame_id = self.frame.frame_id
        self._mesh = coloured_mesh(surface.vertices_m, surface.faces, frame_id, 'residual')
        at = slice(len(self._experiment))
        places, normals = self.points.positions_m[at], self.points.normals[at]
        self._spreading, self._coloured = interpolation_matrix(surface, places, normals)

    def residuals(self) -> Residuals:
        """The residuals of all readings, with the film of all poses received."""
        predicted = self.film.snapshot().gauge_um[: len(self._experiment)]
        at_readings = predicted[self._experiment.readings.owner]
        return Residuals(self.readings.thickness_um, at_readings, self._noise.sigma_um)

    # --- parameters

    def _on_change(self, names: set[str]) -> None:
        super()._on_change(names)
        if 'color_max_um' in names:
            bar = legend(self._scale, self.surface, self.frame.frame_id)
            self._legend_publisher.publish(bar)

    # --- publishing

    @property
    def _scale(self) -> ColourScale:
        thickest = float(np.abs(self.readings.thickness_um).max())
        return residual_scale(0.25 * thickest, self.values['color_max_um'])

    @property
    def _model_name(self) -> str:
        files = dict.fromkeys(self.files_in_use)
        return ' '.join(Path(file).name or 'default model' for file in files)

    def publish(self) -> None:
        """Publish the comparison if the film has changed."""
        self.catch_up()
        film = self.film.snapshot()
        if film == self._shown:
            return
        self._shown = film
        residuals = self.residuals()
        stamp_ns = self.film.newest_ns or 0
        x, y, z = self.readings.positions_m[residuals.worst].tolist()
        stats = ComparisonStats(
            header=header(self.frame.frame_id, stamp_ns),
            model=self._model_name,
            readings=len(residuals),
            readings_painted=int(residuals.painted.sum()),
            bias_um=residuals.bias_um,
            rmse_um=residuals.rmse_um,
            rmse_painted_um=residuals.select(residuals.painted).rmse_um,
            chi_square_per_reading=residuals.chi_square_per_reading,
            noise_floor_um=np.nan if self._noise.source == 'assumed' else self._noise.typical_um,
            worst_position=Point(x=x, y=y, z=z),
            worst_residual_um=float(residuals.residual_um[residuals.worst]),
        )
        self._stats_publisher.publish(stats)
        at_points = self._experiment.readings.mean_um - film.gauge_um[: len(self._experiment)]
        scale = self._scale
        rows = scale.rows(self._spreading @ at_points, self._coloured)
        self._mesh_publisher.publish(self._mesh(stamp_ns, scale.palette, rows))

    def _compare(self) -> Trigger.Response:
        """The comparison in one line."""
        self.catch_up()
        found = self.residuals()
        x, y, z = self.readings.positions_m[found.worst]
        line = (
            f'{self._model_name}: {len(found)} readings, {found.painted.sum()} where '
            f'paint is predicted; residual {found.bias_um:+.2f} µm on average, rms '
            f'{found.rmse_um:.2f} µm (gauge {self._noise.typical_um:.2f} µm, '
            f'{self._noise.source}), chi-square {found.chi_square_per_reading:.2f} a reading; '
            f'worst {found.residual_um[found.worst]:+.2f} µm at ({x:.3f}, {y:.3f}, {z:.3f}) m'
        )
        if doubt := zeros_in_doubt(self.readings, found.predicted_um):
            line += f'; {doubt}'
        self.get_logger().info(line)
        return Trigger.Response(success=True, message=line)

    def status(self) -> Status:
        found = self.residuals()
        values = {
            'readings': self.values['measurements_file'],
            'bias [µm]': f'{found.bias_um:.3f}',
            'noise of the gauge [µm]': f'{self._noise.typical_um:.3f}',
            'noise known from': self._noise.source,
        }
        line = f'rms {found.rmse_um:.2f} µm at {len(found)} readings'
        if doubt := zeros_in_doubt(self.readings, found.predicted_um):
            return WARN, f'{line}; {doubt}', values
        return OK, line, values

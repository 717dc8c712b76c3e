"""Node `deposition_simulator`: the film on a part as the atomizer paints it."""

from __future__ import annotations

import functools
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
from paint_msgs.msg import ThicknessField, ThicknessStats
from paint_msgs.srv import SaveFilm
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.task import Future
from sensor_msgs.msg import PointCloud2
from visualization_msgs.msg import Marker, MarkerArray

from paint_deposition.errors import PaintError
from paint_deposition.film.colour_scales import ColourScale, film_scale
from paint_deposition.film.integrator import FilmIntegrator
from paint_deposition.film.statistics import (
    DEFAULT_PAINTED_ABOVE_UM,
    FilmStatistics,
    film_statistics,
)
from paint_deposition.nodes.painting.film_messages import FilmCloud, FilmField, stats_message
from paint_deposition.nodes.painting.legend import legend
from paint_deposition.nodes.painting.painting_diagnostics import painting_tasks
from paint_deposition.nodes.painting.painting_node import PaintingNode
from paint_deposition.nodes.painting.painting_parameters import PAINTING
from paint_deposition.nodes.runtime import qos
from paint_deposition.nodes.runtime.diagnostics import Diagnostics
from paint_deposition.nodes.runtime.messages import ColouredMesh
from paint_deposition.nodes.runtime.parameters import (
    FILE_NAME,
    FILE_NAME_WORDS,
    NodeParameter,
    thickness,
)
from paint_deposition.part.points import SurfacePoints
from paint_deposition.part.surface import Surface
from paint_deposition.results.film import write_film

SIMULATOR = dict(
    **PAINTING,
    precision=NodeParameter(
        'single',
        'Arithmetic on the mesh; single is good to a millionth of the peak [name]',
        choices=('single', 'double'),
        fixed_because='the film so far was summed in it; restart the node',
    ),
    color_min_um=thickness('Film at the lower end of the colours; both ends 0: automatic [µm]'),
    color_max_um=thickness('Film at the upper end of the colours; both ends 0: automatic [µm]'),
    painted_above_um=thickness(
        'Thinner film counts, and is shown, as bare metal [µm]', DEFAULT_PAINTED_ABOVE_UM
    ),
    target_um=thickness('Film wanted; 0: none [µm]'),
    target_tolerance_um=thickness('Difference from the target that is allowed, either way [µm]'),
    publish_mesh=NodeParameter(
        True,
        'Whether the coloured mesh goes out; of 275,000 vertices it takes 65 MB each time [-]',
    ),
    output_directory=NodeParameter(
        'runs',
        'Where ~/save_film writes [path]',
        fixed_because='the network does not choose where files are written; restart the node',
    ),
)


class DepositionSimulator(PaintingNode):
    """Paints a mesh from `atomizer/pose` and `atomizer/state` and publishes the film.

    Mesh (a Marker), legend and statistics are latched; cloud and field go out as the film
    changes, and once more when somebody new listens. Everything shows all poses received.
    """

    PARAMETERS = SIMULATOR

    def __init__(self, **kwargs: Any):
        super().__init__('deposition_simulator', **kwargs)
        self._outputs = {
            topic: self.watch.publisher(message, topic, profile)
            for topic, message, profile in (
                ('thickness/mesh', Marker, qos.LATCHED),
                ('thickness/legend', MarkerArray, qos.LATCHED),
                ('thickness/stats', ThicknessStats, qos.LATCHED),
                ('thickness/cloud', PointCloud2, qos.RESULTS),
                ('thickness/field', ThicknessField, qos.RESULTS),
            )
        }
        # In a group of its own: while it waits for the disk, poses must not wait for it.
        saving = ReentrantCallbackGroup()
        self.create_service(SaveFilm, '~/save_film', self._save_film, callback_group=saving)
        self._scale: ColourScale | None = None
        self._stats = ThicknessStats()
        self._counts_shown: tuple | None = None
        self._greeted = 0
        self._saving = ThreadPoolExecutor(max_workers=1, thread_name_prefix='saving')
        self._publish_s = 0.0
        last = 'last publication [ms]'
        tasks = painting_tasks(self, lambda: {last: f'{self._publish_s * 1e3:.0f}'})
        self._diagnostics = Diagnostics(self, tasks)
        self.publish()

    # --- the part and its film

    def _points_on(self, surface: Surface) -> SurfacePoints:
        return surface.points()

    def _take_surface(self, surface: Surface) -> None:
        super()._take_surface(surface)
        frame_id = self.frame.frame_id
        self.mesh_id = surface.mesh_id
        self._mesh = ColouredMesh(surface.vertices_m, surface.faces, frame_id, 'thickness')
        self._cloud = FilmCloud(surface.vertices_m, frame_id)
        self._field = FilmField(len(surface.vertices_m), self.mesh_id, frame_id)

    def statistics(self, film_um: np.ndarray, emitted_cm3: float) -> FilmStatistics:
        """The film's figures with the target and the limit that are set."""
        return film_statistics(
            film_um,
            self.surface.vertex_areas_m2,
            emitted_cm3,
            painted_above_um=self.values['painted_above_um'],
            target_um=self.values['target_um'],
            target_tolerance_um=self.values['target_tolerance_um'],
        )

    # --- parameters

    def _check(self, values: Mapping[str, Any]) -> None:
        super()._check(values)
        low, high = values['color_min_um'], values['color_max_um']
        if (low, high) != (0.0, 0.0) and low >= high:
            raise PaintError(
                f'color_min_um {low:g} is not below color_max_um {high:g}; both 0 is automatic'
            )

    def _changed(self, names: set[str]) -> None:
        super()._changed(names)
        self._shown = None

    # --- publishing

    def publish(self) -> None:
        """Publish the film if it has changed, or somebody new listens."""
        began_s = time.monotonic()
        self.up_to_date()
        film = self.film.up_to_date()
        newcomers = self.watch.newcomers
        news = film is not self._shown
        if news or newcomers > self._greeted:
            self._publish_film(film, with_latched=news)
            self._publish_s = time.monotonic() - began_s
        self._shown, self._greeted = film, newcomers
        self._publish_stats()

    def _publish_film(self, film: FilmIntegrator, with_latched: bool) -> None:
        film_um = film.film_um
        stamp_ns = self.film.newest_ns or 0
        self._outputs['thickness/cloud'].publish(self._cloud.message(stamp_ns, film_um))
        self._outputs['thickness/field'].publish(self._field.message(stamp_ns, film_um))
        if not with_latched:
            return
        figures = self.statistics(film_um, film.emitted_cm3)
        self._stats = stats_message(self.frame.frame_id, stamp_ns, figures)
        self._counts_shown = None
        scale = film_scale(film_um, self.values['color_min_um'], self.values['color_max_um'])
        rows = scale.rows(film_um, film_um > self.values['painted_above_um'])
        if self.values['publish_mesh']:
            self._outputs['thickness/mesh'].publish(
                self._mesh.serialised(stamp_ns, scale.palette, rows)
            )
        if self._scale is None or (scale.low, scale.high) != (self._scale.low, self._scale.high):
            self._scale = scale
            self._outputs['thickness/legend'].publish(
                legend(scale, 'µm', self.surface, self.frame.frame_id)
            )

    def _publish_stats(self) -> None:
        """Publish the statistics if the film or a count has changed."""
        counts, refused = self.film.counts, self.input.poses_refused
        shown = (
            counts.received + refused,
            counts.rejected + refused,
            counts.gaps,
            self.input.intervals.longest_ns * 1e-9,
        )
        if shown == self._counts_shown:
            return
        self._counts_shown = shown
        message = self._stats
        message.poses_received, message.poses_rejected, message.pose_gaps = shown[:3]
        message.longest_gap_s = shown[3]
        self._outputs['thickness/stats'].publish(message)

    # --- services

    def close(self) -> None:
        self._saving.shutdown()

    async def _save_film(
        self, request: SaveFilm.Request, response: SaveFilm.Response
    ) -> SaveFilm.Response:
        """Write in a thread: poses keep coming meanwhile."""
        stem = request.name or time.strftime('film_%Y%m%d_%H%M%S')
        if not FILE_NAME.fullmatch(stem):
            response.message = f"name '{stem}': use {FILE_NAME_WORDS}"
            return response
        self.up_to_date()
        film = self.film.up_to_date()
        written: Future = Future(executor=self.executor)
        # Completed from another thread, a future does not wake the executor unless it has a
        # callback to run.
        written.add_done_callback(lambda _: None)
        self._saving.submit(self._film_to_save(stem, film)).add_done_callback(written.set_result)
        saved: Any = await written
        try:
            paths = saved.result()
        except Exception as error:  # the caller of the service is told
            response.message = str(error)
            return response
        response.success = True
        response.paths = [str(path) for path in paths]
        response.message = f'wrote {", ".join(path.name for path in paths)}'
        return response

    def _film_to_save(self, stem: str, film: FilmIntegrator) -> Callable[[], list[Path]]:
        """A function that writes the film as it is now and returns the paths."""
        surface, film_um, values = self.surface, film.film_um, self.values
        statistics = self.statistics(film_um, film.emitted_cm3)
        details = {
            'mesh_file': values['mesh_file'],
            'mesh_id': self.mesh_id,
            'frame_id': self.frame.frame_id,
            'down': surface.down,
            'model_file': values['model_file'],
            'effects': [effect.id for effect in self.film.model.effects],
            'paint': film.used.figures(statistics.mean_um, statistics.painted_volume_cm3)
            if self.film.model.brushes
            else None,
            'poses': self.film.counts.to_dict(),
            'poses_in_other_frames': dict(self.input.refused_frames),
        }
        return functools.partial(
            write_film,
            Path(values['output_directory']),
            surface,
            film_um,
            statistics,
            stem=stem,
            statistics_file=f'{stem}.json',
            details=details,
            color_range_um=(values['color_min_um'], values['color_max_um']),
        )

"""Node `deposition_simulator`: the film on a part as the atomizer paints it."""

from __future__ import annotations

import time
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from paint_msgs.msg import ThicknessField, ThicknessStats
from paint_msgs.srv import SaveFilm
from rclpy.callback_groups import ReentrantCallbackGroup
from sensor_msgs.msg import PointCloud2
from visualization_msgs.msg import Marker, MarkerArray

from paint_deposition.errors import PaintError
from paint_deposition.film.colour_scales import film_scale
from paint_deposition.film.common_film import CommonFilm
from paint_deposition.film.statistics import DEFAULT_PAINTED_ABOVE_UM
from paint_deposition.nodes.painting.early import look_at_once
from paint_deposition.nodes.painting.film_files import (
    figures_of,
    film_to_save,
    laid_by,
)
from paint_deposition.nodes.painting.film_messages import FilmChanges, ShownFilm, stats_message
from paint_deposition.nodes.painting.large_topic import LargeTopic
from paint_deposition.nodes.painting.legend import legend
from paint_deposition.nodes.painting.mesh_tiles import MeshTiles
from paint_deposition.nodes.painting.painting_diagnostics import painting_tasks
from paint_deposition.nodes.painting.painting_node import PaintingNode
from paint_deposition.nodes.painting.painting_parameters import PAINTING, bare_films, read_part
from paint_deposition.nodes.painting.part_change import PartChange
from paint_deposition.nodes.painting.parts import PreparedPart
from paint_deposition.nodes.runtime import qos
from paint_deposition.nodes.runtime.diagnostics import Task
from paint_deposition.nodes.runtime.file_names import require_file_name
from paint_deposition.nodes.runtime.messages import of_gun
from paint_deposition.nodes.runtime.parameters import NodeParameter, thickness
from paint_deposition.part.points import SurfacePoints
from paint_deposition.part.surface import Surface

SIMULATOR = PAINTING | {
    'publish_rate_hz': NodeParameter(
        5.0,
        'How often statistics go out while the film changes, and large messages at the most [Hz]',
        (0.1, 30.0),
    ),
    'precision': NodeParameter(
        'single',
        'Arithmetic on the mesh; single is good to a millionth of the peak [name]',
        choices=('single', 'double'),
        fixed_because='the film so far was summed in it; clean the node up or restart it',
        read_to_configure=True,
    ),
    'color_min_um': thickness('Film at the lower end of the colours; both ends 0: automatic [µm]'),
    'color_max_um': thickness('Film at the upper end of the colours; both ends 0: automatic [µm]'),
    'painted_above_um': thickness(
        'Thinner film counts, and is shown, as bare metal [µm]', DEFAULT_PAINTED_ABOVE_UM
    ),
    'target_um': thickness('Film wanted; 0: none [µm]'),
    'target_tolerance_um': thickness('Difference from the target that is allowed [µm]'),
    'publish_mesh': NodeParameter(
        True,
        'Whether who listens gets the coloured mesh; of 275,000 vertices it takes 65 MB each [-]',
    ),
    'output_directory': NodeParameter(
        'runs',
        'Where ~/save_film writes [path]',
        fixed_because='the network does not choose where files are written; restart the node',
    ),
}


class DepositionSimulator(PaintingNode):
    """Paints a mesh from `atomizer/pose` and `atomizer/state` and publishes the film.

    Statistics and legend are latched. Mesh (a Marker), cloud, field and changes go to whoever
    listens, as often as the link takes them. Everything shows all poses received.
    """

    PARAMETERS = SIMULATOR

    def __init__(self, **kwargs: Any):
        super().__init__('deposition_simulator', **kwargs)

    def _configure(self) -> None:
        super()._configure()
        # Of several guns the film of each, too.
        self._share_topics = [
            of_gun(name, 'thickness/field') for name in self.gun_names if len(self.gun_names) > 1
        ]
        self._legend, self._figures = (
            self.watch.publisher(message, topic, qos.LATCHED)
            for message, topic in (
                (MarkerArray, 'thickness/legend'),
                (ThicknessStats, 'thickness/stats'),
            )
        )
        self._large = {
            topic: LargeTopic(self.watch, message, topic, profile)
            for topic, message, profile in (
                ('thickness/mesh', Marker, qos.LATCHED),
                ('thickness/cloud', PointCloud2, qos.RESULTS),
                ('thickness/changes', PointCloud2, qos.RESULTS),
                ('thickness/field', ThicknessField, qos.RESULTS),
                *((topic, ThicknessField, qos.RESULTS) for topic in self._share_topics),
            )
        }
        # In a group of its own: while it waits for the disk, poses must not wait for it.
        saving = ReentrantCallbackGroup()
        self.create_service(SaveFilm, '~/save_film', self._save_film, callback_group=saving)
        self._stats = ThicknessStats()
        self._counts_shown: tuple | None = None
        # Counts what has been shown: another film, or the same in other colours.
        self._edition = 0
        self._film_um = np.empty(0)
        self._scale = film_scale(self._film_um)
        self._legend_ends: tuple[float, float] | None = None
        self._saving = ThreadPoolExecutor(max_workers=1, thread_name_prefix='saving')
        self._publish_s = 0.0
        self.parts = PartChange(self, saving)
        self.publish()

    def _cleanup(self) -> None:
        super()._cleanup()
        self.parts.close()
        self._saving.shutdown()

    def _tasks(self) -> Mapping[str, Task]:
        return painting_tasks(self, self._more_on_the_film) | {'part': self.parts.status}

    # --- the part and its film

    def _more_on_the_film(self) -> dict[str, object]:
        """What the diagnostics say of the film beside part and model."""
        told = zip(self._stats.atomizers, self._stats.atomizer_share, strict=True)
        each = {f'share of {gun}': f'{share:.1%}' for gun, share in told if gun}
        return {'last publication [ms]': f'{self._publish_s * 1e3:.0f}', **each}

    def _points_on(self, surface: Surface) -> SurfacePoints:
        return surface.points()

    def _take_surface(self, surface: Surface) -> None:
        super()._take_surface(surface)
        self.shown_as = ShownFilm(surface, self.frame.frame_id)
        self._mesh, self._changes = MeshTiles(self.shown_as), FilmChanges(self.shown_as)

    def prepared_part(self, mesh_file: str) -> PreparedPart:
        """Read a part that is to come; in a thread of its own."""
        surface = read_part(self.values, mesh_file)
        points = self._points_on(surface)
        film = bare_films(surface, points, self._models, self.values)
        film.warm_up()
        look_at_once(surface)
        return PreparedPart(surface, points, film, ShownFilm(surface, self.frame.frame_id))

    def show_anew(self) -> None:
        """The part is another one."""
        self._shown = self._legend_ends = None
        self._mesh = MeshTiles(self.shown_as, clear=True)
        self._changes = FilmChanges(self.shown_as)

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
        """Publish the film if it has changed, or somebody has not heard of it yet."""
        began_s = time.monotonic()
        self.up_to_date()
        film = self.film.up_to_date()
        changed = film != self._shown
        if changed:
            self._sum_up(film)
        self._shown = film
        self._offer(film, at_rest=not changed)
        if changed:
            self._publish_s = time.monotonic() - began_s
        self._publish_stats()

    def _sum_up(self, film: CommonFilm) -> None:
        """Take a film as the one that is shown, with its figures and its legend."""
        self._edition += 1
        self._film_um = film_um = film.film_um
        figures = figures_of(self.values, self.surface, film_um, film.emitted_cm3)
        laid_cm3 = laid_by(self.gun_names, self.surface, film)
        stamp_ns = self.film.newest_ns or 0
        self._stats = stats_message(self.frame.frame_id, stamp_ns, figures, laid_cm3)
        self._stats.run = self.parts.part.run
        self._counts_shown = None
        scale = film_scale(film_um, self.values['color_min_um'], self.values['color_max_um'])
        self._scale = scale
        if (scale.low, scale.high) != self._legend_ends:
            self._legend_ends = scale.low, scale.high
            self._legend.publish(legend(scale, 'µm', self.surface, self.frame.frame_id))

    def _offer(self, film: CommonFilm, at_rest: bool) -> None:
        """Let those who listen have the film that is shown."""
        film_um, shown_as, scale = self._film_um, self.shown_as, self._scale
        stamp_ns = self.film.newest_ns or 0

        def mesh(anew: bool) -> bytes | None:
            rows = scale.rows(film_um, film_um > self.values['painted_above_um'])
            return self._mesh.message(self._edition, stamp_ns, scale.palette, rows, whole=anew)

        def cloud(_: bool) -> PointCloud2:
            return shown_as.cloud.message(stamp_ns, film_um)

        def changes(anew: bool) -> PointCloud2 | None:
            return self._changes.message(stamp_ns, film_um, whole=anew, exact=at_rest)

        def field(_: bool) -> ThicknessField:
            return shown_as.field.message(stamp_ns, film_um)

        def share(_: bool, gun: int) -> ThicknessField:
            return shown_as.field.message(stamp_ns, film.shares_um[gun])

        if self.values['publish_mesh']:
            self._large['thickness/mesh'].offer((self._edition, self._mesh.sent), mesh)
        self._large['thickness/cloud'].offer(self._edition, cloud)
        self._large['thickness/changes'].offer((self._edition, at_rest), changes)
        self._large['thickness/field'].offer(self._edition, field)
        for gun, topic in enumerate(self._share_topics):
            self._large[topic].offer(self._edition, partial(share, gun=gun))

    def _publish_stats(self) -> None:
        """Publish the statistics if the film or a count has changed."""
        counts = self.film.counts
        refused = sum(source.poses_refused for source in self.inputs)
        shown = (
            counts.received + refused,
            counts.rejected + refused,
            counts.gaps,
            max(source.intervals.longest_ns for source in self.inputs) * 1e-9,
        )
        if shown == self._counts_shown:
            return
        self._counts_shown = shown
        message = self._stats
        message.poses_received, message.poses_rejected, message.pose_gaps = shown[:3]
        message.longest_gap_s = shown[3]
        self._figures.publish(message)

    # --- services

    async def _save_film(
        self, request: SaveFilm.Request, response: SaveFilm.Response
    ) -> SaveFilm.Response:
        """Write in a thread: poses keep coming meanwhile."""
        stem = request.name or time.strftime('film_%Y%m%d_%H%M%S')
        try:
            require_file_name('name', stem)
        except PaintError as error:
            response.message = str(error)
            return response
        self.up_to_date()
        write = film_to_save(self, Path(self.values['output_directory']), stem)
        try:
            paths = await self.in_a_thread(self._saving.submit(write))
        except Exception as error:  # the caller of the service is told
            response.message = str(error)
            return response
        response.success = True
        response.paths = [str(path) for path in paths]
        response.message = f'wrote {", ".join(path.name for path in paths)}'
        return response

"""Node `deposition_simulator`: the film on a part as the atomizer paints it."""

from __future__ import annotations

import time
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from paint_msgs.srv import SaveFilm
from rclpy.callback_groups import ReentrantCallbackGroup

from paint_deposition.errors import PaintError
from paint_deposition.film.statistics import DEFAULT_PAINTED_ABOVE_UM
from paint_deposition.nodes.painting.film_display import FilmDisplay
from paint_deposition.nodes.painting.film_files import film_to_save
from paint_deposition.nodes.painting.painting_diagnostics import painting_tasks
from paint_deposition.nodes.painting.painting_node import PaintingNode
from paint_deposition.nodes.painting.painting_parameters import PAINTING
from paint_deposition.nodes.painting.part_change import PartChange, version_of
from paint_deposition.nodes.runtime.node import Task
from paint_deposition.nodes.runtime.parameters import (
    NodeParameter,
    read_to_configure,
    require_file_name,
    thickness,
)
from paint_deposition.part.points import SurfacePoints
from paint_deposition.part.surface import Surface

SIMULATOR = PAINTING | {
    'publish_rate_hz': NodeParameter(
        5.0,
        'How often statistics go out while the film changes, and large messages at the most [Hz]',
        (0.1, 30.0),
    ),
    **read_to_configure(
        'the film so far was summed in it; clean the node up or restart it',
        precision=NodeParameter(
            'single',
            'Arithmetic on the mesh; single is good to a millionth of the peak [name]',
            choices=('single', 'double'),
        ),
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
        'Publish the coloured mesh; of 275,000 vertices it takes 65 MB for each listener '
        '[true/false]',
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

    Attributes:
        display: publishes the film.
        parts: the part in the cell, and its change.
    """

    PARAMETERS = SIMULATOR

    def __init__(self, **kwargs: Any):
        super().__init__('deposition_simulator', **kwargs)

    def _configure(self) -> None:
        super()._configure()
        # In a group of its own: while it waits for the disk, poses must not wait for it.
        saving = ReentrantCallbackGroup()
        self.create_service(SaveFilm, '~/save_film', self._save_film, callback_group=saving)
        self._saving = ThreadPoolExecutor(max_workers=1, thread_name_prefix='saving')
        self.display = FilmDisplay(self)
        self.parts = PartChange(self, self._mesh_version, self._saving, saving)
        self.publish()

    def _cleanup(self) -> None:
        super()._cleanup()
        self.parts.close()
        self._saving.shutdown()

    def _tasks(self) -> Mapping[str, Task]:
        return painting_tasks(self, self.display.details) | {'part': self.parts.status}

    def _points_on(self, surface: Surface) -> SurfacePoints:
        return surface.points()

    def _read_part(self) -> None:
        self._mesh_version = version_of(self.mesh_file)

    def _check(self, values: Mapping[str, Any]) -> None:
        super()._check(values)
        low, high = values['color_min_um'], values['color_max_um']
        if (low, high) != (0.0, 0.0) and low >= high:
            raise PaintError(
                f'color_min_um {low:g} is not below color_max_um {high:g}; both 0 is automatic'
            )

    def publish(self) -> None:
        """Publish the film if it has changed, or somebody does not have it yet."""
        self.up_to_date()
        film = self.film.up_to_date()
        changed, self._shown = film != self._shown, film
        self.display.show(film, changed, self.parts.part.run)

    async def _save_film(
        self, request: SaveFilm.Request, response: SaveFilm.Response
    ) -> SaveFilm.Response:
        """Write in a thread: poses keep coming meanwhile."""
        stem = request.name or time.strftime('film_%Y%m%d_%H%M%S')
        try:
            require_file_name('name', stem)
            self.up_to_date()
            write = film_to_save(self, Path(self.values['output_directory']), stem)
            paths = await self.in_a_thread(self._saving.submit(write))
        except Exception as error:  # the caller of the service gets it
            response.message = str(error)
            return response
        response.success = True
        response.paths = [str(path) for path in paths]
        response.message = f'wrote {", ".join(path.name for path in paths)}'
        return response

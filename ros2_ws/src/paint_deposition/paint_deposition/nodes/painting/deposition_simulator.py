"""Node `deposition_simulator`: the film on a part as the atomizer paints it."""

import time
from collections import Counter
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from paint_msgs.msg import Part
from paint_msgs.srv import SaveFilm
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.serialization import deserialize_message
from std_srvs.srv import Trigger

from paint_deposition.errors import PaintError
from paint_deposition.files.motion_files import read_gun_motions
from paint_deposition.files.recordings.bag_files import open_bag
from paint_deposition.files.recordings.mcap_recovery import recover
from paint_deposition.film.live_film import without_refused_states
from paint_deposition.motion.pose_stream import events_of
from paint_deposition.nodes.node import Task
from paint_deposition.nodes.painting.film_display import FilmDisplay, film_figures
from paint_deposition.nodes.painting.painting_node import PaintingNode
from paint_deposition.nodes.painting.painting_parameters import PAINTING
from paint_deposition.nodes.painting.part_change import PartChange, mesh_version
from paint_deposition.nodes.parameters import (
    CONFIGURED,
    DISPLAY,
    NodeParameter,
    fixed,
    require_display,
    require_file_name,
)
from paint_deposition.nodes.topics import POSE_TOPIC, STATE_TOPIC, gun_topic
from paint_deposition.report.write import write_film
from paint_deposition.request import MotionOptions

# After which what was sent before is in the file of a recorder [s].
RECORDED_S = 1.2


class DepositionSimulator(PaintingNode):
    """Paints a mesh from `atomizer/pose` and `atomizer/state` and publishes the film.

    Statistics and legend are latched. Mesh (a Marker), cloud and field are published while
    somebody subscribes, as often as the link allows. All include every pose received.

    Attributes:
        display: publishes the film.
        parts: the part in the cell, and its change.
    """

    NAME = 'deposition_simulator'
    PARAMETERS = PAINTING | {
        'publish_rate_hz': NodeParameter(
            5.0,
            'Rate of the statistics while the film changes, and highest rate of large messages '
            '[Hz]',
            (0.1, 30.0),
        ),
        **DISPLAY,
        **fixed(
            'its zones are found on the mesh once; clean the node up or restart it',
            CONFIGURED,
            zones_file=NodeParameter(
                '', 'Zones of the part with targets of their own, YAML; empty: none [path]'
            ),
        ),
        'resume_from': NodeParameter(
            '',
            'Recording of the part in the cell, finished or not, with which its film begins, as '
            'after a crash; empty: none [path]',
            fixed_because='it is painted before all that comes; restart the node',
        ),
        'output_directory': NodeParameter(
            'runs',
            'Where ~/save_film writes [path]',
            fixed_because='remote nodes must not choose where files are written; restart the node',
        ),
    }

    def _configure(self) -> Mapping[str, Task]:
        version = mesh_version(self.values['mesh_file'])
        tasks = super()._configure()
        # In a group of their own, so that poses do not wait for the disk.
        saving = ReentrantCallbackGroup()
        self.create_service(SaveFilm, '~/save_film', self._save_film, callback_group=saving)
        self._saving = ThreadPoolExecutor(max_workers=1, thread_name_prefix='saving')
        self.display = FilmDisplay(self)
        run = self.values['resume_from']
        told = self._resume(Path(run).expanduser()) if run else None
        self.parts = PartChange(self, version, self._saving, saving, told)
        self.publish()
        return {**tasks, 'part': self.parts.status}

    def _resume(self, run: Path) -> Part | None:
        """Paint what a recording has of the part, and nothing of it again.

        Returns:
            The part, if it was announced.

        Raises:
            PaintError: nothing can be read, or it is of another part.
        """
        time.sleep(RECORDED_S)
        guns = [gun for gun in self.gun_names if gun]
        topics = [
            [self.resolve_topic_name(gun_topic(gun, topic)) for gun in self.gun_names]
            for topic in (POSE_TOPIC, STATE_TOPIC)
        ]
        with TemporaryDirectory() as folder:
            copy = recover(run, Path(folder) / 'run')[0].folder
            with open_bag(copy) as bag:
                named = [topic.name for topic in bag.topics if topic.message_count]
                sent = [bag.sent_ns([topic]).values() for topic in topics[0]]
                told = [t.name for t in bag.topics_of('paint_msgs/msg/Part') if t.name in named]
                parts = [deserialize_message(m.cdr, Part) for m in bag.messages(told)]
            options = {'frame_id': self.frame.frame_id}
            if not guns:
                kinds = zip(('pose_topic', 'state_topic'), topics, strict=True)
                options |= {name: topic for name, (topic,) in kinds if topic in named}
            motions = read_gun_motions([copy], MotionOptions(**options), guns)
        part = parts[-1] if parts else None
        pose = list(self.values['part_pose'] or [])
        if part and (part.mesh_id, list(part.part_pose)) != (self.surface.mesh_id, pose):
            place = ' '.join(f'{value:g}' for value in part.part_pose) or 'none'
            raise PaintError(
                f'{run} is of {part.mesh_file} with the part_pose {place}: give these, and '
                'max_edge_length_m as before'
            )
        for source, gun, times, (_, motion) in zip(
            self.inputs, self.film.guns, sent, motions, strict=True
        ):
            gun.replay(events_of(without_refused_states(motion, gun.model)))
            source.recorded_sent_ns = max(times, default=-1)
            source.spraying = bool(gun.flow)
        return part

    def _cleanup(self) -> None:
        self.parts.close()
        self._saving.shutdown()
        super()._cleanup()

    def _validate(self, values: Mapping[str, Any], changed: set[str]) -> None:
        super()._validate(values, changed)
        require_display(values)

    def reset(self) -> Trigger.Response:
        """Clear the film and all counts; a new run begins, if there were poses."""
        if self.parts.changing:
            message = 'the part is being changed: call again after it'
            return Trigger.Response(success=False, message=message)
        self.catch_up()
        # First, since poses that come meanwhile are of the new run.
        if self.film.counts.received:
            self.parts.begin_again()
        return super().reset()

    def publish(self) -> None:
        """Publish the film if it has changed, or to new subscribers."""
        self.catch_up()
        film = self.film.snapshot()
        changed, self._shown = film != self._shown, film
        self.display.show(film, changed, self.parts.part.run)

    async def _save_film(
        self, request: SaveFilm.Request, response: SaveFilm.Response
    ) -> SaveFilm.Response:
        """Write in a thread, so that poses are taken meanwhile."""
        stem = request.name or time.strftime('film_%Y%m%d_%H%M%S')
        try:
            require_file_name('name', stem)
            self.catch_up()
            write = self.film_writer(Path(self.values['output_directory']), stem)
            paths = await self.result_of(self._saving.submit(write))
        except Exception as error:  # reported to the caller of the service
            response.message = str(error) or 'not enough memory'
            return response
        response.success = True
        response.paths = [str(path) for path in paths]
        response.message = f'wrote {", ".join(path.name for path in paths)}'
        return response

    def film_writer(
        self, folder: Path, stem: str, part: Mapping[str, Any] | None = None
    ) -> Callable[[], list[Path]]:
        """A function that writes the film as it is now and returns the paths; for any thread.

        Args:
            folder, stem: of the files.
            part: description of the part for the statistics file.
        """
        film, surface, zones = self.film.snapshot(), self.surface, self.zones
        values, names, files = dict(self.values), self.gun_names, self.files_in_use
        counts = [gun.counts.to_dict() for gun in self.film.guns]
        effects = (effect.id for gun in self.film.guns for effect in gun.model.effects)
        refused = sum((source.refused_frames for source in self.inputs), Counter[str]())
        details: dict[str, Any] = {
            'mesh_file': self.mesh_file,
            'mesh_id': surface.mesh_id,
            'frame_id': self.frame.frame_id,
            'down': surface.down,
            'model_file': files[0] if len({*files}) == 1 else '',
            'zones_file': values['zones_file'],
            'effects': list(dict.fromkeys(effects)),
            'poses': self.film.counts.to_dict(),
            'poses_in_other_frames': refused,
            **({'part': part} if part else {}),
        }

        def write() -> list[Path]:
            film_um = film.film_um
            figures, *by_gun = film_figures(values, surface, film, film_um, zones)
            details['atomizers'] = [
                {
                    'name': name, 'model_file': file, 'painted_volume_cm3': laid_cm3,
                    'share': share, 'emitted_volume_cm3': gun.used.emitted_cm3, 'poses': poses,
                }
                for name, file, laid_cm3, share, gun, poses in zip(
                    names, files, *by_gun, film.guns, counts, strict=True
                )
            ]  # fmt: skip
            if any(gun.model.brushes for gun in film.guns):
                details['paint'] = film.used.figures(figures.mean_um, figures.painted_volume_cm3)
            return write_film(
                folder, surface, film_um, figures, zones=zones, stem=stem,
                statistics_file=f'{stem}.json', details=details,
                color_range_um=(values['color_min_um'], values['color_max_um']),
            )  # fmt: skip

        return write

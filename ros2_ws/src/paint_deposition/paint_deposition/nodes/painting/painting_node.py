"""What the nodes that paint have in common: the part, the motion that comes in, the model."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any

import numpy as np
from rclpy.timer import Timer

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.effects.user_effects import read_effect_file, try_effect
from paint_deposition.errors import PaintError
from paint_deposition.files.meshes import read_mesh
from paint_deposition.film.integrator import FilmIntegrator
from paint_deposition.film.live_film import LiveFilm
from paint_deposition.motion.motion_log import PoseBatch
from paint_deposition.nodes.painting.atomizer_input import AtomizerInput
from paint_deposition.nodes.painting.frames import PartFrame
from paint_deposition.nodes.painting.real_time_factor import RealTimeFactor
from paint_deposition.nodes.painting.repainting import Repainting
from paint_deposition.nodes.runtime.model_parameters import read_chosen_model
from paint_deposition.nodes.runtime.paint_node import PaintNode
from paint_deposition.nodes.runtime.qos_watch import QosWatch
from paint_deposition.part.facing import facing, toward_the_gun
from paint_deposition.part.points import SurfacePoints
from paint_deposition.part.surface import Surface

TEND_PERIOD_S = 0.1
# So many poses that look at the part settle which side of an open surface is outward; after
# so many poses in all it stays as it is.
POSES_FACING = 50
POSES_CONSIDERED = 2000


class PaintingNode(PaintNode, ABC):
    """Paints points of a part with a model as the motion comes in.

    A subclass says which points, with ``_points_on``, and shows the film.

    Attributes:
        surface: the refined part.
        points: where it is painted.
        film: what is painted so far.
        input: what comes from the cell.
        watch: publishers and subscribers whose quality of service does not fit.
        real_time_factor: how long painting takes beside the motion.
        repainting: the changed model that is being prepared, if one is.
        model_problem: why the last model that was set is not used, '' if it is.
    """

    def __init__(self, name: str, **kwargs: Any):
        super().__init__(name, **kwargs)
        self.watch = QosWatch(self)
        self.input = AtomizerInput(self)
        self._shown: FilmIntegrator | None = None
        self.offer('~/reset', self._reset)
        self.create_steady_timer(TEND_PERIOD_S, self._tend)
        self._show_timer = self._new_show_timer()

    def _prepare(self) -> None:
        self.real_time_factor = RealTimeFactor()
        self.model_problem = ''
        self.repainting: Repainting | None = None
        self._facing_settled = False
        self._notes_told = 0
        self.frame = PartFrame(self, self.values['frame_id'])
        self._place_part()
        self._model = read_chosen_model(self.values)
        self._read_part()
        self._take_surface(self._read_surface())
        self.film = self._make_film(self._model)
        self.get_logger().info('getting ready; a model seen for the first time is compiled')
        self.film.warm_up()

    # --- for the subclass

    @abstractmethod
    def _points_on(self, surface: Surface) -> SurfacePoints:
        """The points of the part to paint."""

    def _read_part(self) -> None:
        """Read what is needed to choose the points, before the part is taken."""

    def _take_surface(self, surface: Surface) -> None:
        """Take the part, at the start and when the gun shows which side is outward."""
        self.surface = surface
        self.points = self._points_on(surface)
        for note in surface.notes[self._notes_told :]:
            self.get_logger().warning(note)
        self._notes_told = len(surface.notes)

    @abstractmethod
    def publish(self) -> None:
        """Publish the film, if it has changed."""

    # --- motion

    def add_poses(self, batch: PoseBatch) -> None:
        began_s = time.monotonic()
        self.film.add_poses(batch)
        self.real_time_factor.note(time.monotonic() - began_s, batch.stamps_ns)

    def reset(self) -> None:
        """Back to bare metal, all counts to zero."""
        self.input.reset()
        self.film.reset()
        if self.repainting is not None:
            self._repaint()

    def _reset(self) -> tuple[bool, str]:
        poses = self.film.counts.received
        self.reset()
        self._shown = None
        self.publish()
        return True, f'bare metal again; {poses} poses forgotten'

    def up_to_date(self) -> None:
        """Paint all poses that have come, and take over a film that has been prepared."""
        self.input.hand_on()
        self._tend()

    # --- the part and the model

    def _make_film(self, model: DepositionModel) -> LiveFilm:
        return LiveFilm(
            self.points,
            model,
            precision=self.values.get('precision', 'double'),
            occluder=self.surface.occluder,
            max_pose_gap_s=self.values['max_pose_gap_s'],
            trigger_latency_s=self.values['trigger_latency_s'],
            limit_poses=self.values['pose_memory'],
        )

    def _read_surface(self) -> Surface:
        values = self.values
        if not values['mesh_file']:
            raise PaintError(f"{self.get_name()}: mesh_file is empty: give the part's mesh")
        down = np.array(values['down']) if values['down'] else None
        return read_mesh(
            values['mesh_file'], values['mesh_scale'], values['max_edge_length_m'], down
        )

    def _check(self, values: Mapping[str, Any]) -> None:
        if values['part_pose'] and not values['part_parent_frame']:
            raise PaintError('part_pose is given without part_parent_frame: name its frame')

    def _check_change(self, values: Mapping[str, Any], names: set[str]) -> None:
        if 'max_pose_gap_s' in names and not self.film.log.complete:
            raise PaintError(
                f'max_pose_gap_s: the motion is longer than pose_memory '
                f'({self.film.log.limit_poses} poses) and cannot be painted again; reset first'
            )
        if 'model_file' in names:
            # Its effect files are tried out in the thread that repaints: poses must not wait.
            self._next_model = read_chosen_model(values, read_effect_file)

    def _changed(self, names: set[str]) -> None:
        if names & {'part_pose', 'part_parent_frame'}:
            self._place_part()
        if 'trigger_latency_s' in names:
            self.film.trigger_latency_s = self.values['trigger_latency_s']
        if 'model_file' in names:
            self._model = self._next_model
        if names & {'model_file', 'max_pose_gap_s'}:
            self._repaint(from_start=self.values['repaint'] or 'max_pose_gap_s' in names)
        if 'publish_rate_hz' in names:
            self.destroy_timer(self._show_timer)
            self._show_timer = self._new_show_timer()

    def _new_show_timer(self) -> Timer:
        return self.create_steady_timer(1.0 / self.values['publish_rate_hz'], self.publish)

    def _place_part(self) -> None:
        self.frame.place(self.values['part_parent_frame'], self.values['part_pose'])

    def _repaint(self, from_start: bool = True) -> None:
        """Prepare a film, in a thread, with the model and the values as they are now."""
        self._give_up_repainting()
        model = self._model

        def make() -> LiveFilm:
            for effect in model.effects:
                if effect.file is not None:
                    try_effect(type(effect), effect.file)
            return self._make_film(model)

        self.repainting = Repainting(self.film, make, from_start)

    def _tend(self) -> None:
        """Take over a film that is ready, and settle which side of the part is outward."""
        if self.repainting is not None and self.repainting.done:
            self._take_over(self.repainting)
        if not self._facing_settled:
            self._face_the_gun()

    def _take_over(self, repainting: Repainting) -> None:
        self.repainting = None
        self.model_problem = ''
        try:
            film = repainting.take_over(self.film)
        except (Exception, SystemExit) as error:  # of a user's effect; the old model goes on
            self.model_problem = f'the new model is not used: {error}'
            self.get_logger().error(self.model_problem)
            self._model = self.film.model
            return
        if film is None:
            self._repaint()
            return
        self.film = film

    def _face_the_gun(self) -> None:
        poses = self.film.log.first_poses(POSES_CONSIDERED)
        if poses is None:
            return
        finite = np.isfinite(poses.quaternions_xyzw).all(axis=1)
        finite &= np.isfinite(poses.positions_m).all(axis=1)
        x, y, z, w = poses.quaternions_xyzw[finite].T
        axes = np.stack(
            [2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)], axis=1
        )
        positions = poses.positions_m[finite]
        seen = facing(self.surface, positions, axes)
        faced = toward_the_gun(self.surface, positions, axes)
        if faced is not self.surface:
            self._take_surface(faced)
            turned = self._make_film(self.film.model)
            turned.follow(self.film.log.events)
            self.film = turned
            if self.repainting is not None:
                self._repaint()
        self._facing_settled = (
            seen.front + seen.back >= POSES_FACING or len(poses) >= POSES_CONSIDERED
        )

    def _give_up_repainting(self) -> None:
        if self.repainting is not None:
            self.repainting.give_up()
            self.repainting = None

    def destroy_node(self) -> None:
        self._give_up_repainting()
        super().destroy_node()

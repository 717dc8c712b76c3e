"""What the nodes that paint have in common: the part, the motion that comes in, the model."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Mapping
from functools import partial
from typing import Any

import numba
import numpy as np
from rclpy.timer import Timer

from paint_deposition.effects.user_effects import read_effect_file, try_effect
from paint_deposition.errors import PaintError
from paint_deposition.film.common_film import CommonFilm, LiveFilms
from paint_deposition.motion.pose_stream import PoseBatch, TriggerChange
from paint_deposition.nodes.painting.atomizer_input import AtomizerInput
from paint_deposition.nodes.painting.film_preparation import Repainting
from paint_deposition.nodes.painting.frames import PartFrame
from paint_deposition.nodes.painting.painting_parameters import (
    PreparedPart,
    bare_films,
    read_part,
    warm_up,
)
from paint_deposition.nodes.runtime.managed_node import ManagedNode
from paint_deposition.nodes.runtime.model_parameters import read_chosen_models
from paint_deposition.part.facing import facing, toward_the_gun
from paint_deposition.part.points import SurfacePoints
from paint_deposition.part.surface import Surface

TEND_PERIOD_S = 0.1
# Batches over which the real-time factor is taken.
BATCHES = 100
# So many poses that look at the part settle its outward side; after so many in all it stays.
POSES_FACING = 50
POSES_CONSIDERED = 2000
MODELS = {'model_file', 'model_files'}


class PaintingNode(ManagedNode, ABC):
    """Paints points of a part with a model as the motion comes in.

    A subclass says which points, with ``_points_on``, and shows the film.

    Attributes:
        gun_names: of the guns, one empty name for the only one.
        mesh_file: the part's mesh; surface: the same refined.
        points: where it is painted.
        models: of the guns, as the parameters choose them.
        film: what is painted so far, by one gun or several.
        inputs: what comes from the cell, one for each gun.
        repainting: the changed models that are being prepared, if any are.
        model_problem: why the last models that were set are not used, '' if they are.
    """

    repainting: Repainting | None = None
    model_problem = ''
    _notes_logged = 0
    _shown: CommonFilm | None = None

    def _configure(self) -> None:
        self.inputs = [
            AtomizerInput(
                self, name, self.frame, partial(self._add_poses, number),
                partial(self._add_trigger, number),
            )
            for number, name in enumerate(self.gun_names)
        ]  # fmt: skip
        if self.starts_itself:  # what comes until it has activated itself is painted
            self.hold()
        self._shown = None
        self.offer('~/reset', self.reset)
        self.create_steady_timer(TEND_PERIOD_S, self._tend)
        self._show_timer = self._new_show_timer()

    def _activate(self) -> None:
        self.release()

    def _deactivate(self) -> None:
        for source in self.inputs:
            source.take_waiting()

    def _cleanup(self) -> None:
        self._abort_repainting()

    def _prepare(self) -> None:
        # Motion comes in pieces of milliseconds: threads that wait for the next one would take
        # more of the processor than the painting. A thread that repaints shares its work.
        numba.set_num_threads(1)
        self.gun_names: list[str] = self.values['atomizers'] or ['']
        self.mesh_file: str = self.values['mesh_file']
        # (time spent on painting, time that the motion lasted) of the last batches of each gun.
        self._spans: list[deque[tuple[float, float]]] = [
            deque(maxlen=BATCHES) for _ in self.gun_names
        ]
        self.model_problem, self._notes_logged = '', 0
        self.frame = PartFrame(self, self.values['frame_id'])
        self._place_part()
        self.models = read_chosen_models(self.values)
        self._read_part()
        self._take_surface(read_part(self.values, self.mesh_file))
        self._may_turn = list(range(len(self.gun_names)))
        self.film = bare_films(self.surface, self.points, self.models, self.values)
        self.get_logger().info('getting ready; a model seen for the first time is compiled')
        warm_up(self.surface, self.film)

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
        for note in surface.notes[self._notes_logged :]:
            self.get_logger().warning(note)
        self._notes_logged = len(surface.notes)

    @abstractmethod
    def publish(self) -> None:
        """Publish the film, if it has changed."""

    # --- motion

    def _add_poses(self, gun: int, batch: PoseBatch) -> None:
        """Paint poses of a gun, by its number, while the node is active."""
        if not self.active:
            self.inputs[gun].not_painted(len(batch))
            return
        began_s = time.monotonic()
        self.film.guns[gun].add_poses(batch)
        spent_s = time.monotonic() - began_s
        steps_ns = np.diff(batch.stamps_ns)
        steps_ns = steps_ns[steps_ns > 0]
        if len(steps_ns):
            # One interval more than there are between the batch's own poses.
            lasted_s = float(np.median(steps_ns)) * len(batch) * 1e-9
            self._spans[gun].append((spent_s, lasted_s))

    def _add_trigger(self, gun: int, change: TriggerChange) -> None:
        self.film.guns[gun].add_trigger(change)

    @property
    def real_time_factor(self) -> float:
        """Time spent on painting over that of the motion; above 1 the node falls behind."""
        sums = [np.sum(spans, axis=0) for spans in self._spans if spans]
        return float(sum(spent_s / lasted_s for spent_s, lasted_s in sums))

    def hold(self) -> None:
        """Let the inputs keep what comes until `release`."""
        for source in self.inputs:
            source.hold()

    def release(self) -> None:
        """Paint what the inputs held."""
        for source in self.inputs:
            source.release()

    def take_part(self, mesh_file: str, part: PreparedPart) -> None:
        """Paint another part from bare metal on, as the guns are now; the counts begin anew.

        Raises:
            ModelError: the model does not have the brush that a gun sprays with.
        """
        film = part.film
        if any(new.model != now for new, now in zip(film.guns, self.models, strict=True)):
            film = bare_films(part.surface, part.points, self.models, self.values)
        for new, old in zip(film.guns, self.film.guns, strict=True):
            new.max_pose_gap_s = self.values['max_pose_gap_s']
            new.trigger_latency_s = self.values['trigger_latency_s']
            new.carry_on(old)
        for source in self.inputs:
            source.count_from_zero()
        self.mesh_file, self.surface, self.points = mesh_file, part.surface, part.points
        self.film, self._shown = film, None
        self._notes_logged = len(part.surface.notes)
        self._may_turn = list(range(len(self.gun_names)))
        if self.repainting is not None:
            self._repaint()

    def reset(self) -> tuple[bool, str]:
        """Back to bare metal, all counts to zero; what was done, in words."""
        poses = self.film.counts.received
        for source in self.inputs:
            source.reset()
        self.film.reset()
        if self.repainting is not None:
            self._repaint()
        self._shown = None
        self.publish()
        return True, f'bare metal again; {poses} poses forgotten'

    def up_to_date(self) -> None:
        """Paint all poses that have come, and take over films that have been prepared."""
        for source in self.inputs:
            source.take_waiting()
        self._tend()

    # --- the part and the model

    def _check(self, values: Mapping[str, Any]) -> None:
        if values['part_pose'] and not values['part_parent_frame']:
            raise PaintError('part_pose is given without part_parent_frame: name its frame')

    def _check_change(self, values: Mapping[str, Any], names: set[str]) -> None:
        if 'max_pose_gap_s' in names and not self.film.complete:
            memory = f'pose_memory ({self.values["pose_memory"]} poses)'
            raise PaintError(
                f'max_pose_gap_s: the motion is longer than {memory} and cannot be painted again; '
                'reset first'
            )
        if names & MODELS:
            # Their effect files are tried out in the thread that repaints: poses must not wait.
            self._next_models = read_chosen_models(values, read_effect_file)

    def _changed(self, names: set[str]) -> None:
        if names & {'part_pose', 'part_parent_frame'}:
            self._place_part()
        if 'trigger_latency_s' in names:
            for gun in self.film.guns:
                gun.trigger_latency_s = self.values['trigger_latency_s']
        if names & MODELS:
            self.models = self._next_models
        if names & {*MODELS, 'max_pose_gap_s'}:
            self._repaint(from_start=self.values['repaint'] or 'max_pose_gap_s' in names)
        if 'publish_rate_hz' in names:
            self.destroy_timer(self._show_timer)
            self._show_timer = self._new_show_timer()
        self._shown = None

    def _new_show_timer(self) -> Timer:
        return self.create_steady_timer(1.0 / self.values['publish_rate_hz'], self.publish)

    def _place_part(self) -> None:
        self.frame.place(self.values['part_parent_frame'], self.values['part_pose'])

    def _repaint(self, from_start: bool = True) -> None:
        """Prepare films, in a thread, with the models and the values as they are now."""
        self._abort_repainting()
        surface, points, models = self.surface, self.points, self.models

        def make() -> LiveFilms:
            for effect in (effect for model in models for effect in model.effects):
                if effect.file is not None:
                    try_effect(type(effect), effect.file)
            return bare_films(surface, points, models, self.values)

        self.repainting = Repainting(self.film, make, from_start)

    def _abort_repainting(self) -> None:
        if self.repainting is not None:
            self.repainting.abort()
            self.repainting = None

    def _tend(self) -> None:
        """Take over films that are ready, and settle which side of the part is outward."""
        if self.repainting is not None and self.repainting.done:
            self._take_over(self.repainting)
        if self._may_turn:
            self._turn(self._turned())

    def _take_over(self, repainting: Repainting) -> None:
        self.repainting = None
        self.model_problem = ''
        try:
            film = repainting.take_over(self.film)
        except (Exception, SystemExit) as error:  # of a user's effect; the old model stays
            self.model_problem = f'the new model is not used: {error}'
            self.get_logger().error(self.model_problem)
            self.models = tuple(gun.model for gun in self.film.guns)
            return
        if film is None:
            self._repaint()
        else:
            self.film = film

    def _turned(self) -> Surface:
        """The part with the side outward that the first gun wants whose poses look at it.

        As long as an earlier gun has not settled it, that one may still decide otherwise: which
        side is outward does not depend on whose poses came first.
        """
        for gun in tuple(self._may_turn):
            poses = self.film.guns[gun].log.first_poses(POSES_CONSIDERED)
            if poses is None:
                continue
            positions, axes = poses.finite_axes()
            seen = facing(self.surface, positions, axes)
            looking = seen.front + seen.back
            settled = looking >= POSES_FACING or len(poses) >= POSES_CONSIDERED
            if settled:
                self._may_turn.remove(gun)
            if looking:
                if settled:
                    self._may_turn = [earlier for earlier in self._may_turn if earlier < gun]
                return toward_the_gun(self.surface, positions, axes)
        return self.surface

    def _turn(self, faced: Surface) -> None:
        """Paint the motion so far on the part as it is turned now."""
        if faced is self.surface:
            return
        self._take_surface(faced)
        models = [gun.model for gun in self.film.guns]
        turned = bare_films(self.surface, self.points, models, self.values)
        for new, old in zip(turned.guns, self.film.guns, strict=True):
            new.follow(old.log.events())
        self.film = turned
        if self.repainting is not None:
            self._repaint()

"""The base class of the nodes that paint: the part, the incoming motion, the models."""

import threading
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from concurrent.futures import Future, InvalidStateError
from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np
from std_srvs.srv import Trigger

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import PaintError
from paint_deposition.files.effect_file import read_effect_file, try_effect
from paint_deposition.files.zones_file import read_zones
from paint_deposition.film.common_film import CommonFilm, LiveFilms
from paint_deposition.film.live_film import LiveFilm
from paint_deposition.motion.pose_stream import PoseBatch
from paint_deposition.motion.trajectory import BEFORE_ALL_NS
from paint_deposition.nodes.frames import PartFrame
from paint_deposition.nodes.managed_node import ManagedNode
from paint_deposition.nodes.node import Task
from paint_deposition.nodes.painting.atomizer_input import AtomizerInput
from paint_deposition.nodes.painting.health import film_status, poses_status
from paint_deposition.nodes.painting.painting_parameters import (
    PreparedPart,
    models_from_parameters,
    read_part,
)
from paint_deposition.nodes.topics import gun_topic
from paint_deposition.part.points import SurfacePoints
from paint_deposition.part.surface import Surface, facing, toward_the_guns

MODEL_PARAMETERS = {'model_file', 'model_files'}


class PaintingNode(ManagedNode, ABC):
    """Paints points of a part as poses and states arrive.

    A subclass selects the points with ``_points_on`` and publishes the film.

    Attributes:
        gun_names: names of the guns; one empty name for the only gun.
        mesh_file: the part's mesh; surface: the same, refined.
        zones: of its vertices, or None.
        points: the points that are painted.
        models: with which each gun paints; files_in_use: their files, '' for the default.
        film: the film so far, by one gun or several.
        inputs: the subscriptions, one for each gun.
        repainting: films with other models, once a thread has compiled these and repainted the
            motion so far; None if that is not under way.
        shares: of the guns in the film shown, 0 to 1, by their names.
        model_problem: why the models that were set last are not in use, '' if they are.
        side_problem: why the part is not painted on the side that the guns point at, '' if it is.
    """

    PRECISION = 'single'
    repainting: Future[LiveFilms] | None = None
    model_problem = side_problem = ''
    _shown: CommonFilm | None = None

    def _configure(self) -> Mapping[str, Task]:
        self.gun_names: list[str] = self.values['atomizers'] or ['']
        self.mesh_file: str = self.values['mesh_file']
        self.model_problem = ''
        self._noted: set[str] = set()
        self.shares: dict[str, float] = {}
        self.frame = PartFrame(self, self.values['frame_id'])
        self.frame.set_part_pose(self.values['part_parent_frame'], self.values['part_pose'])
        # Those that the parameters name, and those in use, which have been tried out.
        self._named_models = models_from_parameters(self.values)
        self.models, self.files_in_use = self._named_models
        self.get_logger().info('getting ready; a new model is compiled first')
        self._take_part(self.prepare(self.mesh_file))
        self.inputs = [AtomizerInput(self, number) for number in range(len(self.gun_names))]
        if self.autostarting:  # messages received before the node is active are painted
            self.hold()
        self._shown = None
        self.create_service(Trigger, '~/reset', lambda *_: self.reset())
        self.create_steady_timer(0.1, self._update)
        period_s = 1.0 / self.values['publish_rate_hz']
        self.show_timer = self.create_steady_timer(period_s, self.publish)
        poses = {
            gun_topic(source.name, 'poses'): partial(poses_status, self, number)
            for number, source in enumerate(self.inputs)
        }
        return {**poses, 'film': partial(film_status, self)}

    def _activate(self) -> None:
        self.release()

    def _deactivate(self) -> None:
        for source in self.inputs:
            source.take_pending()

    def _cleanup(self) -> None:
        if self.repainting is not None:
            self.repainting.cancel()
            self.repainting = None

    # --- for the subclass

    def _points_on(self, surface: Surface) -> tuple[Surface, SurfacePoints]:
        """The points of the part to paint, by default its vertices, and its surface with the side
        outward that they need.

        Raises:
            PaintError: they are not on the surface.
        """
        return surface, surface.points()

    def prepare(self, mesh_file: str) -> PreparedPart:
        """The part of a mesh, ready to be painted; a large one takes a second, in any thread.

        Raises:
            PaintError: mesh or zones cannot be read, or a zone has no vertex of the part.
        """
        values, zones = self.values, None
        surface, points = self._points_on(read_part(values, mesh_file))
        if values.get('zones_file'):
            zones = read_zones(values['zones_file'], mesh_file, values['mesh_scale']).on(surface)
        film = self._unpainted(surface, points, self.models)
        for gun in film.guns:
            gun.warm_up()
        facing(surface, np.zeros((1, 3)), np.eye(3)[2:])  # builds the tree for a gun's rays
        return surface, points, film, zones

    def _unpainted(
        self, surface: Surface, points: SurfacePoints, models: Iterable[DepositionModel]
    ) -> LiveFilms:
        """An unpainted film for the model of each gun."""
        named = ('max_pose_gap_s', 'trigger_latency_s', 'pose_memory')
        options: dict[str, Any] = {name: self.values[name] for name in named}
        options |= {'precision': self.PRECISION, 'occluder': surface}
        return LiveFilms(tuple(LiveFilm(points, model, **options) for model in models))

    def _take_part(self, part: PreparedPart) -> None:
        """Paint this part from now on."""
        self.surface, self.points, self.film, self.zones = part
        self._shown, self.side_problem = None, ''
        self._guns_to_orient = list(range(len(self.gun_names)))
        self._surface_changed()

    def _surface_changed(self) -> None:
        """Follow another surface, or the same turned inside out; its notes are said once."""
        for note in self.surface.notes:
            if note not in self._noted:
                self.get_logger().warning(note)
        self._noted |= {*self.surface.notes}

    @abstractmethod
    def publish(self) -> None:
        """Publish the film, if it has changed."""

    # --- motion

    def hold(self, after_ns: int = BEFORE_ALL_NS) -> None:
        """Keep poses and states that are sent later unprocessed until `release`."""
        for source in self.inputs:
            source.hold(after_ns)

    def release(self) -> None:
        """Process the poses and states that were held."""
        for source in self.inputs:
            source.release()

    def change_part(self, mesh_file: str, part: PreparedPart) -> None:
        """Start on another, unpainted part; the guns stay on or off, the counts are reset.

        Raises:
            ModelError: the model does not have the brush that a gun sprays with.
        """
        surface, points, film, zones = part
        if any(new.model != now for new, now in zip(film.guns, self.models, strict=True)):
            film = self._unpainted(surface, points, self.models)
        for new, old in zip(film.guns, self.film.guns, strict=True):
            new.trigger_latency_s = self.values['trigger_latency_s']
            new.reset(keeping_trigger_of=old)
        for source in self.inputs:
            source.reset_counts()
        self.mesh_file = mesh_file
        self._take_part((surface, points, film, zones))
        if self.repainting is not None:
            self._repaint()

    def reset(self) -> Trigger.Response:
        """Clear the film and all counts."""
        poses = self.film.counts.received
        for source in self.inputs:
            source.reset()
        self.film.reset()
        if self.repainting is not None:
            self._repaint()
        self._shown = None
        self.publish()
        message = f'bare metal again; {poses} poses forgotten'
        return Trigger.Response(success=True, message=message)

    def catch_up(self) -> None:
        """Paint all poses received, and adopt a repainted film if there is one."""
        for source in self.inputs:
            source.take_pending()
        self._update()

    # --- the part and the model

    def _validate(self, values: Mapping[str, Any], changed: set[str]) -> None:
        if values['part_pose'] and not values['part_parent_frame']:
            raise PaintError('part_pose is given without part_parent_frame: name its frame')
        if changed & MODEL_PARAMETERS:
            # Effect files are tested in the thread that repaints, so that poses do not wait.
            self._next_models = models_from_parameters(values, read_effect_file)

    def _on_change(self, names: set[str]) -> None:
        if names & {'part_pose', 'part_parent_frame'}:
            self.frame.set_part_pose(self.values['part_parent_frame'], self.values['part_pose'])
        if 'trigger_latency_s' in names:
            for gun in self.film.guns:
                gun.trigger_latency_s = self.values['trigger_latency_s']
        if names & MODEL_PARAMETERS:
            self._named_models = self._next_models
            self._repaint(from_start=self.values['repaint'])
        if 'publish_rate_hz' in names:
            self.show_timer.timer_period_ns = round(1e9 / self.values['publish_rate_hz'])
            self.show_timer.reset()
        self._shown = None

    def _repaint(self, from_start: bool = True) -> None:
        """Start to compile the models that were set last, and to repaint the motion, in a thread.

        Painting goes on meanwhile, in the films and their logs as they are.
        """
        if self.repainting is not None:
            self.repainting.cancel()
        surface, points, (models, _) = self.surface, self.points, self._named_models
        logs = [gun.log for gun in self.film.guns]
        prepared: Future[LiveFilms] = Future()

        def work() -> None:
            try:
                for effect in (effect for model in models for effect in model.effects):
                    if effect.file is not None:
                        try_effect(type(effect), effect.file)
                films = self._unpainted(surface, points, models)
                for film in films.guns:
                    film.warm_up()
                for film, log in zip(films.guns, logs, strict=True) if from_start else ():
                    # The rest is for the thread of the executor, which must not be blocked.
                    while log.poses - film.log.poses > 250 and log.complete:
                        for event in log.events(film.log.poses, film.log.changes):
                            if prepared.cancelled():
                                return
                            film.replay([event])
                prepared.set_result(films)
            except BaseException as error:  # raised again where the films are adopted
                with suppress(InvalidStateError):  # it was cancelled
                    prepared.set_exception(error)

        self.repainting, self._repainted_logs = prepared, logs if from_start else None
        threading.Thread(target=work, name='repainting', daemon=True).start()

    def _update(self) -> None:
        """Adopt a repainted film, and turn the part inside out if the guns point at its back."""
        if self.repainting is not None and self.repainting.done():
            self._adopt(self.repainting)
        oriented = self._toward_the_guns()
        if oriented is self.surface:
            return
        try:
            self.surface, self.points = self._points_on(oriented)
        except PaintError as error:  # readings that were taken on its other side, say
            self._guns_to_orient = []
            self.side_problem = f'the gun paints the other side of the part: {error}'
            self.get_logger().error(self.side_problem)
            return
        # The motion so far is painted again, with the other side outward.
        turned = self._unpainted(self.surface, self.points, self.models)
        for new, old in zip(turned.guns, self.film.guns, strict=True):
            new.replay(old.log.events())
        self.film = turned
        self._surface_changed()
        if self.repainting is not None:
            self._repaint()

    def _toward_the_guns(self) -> Surface:
        """The surface with its outward side toward the first gun that points at the part.

        An earlier gun may still overrule a later one, as long as its own poses have not decided:
        the side does not depend on whose poses arrive first.
        """
        most = 2000
        for number in tuple(self._guns_to_orient):
            events = self.film.guns[number].log.events()
            batches = [event for event in events if isinstance(event, PoseBatch)]
            if not batches:
                continue
            poses = PoseBatch.joined(batches).select(slice(most))
            positions, axes = poses.finite_axes()
            front, back, _ = facing(self.surface, positions, axes)
            pointing = front + back
            # So many that point at the part, or so many in all, have decided.
            decided = pointing >= 50 or len(poses) >= most
            if decided:
                self._guns_to_orient.remove(number)
            if pointing:
                if decided:
                    self._guns_to_orient = [g for g in self._guns_to_orient if g < number]
                return toward_the_guns(self.surface, [(positions, axes)])
        return self.surface

    def _adopt(self, prepared: Future[LiveFilms]) -> None:
        """Go on with the films that are prepared, or with the models where only they change."""
        self.repainting = None
        self.model_problem = ''
        guns, logs = self.film.guns, self._repainted_logs
        try:
            films = prepared.result()
            if logs is None or not all(log.complete for log in logs):
                for gun, film in zip(guns, films.guns, strict=True):
                    gun.require_brushes_in(film.model)  # before the first gun changes
                for gun, film in zip(guns, films.guns, strict=True):
                    gun.switch_model(film.model)
            elif any(gun.log is not log for gun, log in zip(guns, logs, strict=True)):
                self._repaint()  # the motion was restarted meanwhile
                return
            else:
                for film, gun in zip(films.guns, guns, strict=True):
                    film.replay(gun.log.events(film.log.poses, film.log.changes))
                self.film = films
        except (Exception, SystemExit) as error:  # of a user's effect; the old model stays
            self.model_problem = f'the new model is not used: {error}'
            self.get_logger().error(self.model_problem)
            self._named_models = self.models, self.files_in_use
            return
        self.models, self.files_in_use = self._named_models

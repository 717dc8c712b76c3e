"""Changing the part in the cell: the film is saved, and a new film and a new run begin."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from datetime import datetime, timezone
from pathlib import Path
from typing import TYPE_CHECKING

from paint_msgs.msg import Part
from paint_msgs.srv import ChangePart
from rclpy.callback_groups import CallbackGroup
from rclpy.duration import Duration
from rclpy.parameter import Parameter

from paint_deposition.errors import PaintError
from paint_deposition.film.integrator import NO_PAINT_UM
from paint_deposition.nodes import topics
from paint_deposition.nodes.node import ERROR, OK, WARN, Status
from paint_deposition.nodes.painting.painting_parameters import PreparedPart
from paint_deposition.nodes.parameters import require_file_name
from paint_deposition.nodes.topics import header, state_message

if TYPE_CHECKING:
    from paint_deposition.nodes.painting.deposition_simulator import DepositionSimulator

# Path, modification time [ns] and size of a mesh file; None where there is no such file.
Version = tuple[str, int | None, int | None]


def mesh_version(mesh_file: str) -> Version:
    """The current version of a mesh file, to notice changes."""
    try:
        status = os.stat(mesh_file)
    except OSError:
        return mesh_file, None, None  # the error is reported when it is read
    return mesh_file, status.st_mtime_ns, status.st_size


class PartChange:
    """Provides the service `~/change_part`, and publishes the latched `part`.

    Poses and states received while the next part's mesh is still being read wait for it.

    Args:
        node: paints the part.
        version: of the mesh of the part in the cell.
        saving: the thread that writes films.
        group: callback group of the service.
        part: that is in the cell already, as it was announced, if it was.

    Attributes:
        part: the part in the cell, as published.
        changing: whether a change is under way: the mesh of the next part is still being read.
    """

    def __init__(
        self,
        node: DepositionSimulator,
        version: Version,
        saving: ThreadPoolExecutor,
        group: CallbackGroup,
        part: Part | None = None,
    ) -> None:
        self._node, self._version, self._saving = node, version, saving
        self._folder = Path(node.values['output_directory'])
        self.part = part or Part(mesh_file=node.mesh_file, coat=1)
        # The run of the part and coat, and how often the film was reset since.
        self._run, self._resets = self.part.run, 0
        self._since = datetime.now(timezone.utc)
        present: Future[PreparedPart] = Future()
        present.set_result((node.surface, node.points, node.film, node.zones))
        self._parts = {version: present}
        self._reading = ThreadPoolExecutor(max_workers=1, thread_name_prefix='parts')
        self.changing = False
        self._gap_s = 0.0
        # Films of former parts that are not on disk yet, four at most, and why.
        self._unsaved: list[Callable[[], list[Path]]] = []
        self._save_error = ''
        node.create_steady_timer(
            10.0, lambda: self._save_error and self._saving.submit(self._save_films)
        )
        self._publisher = node.create_publisher(Part, topics.PART_TOPIC, topics.LATCHED)
        node.create_service(ChangePart, '~/change_part', self._answer, callback_group=group)
        if part:
            self._publisher.publish(part)

    def close(self) -> None:
        """Save the film if the part has a serial number, and those that could not be saved.

        Raises:
            PaintError: one cannot be saved; the part stays.
        """
        own = [self._film_writer()] if self.part.serial and self._node.film.counts.received else []
        self._unsaved += own
        self._saving.submit(self._save_films).result()
        if self._save_error:
            del self._unsaved[len(self._unsaved) - len(own) :]  # it may be painted on
            raise PaintError(self._save_error)
        self._reading.shutdown(cancel_futures=True)

    def status(self) -> Status:
        """The status of the part and of its last change, and whether paint lands on it."""
        part, film = self.part, self._node.film.snapshot()
        ready = [v[0] for v, kept in self._parts.items() if v != self._version and kept.done()]
        values = {
            'type': part.type or 'unknown',
            'serial number': part.serial or 'unknown',
            'coat': part.coat,
            'mesh': part.mesh_file,
            'since': self._since.isoformat(timespec='seconds'),
            'gap of the last change [ms]': f'{self._gap_s * 1e3:.1f}',
            'meshes prepared': ' '.join(ready) or 'none',
        }
        if self._save_error:
            return ERROR, self._save_error, values
        # A change that takes longer delays the first poses on the part.
        if self._gap_s > 0.05:
            late = f'the first poses of {part.run} waited {self._gap_s:.2f} s for its mesh'
            return WARN, f'{late}: prepare it before the part comes', values
        # Less paint may fly past before the part.
        emitted_cm3 = film.used.emitted_cm3
        if emitted_cm3 >= 5.0 and film.raw_um.max() <= NO_PAINT_UM:
            beside = (
                f'{emitted_cm3:.0f} cm3 were sprayed and nothing lands on the part: check '
                'part_pose, mesh_scale and the TCP, whose z axis points at the surface'
            )
            return WARN, beside, values
        return OK, part.run or 'the part has no serial number', values

    # --- the change

    async def _answer(
        self, request: ChangePart.Request, response: ChangePart.Response
    ) -> ChangePart.Response:
        try:
            if not request.prepare:
                response.success = not await self._change(request, response)
            elif request.mesh_file:
                mesh_file = os.path.expanduser(request.mesh_file)
                prepared = self._prepared(mesh_version(mesh_file))
                surface, *_ = await self._node.result_of(prepared)
                response.message = f'{mesh_file} is prepared: {surface!r}'
                response.success = True
            else:
                raise PaintError('prepare needs a mesh_file: name the mesh to read ahead of time')
        except OSError as error:
            response.message = f'{error.filename}: {error.strerror}'
        except Exception as error:  # of a user's effect, say: reported to the caller
            response.message = str(error) or 'not enough memory'
        return response

    async def _change(self, request: ChangePart.Request, response: ChangePart.Response) -> str:
        """Change the part; what of it failed after the part had changed, if anything."""
        node = self._node
        if self.changing:
            raise PaintError('another change of the part is under way: call again after it')
        if len(self._unsaved) >= 4:
            raise PaintError(f'{self._save_error}; the part stays until they are saved')
        following = self._requested(request)
        # Poses that are still in the queues belong to the previous part.
        node.catch_up()
        began_s = time.monotonic()
        following.last_sent_ns = max(source.sent_ns for source in node.inputs)
        guns = [source.name or 'the gun' for source in node.inputs if source.spraying]
        notes = [f'{gun} sprays while the part is changed' for gun in guns]
        self.changing = True
        try:
            notes += await self._receive_all(following.last_sent_ns)
            await self._begin(following, request)
            # After the part: a recorder then knows whose pose it is.
            unplaced = ''
            if len(request.part_pose):
                kind, values = Parameter.Type.DOUBLE_ARRAY, list(request.part_pose)
                placed = node.set_parameters_atomically([Parameter('part_pose', kind, values)])
                if not placed.successful:
                    unplaced = f'it stands where the part before did: {placed.reason}'
        finally:
            self.changing = False
            node.release()
        self._gap_s = response.gap_s = time.monotonic() - began_s
        response.run = following.run
        if self._unsaved:
            saved = await node.result_of(self._saving.submit(self._save_films))
            response.paths = [str(path) for path in saved]
            notes.append(f'wrote {", ".join(response.paths)}' if saved else '')
        called = following.serial + (f' ({following.type})' if following.type else '')
        done = f'coat {following.coat} on {called}: on top of the film so far'
        if not request.coat:
            ready = f'bare metal, ready after {self._gap_s * 1e3:.0f} ms'
            done = f'{called} on {following.mesh_file}: {ready}'
        notes += [self._save_error, unplaced]
        response.message = '; '.join(filter(None, [done, *notes]))
        node.get_logger().info(response.message)
        return unplaced

    async def _begin(self, following: Part, request: ChangePart.Request) -> None:
        """Begin on the part that follows, or on another coat."""
        node, since_ns = self._node, self._newest_ns()
        version, part = mesh_version(following.mesh_file), None
        if not request.coat:
            read = self._prepared(version)
            part = read.result() if read.done() else await node.result_of(read)
        writers = [self._film_writer()] if node.film.counts.received else []
        if part is not None:
            node.change_part(version[0], part)
            self._version = version
        self._unsaved += writers
        self.part, self._since = following, datetime.now(timezone.utc)
        self._run, self._resets = following.run, 0
        self._publish(since_ns, request.part_pose)

    async def _receive_all(self, last_sent_ns: int) -> list[str]:
        """Paint what was sent until then, and keep what was sent later.

        Returns:
            A note, if a subscriber of the part has stalled.
        """
        node = self._node
        if len(node.inputs) > 1:
            node.hold(last_sent_ns)
            await self._settled()
        node.hold()
        # Poses that wait for their transform are of the former part; it comes, or is given up.
        while any(len(source.tf_queue) for source in node.inputs):
            await self._settled()
        # The message of the part is latched, and the next one takes its place.
        heard_s = time.monotonic() + 3.0
        while not self._is_heard() and time.monotonic() < heard_s:
            await self._settled()
        node.catch_up()
        if self._is_heard():
            return []
        return ['a subscriber of part has stalled, and may miss a part']

    def _requested(self, request: ChangePart.Request) -> Part:
        """The part that the request describes.

        Raises:
            PaintError: the request is inconsistent, or the run already exists.
        """
        require_file_name('serial', request.serial)
        pose = list(request.part_pose)
        self._node.PARAMETERS['part_pose'].checked('part_pose', pose)
        if pose and not self._node.values['part_parent_frame']:
            raise PaintError('part_pose is given, and the parameter part_parent_frame is empty')
        part, mesh_file = self.part, os.path.expanduser(request.mesh_file) or self.part.mesh_file
        following = Part(type=request.type, serial=request.serial, mesh_file=mesh_file, coat=1)
        following.run = request.serial
        if request.coat:
            if not part.serial:
                raise PaintError(
                    'coat: the part in the cell has no serial number yet: announce it without coat'
                )
            same_mesh = os.path.realpath(mesh_file) == os.path.realpath(part.mesh_file)
            if request.serial != part.serial or not same_mesh:
                raise PaintError(
                    f"coat: the part in the cell is '{part.serial}' of {part.mesh_file}, not "
                    f"'{request.serial}' of {mesh_file}: a further coat needs the same part"
                )
            following.type, following.coat = request.type or part.type, part.coat + 1
            following.run = f'{part.serial}_coat_{following.coat}'
        elif request.serial == part.serial:
            raise PaintError(
                f"serial '{part.serial}' is the part in the cell: set coat: true for another "
                'coat on it, or give the serial number of the next part'
            )
        folder = self._folder / following.run
        if folder.exists():
            raise PaintError(
                f'{folder} already exists: a part has one run for each coat, and none is '
                'overwritten; give another serial, or move the folder away'
            )
        return following

    async def _settled(self) -> None:
        """Wait for messages that were sent before now."""
        settled: Future[None] = Future()
        threading.Timer(0.03, settled.set_result, [None]).start()
        await self._node.result_of(settled)

    def begin_again(self) -> None:
        """Begin another run of the part, whose film was reset."""
        self._resets += 1
        if self._run:
            self.part.run = f'{self._run}_reset_{self._resets}'
        self.part.last_sent_ns = max(source.sent_ns for source in self._node.inputs)
        self._is_heard(within_s=1.0)
        self._publish(self._newest_ns(), ())

    def _is_heard(self, within_s: float = 0.0) -> bool:
        """Whether all subscribers have the newest message of the part."""
        return self._publisher.wait_for_all_acked(Duration(seconds=within_s))

    def _newest_ns(self) -> int:
        """Stamp of the newest pose of the part in the cell; without any the time now."""
        newest_ns = max(source.newest_ns for source in self._node.inputs)
        return newest_ns or self._node.get_clock().now().nanoseconds

    # --- parts, files and messages

    def _prepared(self, version: Version) -> Future[PreparedPart]:
        """The part of this mesh, which is read unless it is kept."""
        part = self._parts.pop(version, None)
        if part is None or (part.done() and part.exception()):
            self._node.require_named_folder(version[0])
            part = self._reading.submit(self._node.prepare, version[0])
        self._parts[version] = part
        others = [kept for kept in self._parts if kept not in (version, self._version)]
        # A large one takes some 100 MB.
        for kept in others[: max(len(others) - 4, 0)]:
            del self._parts[kept]
        return part

    def _film_writer(self) -> Callable[[], list[Path]]:
        part, node = self.part, self._node
        if not part.serial:
            return node.film_writer(self._folder, time.strftime('film_%Y%m%d_%H%M%S'))
        described = {
            **{name: getattr(part, name) for name in ('type', 'serial', 'coat', 'run')},
            'since': self._since.isoformat(timespec='milliseconds'),
            'until': datetime.now(timezone.utc).isoformat(timespec='milliseconds'),
            'part_pose': list(node.values['part_pose'] or []),
            'gap_s': self._gap_s,
        }
        return node.film_writer(self._folder / part.run, 'film', described)

    def _save_films(self) -> list[Path]:
        """Save the films that are not on disk, the oldest first, in the thread for that."""
        paths: list[Path] = []
        try:
            while self._unsaved:
                paths += self._unsaved[0]()
                del self._unsaved[0]
            self._save_error = ''
        except (PaintError, OSError, MemoryError) as error:
            films = f'the films of {len(self._unsaved)} former parts are not saved, and kept'
            self._save_error = f'{films}: {str(error) or "not enough memory"}'
            self._node.get_logger().error(self._save_error)
        return paths

    def _publish(self, since_ns: int, part_pose: Sequence[float]) -> None:
        part, node = self.part, self._node
        part.header = header(node.frame.frame_id, since_ns)
        part.mesh_id = node.surface.mesh_id
        part.part_parent_frame = node.values['part_parent_frame']
        part.part_pose = list(part_pose) or list(node.values['part_pose'] or [])
        part.guns = [*node.gun_names]
        part.states_sent_ns = [source.state_sent_ns for source in node.inputs]
        part.states = [
            state_message(
                header=header(name, change.stamp_ns), spraying=change.flow > 0.0,
                flow=change.flow, brush=change.brush,
            )
            for name, gun in zip(part.guns, node.film.guns, strict=True)
            for change in gun.carried_over
        ]  # fmt: skip
        self._publisher.publish(part)

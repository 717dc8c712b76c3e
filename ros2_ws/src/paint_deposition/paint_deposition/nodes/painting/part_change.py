"""Another part comes into the cell: a new film and a new run, and the old film is saved."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from datetime import datetime, timezone
from pathlib import Path

from paint_msgs.msg import Part
from paint_msgs.srv import ChangePart
from rclpy.callback_groups import CallbackGroup
from rclpy.parameter import Parameter

from paint_deposition.errors import PaintError
from paint_deposition.nodes.painting.film_files import film_to_save
from paint_deposition.nodes.painting.painting_node import PaintingNode
from paint_deposition.nodes.painting.painting_parameters import (
    PreparedPart,
    bare_films,
    read_part,
    warm_up,
)
from paint_deposition.nodes.runtime import topics
from paint_deposition.nodes.runtime.messages import header
from paint_deposition.nodes.runtime.node import ERROR, OK, WARN, Status
from paint_deposition.nodes.runtime.parameters import require_file_name

# Longer than this, the first poses on a part are painted late.
LATE_S = 0.05
# Parts that are kept beside the one in the cell; a large one takes some 100 MB.
MOST_KEPT = 4
# A mesh file, when it was changed [ns], its size; None where there is no such file.
Version = tuple[str, int | None, int | None]


def version_of(mesh_file: str) -> Version:
    """The file as it is now; another version is another shape."""
    try:
        status = os.stat(mesh_file)
    except OSError:
        return mesh_file, None, None  # reading it says what is wrong
    return mesh_file, status.st_mtime_ns, status.st_size


class PartChange:
    """Answers `~/change_part` of a simulator, and publishes the latched `part`.

    Poses and states that come while the next part's mesh is still being read wait for it.

    Args:
        node: paints the part, and shows it.
        version: of the mesh of the part that is in the cell.
        saving: the thread that writes films.
        group: of the service.

    Attributes:
        part: the one in the cell, as it was announced.
        waiting: whether the mesh of the next one is still being read.
    """

    def __init__(
        self,
        node: PaintingNode,
        version: Version,
        saving: ThreadPoolExecutor,
        group: CallbackGroup,
    ) -> None:
        self._node, self._version, self._saving = node, version, saving
        self.part = Part(mesh_file=node.mesh_file, coat=1)
        self._since = datetime.now(timezone.utc)
        present: Future[PreparedPart] = Future()
        present.set_result(PreparedPart(node.surface, node.points, node.film))
        self._kept = {version: present}
        self._reading = ThreadPoolExecutor(max_workers=1, thread_name_prefix='parts')
        self.waiting = False
        self._gap_s = 0.0
        self._unsaved = ''
        self._publisher = node.create_publisher(Part, topics.PART_TOPIC, topics.LATCHED)
        node.create_service(ChangePart, '~/change_part', self._answer, callback_group=group)

    def close(self) -> None:
        """Save the film of a part that has a serial number."""
        self._reading.shutdown(cancel_futures=True)
        if self.part.serial and self._node.film.counts.received:
            self._film_to_save()()

    def status(self) -> Status:
        """The part, and how the last change went."""
        part = self.part
        ready = [v[0] for v, kept in self._kept.items() if v != self._version and kept.done()]
        values = {
            'type': part.type or 'unknown',
            'serial number': part.serial or 'unknown',
            'coat': part.coat,
            'mesh': part.mesh_file,
            'since': self._since.isoformat(timespec='seconds'),
            'gap of the last change [ms]': f'{self._gap_s * 1e3:.1f}',
            'meshes prepared': ' '.join(ready) or 'none',
        }
        if self._unsaved:
            return Status(ERROR, self._unsaved, values)
        if self._gap_s > LATE_S:
            late = f'the first poses of {part.run} waited {self._gap_s:.2f} s for its mesh'
            return Status(WARN, f'{late}: prepare it before the part comes', values)
        return Status(OK, part.run or 'the part has no serial number', values)

    # --- the change

    async def _answer(
        self, request: ChangePart.Request, response: ChangePart.Response
    ) -> ChangePart.Response:
        try:
            await (self._read_ahead if request.prepare else self._change)(request, response)
            response.success = True
        except PaintError as error:
            response.message = str(error)
        except OSError as error:
            response.message = f'{error.filename}: {error.strerror}'
        return response

    async def _read_ahead(
        self, request: ChangePart.Request, response: ChangePart.Response
    ) -> None:
        if not request.mesh_file:
            raise PaintError('prepare without a mesh_file: name the mesh to read ahead of time')
        mesh_file = os.path.expanduser(request.mesh_file)
        part = await self._node.in_a_thread(self._prepared(version_of(mesh_file)))
        response.message = f'{mesh_file} is prepared: {part.surface!r}'

    async def _change(self, request: ChangePart.Request, response: ChangePart.Response) -> None:
        node = self._node
        if self.waiting:
            raise PaintError('another part is being changed: ask again when it is there')
        following = self._requested(request)
        # A request overtakes poses that wait; they belong to the part before.
        node.up_to_date()
        began_s = time.monotonic()
        guns = [source.name or 'the gun' for source in node.inputs if source.sprays]
        notes = [f'{gun} sprays while the part is changed' for gun in guns]
        save = self._film_to_save() if node.film.counts.received else None
        try:
            version = version_of(following.mesh_file)
            ready = None if request.coat else await self._ready(version)
            self._put_in_place(version, ready, request.part_pose)
        finally:
            node.release()
        self.part, self._since = following, datetime.now(timezone.utc)
        self._gap_s = response.gap_s = time.monotonic() - began_s
        self._publish()
        response.run = following.run
        if save is not None:
            response.paths = await self._saved(save)
            notes.append(f'wrote {", ".join(response.paths)}')
        response.message = '; '.join([self._sentence(), *notes])
        node.get_logger().info(response.message)

    def _requested(self, request: ChangePart.Request) -> Part:
        """The part that the request describes.

        Raises:
            PaintError: it cannot be, or its run is there already.
        """
        require_file_name('serial', request.serial)
        part, mesh_file = self.part, os.path.expanduser(request.mesh_file) or self.part.mesh_file
        following = Part(type=request.type, serial=request.serial, mesh_file=mesh_file, coat=1)
        following.run = request.serial
        if request.coat:
            if (request.serial, mesh_file) != (part.serial, part.mesh_file):
                raise PaintError(
                    f"coat: the part in the cell is '{part.serial}' of {part.mesh_file}, not "
                    f"'{request.serial}' of {mesh_file}: a further coat can only lie on the part "
                    'that is there'
                )
            following.type, following.coat = request.type or part.type, part.coat + 1
            following.run = f'{part.serial}_coat_{following.coat}'
        if following.run == part.run:
            raise PaintError(
                f"serial '{part.serial}' is the part in the cell: say coat: true for another "
                'coat on it, or give the serial number of the next part'
            )
        folder = self._folder(following.run)
        if folder.exists():
            raise PaintError(
                f'{folder} is there already: a part has one run for each coat, and none is '
                'overwritten; give another serial, or move the folder away'
            )
        return following

    async def _ready(self, version: Version) -> PreparedPart:
        """The part of this mesh; the inputs hold what comes while it is read."""
        read = self._prepared(version)
        if read.done():
            return read.result()
        self.waiting = True
        self._node.hold()
        try:
            return await self._node.in_a_thread(read)
        finally:
            self.waiting = False

    def _put_in_place(
        self, version: Version, ready: PreparedPart | None, part_pose: Sequence[float]
    ) -> None:
        """Set the part's pose, if one is given, and take the bare part, if it is another one."""
        pose = list(self._node.values['part_pose'] or [])
        if len(part_pose):
            self._set_pose(list(part_pose))
        if ready is None:
            return
        try:
            self._node.take_part(version[0], ready)
        except PaintError:
            self._set_pose(pose)
            raise
        self._version = version

    def _set_pose(self, part_pose: list[float]) -> None:
        change = Parameter('part_pose', Parameter.Type.DOUBLE_ARRAY, part_pose)
        result = self._node.set_parameters_atomically([change])
        if not result.successful:
            raise PaintError(result.reason)

    def _sentence(self) -> str:
        part = self.part
        called = part.serial + (f' ({part.type})' if part.type else '')
        if part.coat > 1:
            return f'coat {part.coat} on {called}: on top of the film so far'
        gap_ms = self._gap_s * 1e3
        return f'{called} on {part.mesh_file}: bare metal, ready after {gap_ms:.0f} ms'

    # --- parts, files and messages

    def _prepared(self, version: Version) -> Future[PreparedPart]:
        """The part of this mesh; it is read unless it has been."""
        part = self._kept.pop(version, None)
        if part is None or (part.done() and part.exception()):
            part = self._reading.submit(self._prepare, version[0])
        self._kept[version] = part
        others = [kept for kept in self._kept if kept not in (version, self._version)]
        for kept in others[: max(len(others) - MOST_KEPT, 0)]:
            del self._kept[kept]
        return part

    def _prepare(self, mesh_file: str) -> PreparedPart:
        """Read a part that is to come; in a thread of its own."""
        node = self._node
        surface = read_part(node.values, mesh_file)
        points = surface.points()
        film = bare_films(surface, points, node.models, node.values)
        warm_up(surface, film)
        return PreparedPart(surface, points, film)

    def _folder(self, run: str) -> Path:
        return Path(self._node.values['output_directory']).expanduser() / run

    def _film_to_save(self) -> Callable[[], list[Path]]:
        part, node = self.part, self._node
        if not part.serial:
            return film_to_save(node, self._folder(''), time.strftime('film_%Y%m%d_%H%M%S'))
        described = {
            **{name: getattr(part, name) for name in ('type', 'serial', 'coat', 'run')},
            'since': self._since.isoformat(timespec='milliseconds'),
            'until': datetime.now(timezone.utc).isoformat(timespec='milliseconds'),
            'part_pose': list(node.values['part_pose'] or []),
            'gap_s': self._gap_s,
        }
        return film_to_save(node, self._folder(part.run), 'film', described)

    async def _saved(self, save: Callable[[], list[Path]]) -> list[str]:
        try:
            paths = await self._node.in_a_thread(self._saving.submit(save))
        except (PaintError, OSError) as error:
            self._unsaved = f'the film of the part before is not saved: {error}'
            self._node.get_logger().error(self._unsaved)
            raise PaintError(f'{self._sentence()}; {self._unsaved}') from None
        self._unsaved = ''
        return [str(path) for path in paths]

    def _publish(self) -> None:
        part, node = self.part, self._node
        part.header = header(node.frame.frame_id, node.get_clock().now().nanoseconds)
        part.mesh_id = node.surface.mesh_id
        part.part_parent_frame = node.values['part_parent_frame']
        part.part_pose = list(node.values['part_pose'] or [])
        self._publisher.publish(part)

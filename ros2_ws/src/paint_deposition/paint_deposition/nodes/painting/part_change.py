"""Another part comes into the cell: a new film and a new run, and the old film is saved."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from datetime import datetime, timezone
from pathlib import Path

from paint_msgs.msg import Part as PartMessage
from paint_msgs.srv import ChangePart
from rclpy.callback_groups import CallbackGroup
from rclpy.parameter import Parameter

from paint_deposition.errors import PaintError
from paint_deposition.film.common_film import LiveFilms
from paint_deposition.nodes.painting.film_display import FilmDisplay
from paint_deposition.nodes.painting.film_files import film_to_save
from paint_deposition.nodes.painting.film_preparation import index_facing
from paint_deposition.nodes.painting.painting_node import PaintingNode
from paint_deposition.nodes.painting.painting_parameters import bare_films, read_part
from paint_deposition.nodes.runtime import topics
from paint_deposition.nodes.runtime.node import ERROR, OK, WARN, Status
from paint_deposition.nodes.runtime.parameters import require_file_name
from paint_deposition.part.points import SurfacePoints
from paint_deposition.part.surface import Surface

# Longer than this, the first poses on a part are painted late.
LATE_S = 0.05
# Parts that are kept beside the one in the cell; a large one takes some 100 MB.
MOST_KEPT = 4
# A mesh file, when it was changed [ns], its size; None where there is no such file.
Version = tuple[str, int | None, int | None]


@dataclass(frozen=True)
class Part:
    """The part in the cell, as it was announced.

    Attributes:
        mesh_file: its mesh.
        type: what the cell calls its kind, '' where nobody said; serial: likewise.
        coat: 1 for the first coat on it.
        since: when it came.
    """

    mesh_file: str
    type: str = ''
    serial: str = ''
    coat: int = 1
    since: datetime = field(default_factory=lambda: datetime.now(timezone.utc))

    @property
    def run(self) -> str:
        """The folder of its run, '' for a part without a serial number."""
        return self.serial if self.coat == 1 else f'{self.serial}_coat_{self.coat}'


@dataclass(frozen=True)
class PreparedPart:
    """A part that can be painted at once: its refined surface, the points on it, a film."""

    surface: Surface
    points: SurfacePoints
    film: LiveFilms


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
        node: paints the part. display: shows it.
        version: of the mesh of the part that is in the cell.
        group: of the service.

    Attributes:
        part: the one in the cell.
        waiting: whether the mesh of the next one is still being read.
    """

    def __init__(
        self, node: PaintingNode, display: FilmDisplay, version: Version, group: CallbackGroup
    ) -> None:
        self._node, self._display, self._version = node, display, version
        self.part = Part(node.mesh_file)
        present: Future[PreparedPart] = Future()
        present.set_result(PreparedPart(node.surface, node.points, node.film))
        self._kept = {version: present}
        self._reading = ThreadPoolExecutor(max_workers=1, thread_name_prefix='parts')
        self._saving = ThreadPoolExecutor(max_workers=1, thread_name_prefix='saving parts')
        self.waiting = False
        self._gap_s = 0.0
        self._unsaved = ''
        self._publisher = node.create_publisher(PartMessage, topics.PART_TOPIC, topics.LATCHED)
        node.create_service(ChangePart, '~/change_part', self._answer, callback_group=group)

    def close(self) -> None:
        """Save the film of a part that has a serial number."""
        self._reading.shutdown(cancel_futures=True)
        if self.part.serial and self._node.film.counts.received:
            self._film_to_save()()
        self._saving.shutdown()

    def status(self) -> Status:
        """The part, and how the last change went."""
        part = self.part
        ready = [v[0] for v, kept in self._kept.items() if v != self._version and kept.done()]
        values = {
            'type': part.type or 'unknown',
            'serial number': part.serial or 'unknown',
            'coat': part.coat,
            'mesh': part.mesh_file,
            'since': part.since.isoformat(timespec='seconds'),
            'gap of the last change [ms]': f'{self._gap_s * 1e3:.1f}',
            'meshes prepared': ' '.join(ready) or 'none',
        }
        if self._unsaved:
            return Status(ERROR, self._unsaved, values)
        if self._gap_s > LATE_S:
            return Status(
                WARN,
                f'the first poses of {part.run} waited {self._gap_s:.2f} s for its mesh: prepare '
                'it before the part comes',
                values,
            )
        return Status(OK, part.run or 'the part has no serial number', values)

    # --- the change

    async def _answer(
        self, request: ChangePart.Request, response: ChangePart.Response
    ) -> ChangePart.Response:
        try:
            if request.prepare:
                await self._read_ahead(request, response)
            else:
                await self._change(request, response)
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
        notes = [
            f'{source.name or "the gun"} sprays while the part is changed'
            for source in node.inputs
            if source.sprays
        ]
        save = self._film_to_save() if node.film.counts.received else None
        try:
            version = version_of(following.mesh_file)
            ready = None if request.coat else await self._ready(version)
            self._put_in_place(version, ready, request.part_pose)
        finally:
            node.release()
        self.part = following
        self._gap_s = response.gap_s = time.monotonic() - began_s
        self._publish()
        response.run = self.part.run
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
        if request.coat:
            if request.serial != part.serial or mesh_file != part.mesh_file:
                raise PaintError(
                    f"coat: the part in the cell is '{part.serial}' of {part.mesh_file}, not "
                    f"'{request.serial}' of {mesh_file}: a further coat can only lie on the part "
                    'that is there'
                )
            following = Part(mesh_file, request.type or part.type, part.serial, part.coat + 1)
        else:
            following = Part(mesh_file, request.type, request.serial)
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
        for source in self._node.inputs:
            source.hold()
        try:
            return await self._node.in_a_thread(read)
        finally:
            self.waiting = False

    def _put_in_place(
        self, version: Version, ready: PreparedPart | None, part_pose: Sequence[float]
    ) -> None:
        """Set the part's pose, if one is given, and take the bare part, if it is another one."""
        node = self._node
        pose = list(node.values['part_pose'] or [])
        if len(part_pose):
            self._set_pose(list(part_pose))
        if ready is None:
            return
        try:
            node.take_part(version[0], ready.surface, ready.points, ready.film)
        except PaintError:
            self._set_pose(pose)
            raise
        self._version = version
        self._display.take(ready.surface)

    def _set_pose(self, part_pose: list[float]) -> None:
        change = Parameter('part_pose', Parameter.Type.DOUBLE_ARRAY, part_pose)
        result = self._node.set_parameters_atomically([change])
        if not result.successful:
            raise PaintError(result.reason)

    def _sentence(self) -> str:
        part = self.part
        called = f' ({part.type})' if part.type else ''
        if part.coat > 1:
            return f'coat {part.coat} on {part.serial}{called}: on top of the film so far'
        return (
            f'{part.serial}{called} on {part.mesh_file}: bare metal, ready after '
            f'{self._gap_s * 1e3:.0f} ms'
        )

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
        film.warm_up()
        index_facing(surface)
        return PreparedPart(surface, points, film)

    def _folder(self, run: str) -> Path:
        return Path(self._node.values['output_directory']).expanduser() / run

    def _film_to_save(self) -> Callable[[], list[Path]]:
        part, node = self.part, self._node
        mesh_id = self._display.of(node.surface).mesh_id
        if not part.serial:
            stem = time.strftime('film_%Y%m%d_%H%M%S')
            return film_to_save(node, mesh_id, self._folder(''), stem)
        described = {
            'type': part.type,
            'serial': part.serial,
            'coat': part.coat,
            'run': part.run,
            'since': part.since.isoformat(timespec='milliseconds'),
            'until': datetime.now(timezone.utc).isoformat(timespec='milliseconds'),
            'part_pose': list(node.values['part_pose'] or []),
            'gap_s': self._gap_s,
        }
        return film_to_save(node, mesh_id, self._folder(part.run), 'film', described)

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
        message = PartMessage(
            type=part.type,
            serial=part.serial,
            coat=part.coat,
            run=part.run,
            mesh_file=part.mesh_file,
            mesh_id=self._display.of(node.surface).mesh_id,
            part_parent_frame=node.values['part_parent_frame'],
            part_pose=list(node.values['part_pose'] or []),
        )
        message.header.frame_id = node.frame.frame_id
        message.header.stamp = node.get_clock().now().to_msg()
        self._publisher.publish(message)

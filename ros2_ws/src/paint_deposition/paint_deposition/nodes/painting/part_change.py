"""Another part comes into the cell: a new film and a new run, and the old film is saved."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from datetime import datetime, timezone
from pathlib import Path
from typing import TYPE_CHECKING, Any

from paint_msgs.msg import Part as PartMessage
from paint_msgs.srv import ChangePart
from rclpy.callback_groups import CallbackGroup
from rclpy.parameter import Parameter

from paint_deposition.errors import PaintError
from paint_deposition.nodes.painting.film_files import film_to_save
from paint_deposition.nodes.painting.parts import Part, PreparedPart, PreparedParts
from paint_deposition.nodes.runtime import qos
from paint_deposition.nodes.runtime.diagnostics import ERROR, OK, WARN, Status
from paint_deposition.nodes.runtime.file_names import require_file_name
from paint_deposition.nodes.runtime.messages import PART_TOPIC

if TYPE_CHECKING:
    from paint_deposition.nodes.painting.deposition_simulator import DepositionSimulator

# Longer than this, the first poses on a part are painted late.
LATE_S = 0.05


class PartChange:
    """Answers `~/change_part` of a simulator, and publishes the latched `part`.

    Poses and states that come while the next part's mesh is still being read wait for it.

    Attributes:
        part: the one in the cell.
        waiting: whether the mesh of the next one is still being read.
    """

    def __init__(self, node: DepositionSimulator, group: CallbackGroup) -> None:
        self._node = node
        self.part = Part(node.mesh_file)
        self._parts = PreparedParts(self._prepare)
        self._saving = ThreadPoolExecutor(max_workers=1, thread_name_prefix='saving parts')
        self.waiting = False
        self._gap_s = 0.0
        self._unsaved = ''
        self._publisher = node.create_publisher(PartMessage, PART_TOPIC, qos.LATCHED)
        node.create_service(ChangePart, '~/change_part', self._answer, callback_group=group)

    def close(self) -> None:
        """Save the film of a part that has a serial number."""
        self._parts.close()
        if self.part.serial and self._node.film.counts.received:
            self._film_to_save()()
        self._saving.shutdown()

    def status(self) -> Status:
        """The part, and how the last change went."""
        part = self.part
        values = {
            'type': part.type or 'not told',
            'serial number': part.serial or 'not told',
            'coat': part.coat,
            'mesh': part.mesh_file,
            'since': part.since.isoformat(timespec='seconds'),
            'gap of the last change [ms]': f'{self._gap_s * 1e3:.1f}',
            'meshes prepared': ' '.join(self._parts.ready) or 'none',
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
        return Status(OK, part.run or 'no serial number told', values)

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
        part = await self._node.in_a_thread(self._parts.get(mesh_file))
        response.message = f'{mesh_file} is prepared: {part.surface!r}'

    async def _change(self, request: ChangePart.Request, response: ChangePart.Response) -> None:
        node = self._node
        if self.waiting:
            raise PaintError('another part is being changed: ask again when it is there')
        if node.catching_up is not None and node.catching_up.under_way:
            # Nobody could tell which of the poses that wait are the part's before.
            raise PaintError(
                f'the film is being caught up from {node.catching_up.folder}: ask again when that '
                'is done, in 2 s'
            )
        following = self._asked_for(request)
        # A request overtakes poses that wait; they belong to the part before.
        for source in node.inputs:
            source.take_waiting()
        node.up_to_date()
        began_s = time.monotonic()
        notes = self._sprays()
        save = self._film_to_save() if node.film.counts.received else None
        pose = list(node.values['part_pose'] or [])
        self._place(request.part_pose)
        try:
            if not request.coat:
                await self._take(following.mesh_file)
        except BaseException:
            self._place(pose)
            raise
        self.part = following
        self._gap_s = response.gap_s = time.monotonic() - began_s
        self._publish()
        response.run = self.part.run
        if save is not None:
            response.paths = await self._saved(save)
            notes.append(f'wrote {", ".join(response.paths)}')
        told = [self._sentence(), *notes]
        response.message = '; '.join(told)
        node.get_logger().info(response.message)

    async def _take(self, mesh_file: str) -> None:
        """Put the bare part of this mesh in the place of the one in the cell."""
        node = self._node
        before = PreparedPart(node.surface, node.points, node.film, node.shown_as)
        if mesh_file == node.mesh_file:
            ready = before
        else:
            read = self._parts.get(mesh_file)
            if not read.done():
                self.waiting = True
                node.hold()
            try:
                ready = read.result() if read.done() else await node.in_a_thread(read)
            except BaseException:
                node.release()
                raise
            finally:
                self.waiting = False
            self._parts.take(mesh_file)
            self._parts.put_back(node.mesh_file, before)
        node.shown_as = ready.shown
        node.take_part(mesh_file, ready.surface, ready.points, ready.film)
        node.show_anew()
        node.release()

    def _asked_for(self, request: ChangePart.Request) -> Part:
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

    def _place(self, part_pose: Sequence[float]) -> None:
        """Say where the part stands, if that is told."""
        if not len(part_pose):
            return
        change = Parameter('part_pose', value=list(part_pose))
        result = self._node.set_parameters_atomically([change])
        if not result.successful:
            raise PaintError(result.reason)

    def _sprays(self) -> list[str]:
        """What is odd in changing the part now."""
        return [
            f'{source.name or "the gun"} sprays while the part is changed'
            for source in self._node.inputs
            if source.sprays
        ]

    def _sentence(self) -> str:
        part = self.part
        called = f' ({part.type})' if part.type else ''
        if part.coat > 1:
            return f'coat {part.coat} on {part.serial}{called}: the film goes on'
        return (
            f'{part.serial}{called} on {part.mesh_file}: bare metal, ready after '
            f'{self._gap_s * 1e3:.0f} ms'
        )

    # --- files and messages

    def _prepare(self, mesh_file: str) -> PreparedPart:
        return self._node.prepared_part(mesh_file)

    def _folder(self, run: str) -> Path:
        return Path(self._node.values['output_directory']).expanduser() / run

    def _film_to_save(self) -> Any:
        part = self.part
        if not part.serial:
            stem = time.strftime('film_%Y%m%d_%H%M%S')
            return film_to_save(self._node, self._folder(''), stem)
        told = {
            'type': part.type,
            'serial': part.serial,
            'coat': part.coat,
            'run': part.run,
            'since': part.since.isoformat(timespec='milliseconds'),
            'until': datetime.now(timezone.utc).isoformat(timespec='milliseconds'),
            'part_pose': list(self._node.values['part_pose'] or []),
            'gap_s': self._gap_s,
        }
        return film_to_save(self._node, self._folder(part.run), 'film', told)

    async def _saved(self, save: Any) -> list[str]:
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
            mesh_id=node.shown_as.mesh_id,
            part_parent_frame=node.values['part_parent_frame'],
            part_pose=list(node.values['part_pose'] or []),
        )
        message.header.frame_id = node.frame.frame_id
        message.header.stamp = node.get_clock().now().to_msg()
        self._publisher.publish(message)

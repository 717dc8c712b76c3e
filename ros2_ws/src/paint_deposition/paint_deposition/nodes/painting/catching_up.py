"""A painting node that was restarted in the middle of a run: it paints what the recorder has."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from paint_deposition.errors import PaintError
from paint_deposition.motion.pose_stream import PoseBatch, TriggerChange
from paint_deposition.motion.trajectory import Trajectory
from paint_deposition.nodes.runtime.messages import of_gun

if TYPE_CHECKING:
    from paint_deposition.nodes.painting.painting_node import PaintingNode

# A recorder hands a chunk to the disk when it is half a second old, and looks ten times a second:
# after so long the file holds what came before the first live pose.
WAIT_S = 1.5


class CatchingUp:
    """Holds what comes live, reads the recording, and paints both in their order.

    Args:
        node: that has just been made.
        folder: of the running recording.

    Attributes:
        folder: the same.
        under_way: whether what is recorded is still to be painted.
    """

    def __init__(self, node: PaintingNode, folder: str) -> None:
        self._node = node
        self.folder = Path(folder)
        self.under_way = True
        self._live = node.hold()
        self._timer = node.create_steady_timer(WAIT_S, self._catch_up)

    def give_up(self) -> None:
        """Paint only what comes from now on."""
        if self.under_way:
            self.under_way = False
            self._node.destroy_timer(self._timer)
            self._node.get_logger().warning(f'not caught up from {self.folder}: it was reset')
            self._node.release()

    def _catch_up(self) -> None:
        self.under_way = False
        self._node.destroy_timer(self._timer)
        for source in self._node.inputs:
            source.hand_on()
        log = self._node.get_logger()
        # Libraries that only a node loads which catches up.
        from paint_deposition.files.recordings.mcap_recovery import recover

        try:
            with tempfile.TemporaryDirectory() as place:
                run = recover(self.folder, Path(place) / 'run').folder
                told = [self._take(number, name, run) for number, name in self._guns()]
        except PaintError as error:
            log.error(f'not caught up: {error}')
        else:
            log.info(f'caught up from {self.folder}: {"; ".join(told)}')
        self._node.release()

    def _guns(self) -> list[tuple[int, str]]:
        return list(enumerate(self._node.gun_names))

    def _take(self, number: int, name: str, run: Path) -> str:
        """Put what was recorded of a gun before what it has sent since; says what there was."""
        recorded = self._read(name, run)
        live = [event for gun, event in self._live if gun == number]
        stamps = [event.stamps_ns[0] for event in live if isinstance(event, PoseBatch)]
        first_ns = int(min(stamps, default=np.iinfo(np.int64).max))
        missed = recorded.stamps_ns < first_ns
        switched = {event.stamp_ns for event in live if isinstance(event, TriggerChange)}
        changes = [change for change in self._changes(recorded) if change.stamp_ns not in switched]
        self._live[:0] = [(number, event) for event in _merged(recorded, missed, changes)]
        count = int(np.count_nonzero(missed))
        told = f'{count} poses{f" of {name}" if name else ""}'
        if stamps and count:
            apart_s = (first_ns - int(recorded.stamps_ns[missed][-1])) * 1e-9
            told += f', {apart_s * 1e3:.0f} ms before the first live one'
        return told

    def _read(self, name: str, run: Path) -> Trajectory:
        from paint_deposition.files.motion_files import read_recording
        from paint_deposition.files.recordings.bag_files import open_bag

        values, resolved = self._node.values, self._node.resolve_topic_name
        states = resolved(of_gun(name, 'atomizer/state'))
        with open_bag(run) as bag:
            has_states = bag.find(states) is not None
        return read_recording(
            run,
            pose_topic=resolved(of_gun(name, 'atomizer/pose')),
            state_topic=states if has_states else None,
            frame_id=self._node.frame.frame_id,
            part_pose=list(values['part_pose']) or None,
        )

    @staticmethod
    def _changes(recorded: Trajectory) -> list[TriggerChange]:
        rows = enumerate(recorded.triggers)
        return [TriggerChange(*told, recorded.set_points_of(row)) for row, told in rows]


def _merged(
    recorded: Trajectory, rows: np.ndarray, changes: list[TriggerChange]
) -> list[PoseBatch | TriggerChange]:
    """The poses of these rows (N,), each change before the poses that it holds for."""
    stamps = recorded.stamps_ns[rows]
    poses = recorded.positions_m[rows], recorded.quaternions_xyzw[rows]
    ends = np.searchsorted(stamps, [change.stamp_ns for change in changes]).tolist()
    events: list[PoseBatch | TriggerChange] = []
    start = 0
    for end, change in zip([*ends, len(stamps)], [*changes, None], strict=True):
        if end > start:
            part = slice(start, end)
            events.append(PoseBatch(stamps[part], *(values[part] for values in poses)))
        if change is not None:
            events.append(change)
        start = max(start, end)
    return events

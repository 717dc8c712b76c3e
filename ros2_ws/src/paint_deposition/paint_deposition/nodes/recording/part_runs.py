"""What a recorder needs to begin a run for each part."""

from __future__ import annotations

import itertools
import time
from pathlib import Path

from paint_msgs.msg import Part

from paint_deposition.files.provenance import provenance
from paint_deposition.nodes.runtime.file_names import require_file_name

# A serialised message: topic, bytes, log time and time of publication [ns].
Serialised = tuple[str, bytes, int, int]


class SaidOnce:
    """Messages that are published once and hold for every run that follows.

    Args:
        all_of: topic of which every message holds, that of static transforms.
        newest_of: topic of which the newest holds, that of the part's pose.
    """

    def __init__(self, all_of: str, newest_of: str) -> None:
        self._all_of, self._newest_of = all_of, newest_of
        self._messages: list[Serialised] = []

    def note(self, message: Serialised) -> None:
        """Keep a message if it holds for later runs."""
        if message[0] == self._newest_of:
            self._messages = [kept for kept in self._messages if kept[0] != self._newest_of]
        if message[0] in (self._all_of, self._newest_of):
            self._messages.append(message)

    @property
    def messages(self) -> tuple[Serialised, ...]:
        """Those that hold, in the order in which they came."""
        return tuple(self._messages)


def notes_on(part: Part, model_file: str) -> dict[str, str]:
    """What the run of a part is made with, by name.

    Raises:
        PaintError: the model file cannot be read.
    """
    told = {'part_type': part.type, 'serial': part.serial, 'coat': str(part.coat)}
    if part.part_pose:
        told['part_pose'] = ' '.join(map(str, part.part_pose))
    # The simulator may run on another machine, with files of its own.
    mesh_file = part.mesh_file if Path(part.mesh_file).is_file() else ''
    return provenance(mesh_file, model_file) | told


def free_name(folder: Path, run: str) -> str:
    """The name of a run, with date and time behind it where there is one of that name.

    Raises:
        PaintError: it is no name for a folder.
    """
    require_file_name('run', run)
    dated = run + time.strftime('_%Y%m%d_%H%M%S')
    names = itertools.chain([run, dated], (f'{dated}_{number}' for number in itertools.count(2)))
    return next(name for name in names if not (folder / name).exists())

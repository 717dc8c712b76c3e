"""The motions of several guns that paint one part."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from paint_deposition.errors import RecordingError
from paint_deposition.files.motion_files import read_motion
from paint_deposition.files.motion_source import MotionSource
from paint_deposition.files.recordings.bag_files import open_bag
from paint_deposition.files.recordings.bags import POSE_TOPIC, STATE_TOPIC
from paint_deposition.motion.trajectory import Trajectory


@dataclass(frozen=True)
class GunMotion:
    """A gun by its name, '' for the only one, and its motion in the frame of the part."""

    name: str
    trajectory: Trajectory


def read_gun_motions(
    files: Sequence[Path], source: MotionSource, atomizers: Sequence[str] = ()
) -> list[GunMotion]:
    """Read the motion of each gun.

    Args:
        files: a bag, a RAPID module or a table for each gun, or one bag with all ``atomizers``.
        source: what holds for each of them.
        atomizers: names of guns in bags whose topics stand behind them, as
            /robot_1/atomizer/pose; a gun without a recorded state sprays whenever it moves.

    Raises:
        RecordingError: the names and the files do not go together, or a file cannot be read.
    """
    if not atomizers:
        if len(files) == 1:
            return [GunMotion('', read_motion(files[0], source))]
        return [
            GunMotion(name, read_motion(file, source))
            for name, file in zip(_names_of(files), files, strict=True)
        ]
    if len(files) not in (1, len(atomizers)):
        raise RecordingError(
            f'{len(files)} files for {len(atomizers)} atomizers: give one with all of them, or '
            'one for each'
        )
    if source.pose_topic or source.state_topic:
        raise RecordingError(
            'an atomizer is given by its name and by topics: leave out --atomizer, or '
            '--pose-topic and --state-topic'
        )
    names = [name.strip('/') for name in atomizers]
    each = list(files) * (len(names) if len(files) == 1 else 1)
    return [
        GunMotion(name, read_motion(file, _named(file, source, name)))
        for name, file in zip(names, each, strict=True)
    ]


def _named(file: Path, source: MotionSource, name: str) -> MotionSource:
    """The same for the gun of this name in a bag of the cell's recorder."""
    before = f'/{name}'
    with open_bag(file) as bag:
        state = bag.find(before + STATE_TOPIC)
    topics = {'pose_topic': before + POSE_TOPIC, 'state_topic': state and state.name}
    return source.model_copy(update=topics)


def _names_of(files: Sequence[Path]) -> list[str]:
    """What tells the files apart: their names, or else their numbers."""
    names = [file.stem for file in files]
    if len(set(names)) == len(names):
        return names
    return [f'{name} {number}' for number, name in enumerate(names, start=1)]

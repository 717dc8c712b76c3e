"""Motions by the kind of their file: recorded in a bag, or programmed in a RAPID module."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from paint_deposition.errors import RecordingError
from paint_deposition.files.rapid.motion import is_rapid, program_trajectory
from paint_deposition.files.rapid.program import read_program
from paint_deposition.files.recordings.bags import read_trajectory
from paint_deposition.motion.trajectory import Trajectory


def read_recording(
    path: str | Path,
    pose_topic: str | None = None,
    state_topic: str | None = None,
    gun_signal: str | None = None,
) -> Trajectory:
    """Read the poses and the trigger of a bag, by its topics, or of a program.

    Args:
        gun_signal: digital output that opens the gun; for RAPID modules only.

    Raises:
        RecordingError: what `read_trajectory` and `read_program` refuse, or an option that the
            other kind of file has.
    """
    path = Path(path)
    if is_rapid(path):
        if pose_topic or state_topic:
            raise RecordingError(f'{path} is a RAPID module without topics; give --gun-signal')
        recorded = program_trajectory(read_program(path, gun_signal=gun_signal))
    else:
        refuse_gun_signal(path, gun_signal)
        recorded = read_trajectory(path, pose_topic, state_topic)
    return replace(recorded, source=str(path))


def refuse_gun_signal(path: Path, gun_signal: str | None) -> None:
    """Bags have no outputs."""
    if gun_signal:
        raise RecordingError(f'--gun-signal is for RAPID modules, {path} is none; leave it out')

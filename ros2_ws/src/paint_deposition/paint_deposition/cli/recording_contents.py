"""What `inspect` shows of a recording by itself."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import click

from paint_deposition.files.json_files import json_text
from paint_deposition.files.motion_source import MotionSource
from paint_deposition.files.provenance import origin
from paint_deposition.files.rapid.program import is_rapid, program_as_text, read_program
from paint_deposition.files.recordings.bag_summary import BagSummary, summarise
from paint_deposition.files.recordings.message_definitions import JOINT_TYPE, TF_TYPES
from paint_deposition.files.tables.poses import PoseLayout, is_pose_table, read_pose_table
from paint_deposition.motion.trajectory import Trajectory


def show_contents(
    path: Path, gun_signal: str | None, max_pose_gap_s: float, as_json: bool
) -> None:
    """Print what a RAPID module, a table of poses or a bag holds."""
    figures: dict[str, Any]
    if is_rapid(path):
        program = read_program(path, gun_signal=gun_signal)
        figures, lines = asdict(program), program_as_text(program)
    elif is_pose_table(path):
        MotionSource(gun_signal=gun_signal).refuse_other(path, 'a table of poses')
        figures, lines = _told(read_pose_table(path, PoseLayout()))
    else:
        MotionSource(gun_signal=gun_signal).refuse_other(path, 'a bag')
        summary = summarise(path, max_pose_gap_s)
        figures, lines = asdict(summary), _table(summary)
    provenance = {'provenance': origin(files={'recording': path})}
    click.echo(json_text(figures | provenance) if as_json else lines)


def _told(poses: Trajectory) -> tuple[dict, str]:
    """What was understood of a table of poses: figures, and the same in words."""
    low, high = poses.positions_m.min(axis=0), poses.positions_m.max(axis=0)
    figures = {
        'poses': len(poses), 'duration_s': poses.duration_s, 'frame_id': poses.frame_id,
        'low_m': low.tolist(), 'high_m': high.tolist(), 'notes': list(poses.notes),
    }  # fmt: skip
    sides = ', '.join(
        f'{axis} {a:.3f} to {b:.3f}' for axis, a, b in zip('xyz', low, high, strict=True)
    )
    frame = f"'{poses.frame_id}'" if poses.frame_id else 'a frame that is not named'
    line = f'{len(poses)} poses in {frame} over {poses.duration_s:.3f} s: {sides} m'
    return figures, '\n'.join([line, *poses.notes])


def _table(summary: BagSummary) -> str:
    lines = [summary.path]
    width = max((len(topic.name) for topic in summary.topics), default=0)
    lines += [f'  {t.name:{width}}  {t.message_count:8d}  {t.type}' for t in summary.topics]
    lines += [
        f"poses on {stream.topic}: {stream.poses} in frame '{stream.frame_id}' over "
        f'{stream.duration_s:.3f} s, {stream.mean_rate_hz:.1f} a second, {stream.gaps} gaps, '
        f'longest interval {stream.longest_gap_s:.3f} s, '
        f'{stream.repeated_stamps} repeated and {stream.backward_stamps} backward stamps'
        for stream in summary.pose_streams
    ]
    if not summary.pose_streams:
        lines.append('no poses: there is no PoseStamped topic with messages')
    types = {topic.type for topic in summary.topics}
    if types & {*TF_TYPES}:
        lines.append('transforms: --tf TARGET SOURCE takes the motion from them')
    if JOINT_TYPE in types:
        lines.append('joint states: --urdf takes the motion from them')
    lines.append(f'triggers: {" ".join(summary.triggers) or "none"}')
    return '\n'.join(lines)

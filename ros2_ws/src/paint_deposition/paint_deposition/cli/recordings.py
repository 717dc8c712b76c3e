"""Commands on recordings: `inspect` and `recover`."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import paint_deposition as pd
from paint_deposition.cli.model_choice import model_for
from paint_deposition.cli.options import (
    FILE,
    JSON,
    MAX_POSE_GAP,
    model_option,
    motion_options,
    part_options,
    say_all,
)
from paint_deposition.cli.progress import SHOW_PROGRESS_AFTER_S, Progress
from paint_deposition.files.json_files import json_text
from paint_deposition.files.provenance import origin

if TYPE_CHECKING:
    from paint_deposition.files.recordings.bag_summary import BagSummary


@click.command('inspect')
@click.argument('recording', type=FILE, required=False)
@part_options(0.02, required=False)
@click.option('--trajectory', type=FILE, help='The motion to set beside the part; or RECORDING.')
@click.option(
    '--out', '--output', '-o', 'output', type=FILE,
    help='Picture to draw, PNG: part, passes and tool axes from three sides.',
)  # fmt: skip
@model_option('Model that says where the spray goes; default: a 50 mm bell.')
@motion_options
@MAX_POSE_GAP
@JSON
def inspect_command(
    recording: Path | None,
    part: dict[str, Any],
    trajectory: Path | None,
    max_pose_gap_s: float,
    motion: dict[str, Any],
    as_json: bool,
    **options: Any,
) -> None:
    """Show what RECORDING holds, or how the gun ran over a part.

    Of a bag: topics, streams of poses and their gaps, triggers. Of a RAPID module (.mod, .prg):
    targets, moves, speeds, where the gun is switched, and what could not be followed. Of a table
    of poses (.csv, .tsv, .txt): what was understood.

    With --mesh: passes, speed, distance and angle of the gun, the share of its paint over the
    part, and warnings of what is odd, each with its likely cause.
    """
    path = trajectory or recording
    if path is None or (trajectory and recording):
        raise click.UsageError('give one recording: RECORDING, or --mesh M --trajectory T')
    if part['path'] is not None:
        _show_gun_on_part(part, path, motion, max_pose_gap_s, as_json, **options)
    else:
        gun_signal = motion.pop('gun_signal')
        if any(options[name] for name in ('output', 'model_file')) or any(motion.values()):
            raise click.UsageError('--out, --model and how the motion is read need --mesh')
        _show_contents(path, gun_signal, max_pose_gap_s, as_json)


def _show_contents(
    path: Path, gun_signal: str | None, max_pose_gap_s: float, as_json: bool
) -> None:
    """Print what a RAPID module, a table of poses or a bag holds."""
    from paint_deposition.files.motion_source import MotionSource
    from paint_deposition.files.rapid.program import is_rapid, program_as_text, read_program
    from paint_deposition.files.recordings.bag_summary import summarise
    from paint_deposition.files.tables.poses import PoseLayout, is_pose_table, read_pose_table

    figures: dict[str, Any]
    if is_rapid(path):
        program = read_program(path, gun_signal=gun_signal)
        figures, lines = asdict(program), program_as_text(program)
    elif is_pose_table(path):
        MotionSource(gun_signal=gun_signal).refuse_other(path, 'a table of poses')
        figures, lines = _table_contents(read_pose_table(path, PoseLayout()))
    else:
        MotionSource(gun_signal=gun_signal).refuse_other(path, 'a bag')
        summary = summarise(path, max_pose_gap_s)
        figures, lines = asdict(summary), _bag_contents(summary)
    provenance = {'provenance': origin(files={'recording': path})}
    click.echo(json_text(figures | provenance) if as_json else lines)


def _table_contents(poses: pd.Trajectory) -> tuple[dict, str]:
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


def _bag_contents(summary: BagSummary) -> str:
    from paint_deposition.files.recordings.message_definitions import JOINT_TYPE, TF_TYPES

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


def _show_gun_on_part(
    part: dict[str, Any],
    path: Path,
    motion: dict[str, Any],
    max_pose_gap_s: float,
    as_json: bool,
    *,
    output: Path | None,
    model_file: Path | None,
) -> None:
    """Print how the gun ran over a part and what is odd, and draw it if a picture is wanted."""
    mesh = part['path']
    with Progress('inspect') as show:
        show('reading')
        recorded = pd.read_recording(path, **motion)
        surface = pd.read_mesh(**part)
        model = model_for(model_file, path).model
        seen = pd.look_at(surface, recorded, model, max_pose_gap_s=max_pose_gap_s)
        if output is not None:
            from paint_deposition.report.pictures.motion import write_geometry_picture

            show('drawing')
            title = f'{path.name} over {mesh.name}'
            write_geometry_picture(output, seen.surface, seen.path, seen.geometry, title)
    say_all('note', seen.notes)
    say_all('warning', [*recorded.warnings, *seen.geometry.warnings])
    if as_json:
        files = {'mesh_file': str(mesh), 'trajectory': str(path), 'picture': output}
        made_from = origin(model, {'mesh': mesh, 'trajectory': path})
        click.echo(json_text(seen.to_dict() | files | {'provenance': made_from}))
        return
    click.echo(seen.geometry.sentence)
    click.echo(seen.geometry.facet_sentence)
    if output is not None:
        click.echo(f'  {output}')


@click.command('recover')
@click.argument('run', type=FILE)
@click.option(
    '-o', '--output', type=FILE,
    help='Folder to make; default: RUN with _recovered behind its name.',
)  # fmt: skip
@JSON
def recover_command(run: Path, output: Path | None, as_json: bool) -> None:
    """Make a whole rosbag2 folder of what can be read of RUN, an unfinished or damaged MCAP run.

    RUN is a run's folder or its .mcap file.
    """
    from tqdm import tqdm

    from paint_deposition.files.recordings.bag_files import mcap_files
    from paint_deposition.files.recordings.mcap_recovery import recover

    output = output or run.with_name(f'{run.stem if run.is_file() else run.name}_recovered')
    size = sum(file.stat().st_size for file in mcap_files(run))
    with tqdm(
        total=size, unit='B', unit_scale=True, desc='recover', delay=SHOW_PROGRESS_AFTER_S,
        disable=None,
    ) as bar:  # fmt: skip
        recovery = recover(run, output, on_bytes=bar.update)
    if as_json:
        figures = {
            'folder': str(recovery.folder),
            'messages': recovery.message_count,
            'topics': recovery.counts,
            'damaged_chunks': recovery.damaged_chunks,
            'breaks': recovery.breaks,
            'skipped_topics': recovery.skipped_topics,
            'provenance': origin(files={'recording': run}),
        }
        click.echo(json_text(figures))
        return
    for line in recovery.breaks:
        click.echo(line)
    if recovery.damaged_chunks:
        click.echo(f'{recovery.damaged_chunks} damaged chunks left out')
    if recovery.skipped_topics:
        click.echo(f'left out, not CDR or without a schema: {" ".join(recovery.skipped_topics)}')
    for topic, count in recovery.counts.items():
        click.echo(f'{count:10d}  {topic}')
    click.echo(f'{recovery.message_count} messages recovered: {recovery.folder}')

"""Commands on recordings: `inspect` and `recover`."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import paint_deposition as pd
from paint_deposition.cli import options
from paint_deposition.cli.inspected import mesh_in, readings_in
from paint_deposition.cli.model_choice import model_for
from paint_deposition.cli.results_folder import SHOW_PROGRESS_AFTER_S, Progress
from paint_deposition.files.atomic import json_text
from paint_deposition.files.provenance import origin

if TYPE_CHECKING:
    from paint_deposition.files.recordings.bag_files import BagTopic
    from paint_deposition.files.recordings.bag_summary import PoseSource
    from paint_deposition.motion.stream_quality import StreamQuality


@click.command('inspect')
@click.argument('recording', type=options.FILE, required=False)
@options.POINTS
@options.part_options(0.02, required=False)
@click.option(
    '--trajectory', type=options.FILE, help='The motion to set beside the part; or RECORDING.'
)
@click.option(
    '--out', '--output', '-o', 'output', type=options.FILE,
    help='Picture to draw, PNG: part, passes and tool axes from three sides.',
)  # fmt: skip
@options.model_option('Model that says where the spray goes; default: a 50 mm bell.')
@options.motion_options
@options.MAX_POSE_GAP
@options.ALLOW_EFFECTS
@options.JSON
def inspect_command(
    recording: Path | None,
    points_file: Path | None,
    part: dict[str, Any],
    trajectory: Path | None,
    max_pose_gap_s: float,
    motion: dict[str, Any],
    as_json: bool,
    **drawn: Any,
) -> None:
    """Show what RECORDING holds, or how the gun ran over a part.

    Of a bag: topics, streams of poses and their gaps, triggers. Of a RAPID program (.mod, .prg,
    .sys, .pgf or a folder of modules): moves, speeds, where the gun is switched, and what was left
    out. Of a table of poses (.csv, .tsv, .txt): what was understood. Of gauge readings: also their
    zeros and repeats. Of a mesh: its size, unit and bodies.

    With --mesh: passes, speed, distance and angle of the gun, the share of its paint over the
    part, and warnings of what is odd, each with its likely cause.
    """
    path = trajectory or recording
    if path is None or (trajectory and recording):
        raise click.UsageError('give one recording: RECORDING, or --mesh M --trajectory T')
    if part['path'] is not None:
        figures, lines = _gun_on_part(part, path, motion, max_pose_gap_s, **drawn)
    else:
        if any(drawn[name] for name in ('output', 'model_file')):
            raise click.UsageError('--out and --model need --mesh')
        figures, lines = _contents(path, points_file, motion, max_pose_gap_s)
        figures |= {'provenance': origin(files={'recording': path})}
    click.echo(json_text(figures) if as_json else lines)


def _contents(
    path: Path, points_file: Path | None, motion: dict[str, Any], max_pose_gap_s: float
) -> tuple[dict[str, Any], str]:
    """What a module, table, mesh or bag holds: figures, and the same in words."""
    from paint_deposition.errors import RecordingError
    from paint_deposition.files.mesh_bodies import SUFFIXES
    from paint_deposition.files.motion_files import read_table
    from paint_deposition.files.motion_source import MotionSource
    from paint_deposition.files.rapid.program import is_rapid, program_as_text, read_program
    from paint_deposition.files.recordings.bag_summary import summarise
    from paint_deposition.files.recordings.message_definitions import STATE_TYPE
    from paint_deposition.files.recordings.triggers import BOOL_TYPE
    from paint_deposition.files.tables.poses import is_pose_table, may_hold_poses
    from paint_deposition.files.tables.readings import holds_readings
    from paint_deposition.files.tables.sheets import is_gauge_file
    from paint_deposition.request import validate

    source = validate(MotionSource, 'motion', motion, RecordingError)
    if path.suffix.lower() in SUFFIXES:
        return mesh_in(path)
    if is_gauge_file(path):
        return readings_in(path, points_file)
    if is_pose_table(path) and (points_file or holds_readings(path) or not may_hold_poses(path)):
        return readings_in(path, points_file)
    if is_pose_table(path):
        poses = read_table(path, source)
        options.print_all('warning', poses.warnings)
        return _table_contents(poses, max_pose_gap_s)
    kind = 'a RAPID module' if is_rapid(path) else 'a bag'
    source.require_kind(path, kind)
    of_program = {name: motion.pop(name) for name in ('gun_signal', 'procedure')}
    if any(motion.values()):
        raise click.UsageError(f'how the motion of {kind} is read needs --mesh')
    if is_rapid(path):
        program = read_program(path, **of_program)
        return asdict(program), program_as_text(program)
    topics, sources = summarise(path, max_pose_gap_s)
    triggers = [t.name for kind in (STATE_TYPE, BOOL_TYPE) for t in topics if t.type == kind]
    figures = {
        'path': str(path), 'topics': [asdict(topic) for topic in topics],
        'pose_streams': [source.to_dict() for source in sources], 'triggers': triggers,
    }  # fmt: skip
    return figures, _bag_contents(path, topics, sources, triggers)


def _table_contents(poses: pd.Trajectory, max_pose_gap_s: float) -> tuple[dict, str]:
    """What was understood of a table of poses: figures, and the same in words."""
    import numpy as np

    from paint_deposition.motion.stream_quality import StreamQuality
    from paint_deposition.part.points import box_words

    values = np.hstack([poses.positions_m, poses.quaternions_xyzw])
    quality = StreamQuality.of(poses.stamps_ns, values, max_gap_s=max_pose_gap_s)
    low, high = poses.positions_m.min(axis=0), poses.positions_m.max(axis=0)
    figures = {
        'poses': len(poses), 'duration_s': poses.duration_s, 'frame_id': poses.frame_id,
        'low_m': low.tolist(), 'high_m': high.tolist(), 'notes': list(poses.notes),
        **vars(quality),
    }  # fmt: skip
    frame = f"'{poses.frame_id}'" if poses.frame_id else 'a frame that is not named'
    line = f'{len(poses)} poses in {frame} over {poses.duration_s:.3f} s: '
    line += box_words(poses.positions_m)
    return figures, '\n'.join([line, *poses.notes, _stream_words(quality)])


def _bag_contents(
    path: Path, topics: list[BagTopic], sources: list[PoseSource], triggers: list[str]
) -> str:
    from paint_deposition.files.recordings.message_definitions import TF_TYPES

    lines = [str(path)]
    width = max((len(topic.name) for topic in topics), default=0)
    lines += [f'  {t.name:{width}}  {t.message_count:8d}  {t.type}' for t in topics]
    for source in sources:
        lines += _source_lines(source)
    if not sources:
        lines.append('no poses: there are no messages with poses, joints or transforms that move')
    if {topic.type for topic in topics} & {*TF_TYPES}:
        lines.append('transforms: --tf TARGET SOURCE takes the motion from them')
    lines.append(f'triggers: {" ".join(triggers) or "none"}')
    return '\n'.join(lines)


def _source_lines(source: PoseSource) -> list[str]:
    """One source of poses: its figures, and whether it will do."""
    from paint_deposition.files.recordings.message_definitions import JOINT_TYPE

    kinds = {JOINT_TYPE: 'joints on', 'transforms': 'transforms from'}
    what = f'{kinds.get(source.type, "poses on")} {source.topic}'
    if source.quality is None:
        return [f'{what} will not do: {source.faults[0]}']
    frame = f" in frame '{source.frame_id}'" if source.frame_id else ''
    return [
        f'{what}: {source.quality.poses}{frame} over {source.quality.duration_s:.3f} s, '
        f'{_stream_words(source.quality)}, in {source.unit}',
        *(f'  warning: {fault}' for fault in source.faults),
        f'  {"to be used with care" if source.faults else "will do"}: {source.options}',
    ]


def _stream_words(quality: StreamQuality) -> str:
    lag = without = ''
    if quality.repeated_samples:
        without = f' ({quality.new_rate_hz:.1f} a second without them)'
    if quality.lag_s is not None and quality.lag_range_s is not None:
        low, high = quality.lag_range_s
        lag = f', logged {quality.lag_s:.3g} s after the stamp ({low:.3g} to {high:.3g})'
    return (
        f'{quality.mean_rate_hz:.1f} a second, {quality.gaps} gaps, longest interval '
        f'{quality.longest_gap_s:.3f} s, {quality.repeated_stamps} repeated and '
        f'{quality.backward_stamps} backward stamps, {quality.repeated_samples} repeated '
        f'samples{without}{lag}'
    )


def _gun_on_part(
    part: dict[str, Any],
    path: Path,
    motion: dict[str, Any],
    max_pose_gap_s: float,
    output: Path | None,
    model_file: Path | None,
) -> tuple[dict[str, Any], str]:
    """How the gun ran over a part, drawn if a picture is wanted; what is odd goes to stderr."""
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
    options.print_all('note', seen.notes)
    options.print_all('warning', [*seen.trajectory.warnings, *seen.geometry.warnings])
    figures: dict[str, Any] = {'mesh_file': str(mesh), 'trajectory': str(path), 'picture': output}
    figures |= {'provenance': origin(model, {'mesh': mesh, 'trajectory': path})}
    lines = [seen.geometry.sentence, seen.geometry.facet_sentence]
    lines += [f'  {output}'] if output else []
    return seen.to_dict() | figures, '\n'.join(lines)


@click.command('recover')
@click.argument('run', type=options.FILE)
@click.option(
    '-o', '--output', type=options.FILE,
    help='Folder to make; default: RUN with _recovered behind its name.',
)  # fmt: skip
@options.JSON
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
        found = recover(run, output, on_bytes=bar.update)
    figures = {
        'folder': str(found.folder), 'messages': found.message_count, 'topics': found.counts,
        'damaged_chunks': found.damaged_chunks, 'breaks': found.breaks,
        'skipped_topics': found.skipped_topics, 'provenance': origin(files={'recording': run}),
    }  # fmt: skip
    lines = [*found.breaks]
    if found.damaged_chunks:
        lines.append(f'{found.damaged_chunks} damaged chunks left out')
    if found.skipped_topics:
        lines.append(f'left out, not CDR or without a schema: {" ".join(found.skipped_topics)}')
    lines += [f'{count:10d}  {topic}' for topic, count in found.counts.items()]
    lines.append(f'{found.message_count} messages recovered: {found.folder}')
    click.echo(json_text(figures) if as_json else '\n'.join(lines))

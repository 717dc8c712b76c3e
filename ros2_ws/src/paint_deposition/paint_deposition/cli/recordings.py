"""Commands on recordings: `inspect` and `recover`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from paint_deposition.cli.options import (
    BODY,
    FILE,
    JSON,
    MAX_POSE_GAP,
    MESH_SCALE,
    direction_option,
    model_option,
    motion_options,
)

if TYPE_CHECKING:
    from paint_deposition.files.recordings.mcap_recovery import Recovery


@click.command('inspect')
@click.argument('recording', type=FILE, required=False)
@click.option('--mesh', type=FILE, help='A part to set beside the motion.')
@click.option('--trajectory', type=FILE, help='The motion to set beside the part; or RECORDING.')
@click.option(
    '--out', '--output', '-o', 'output', type=FILE,
    help='Picture to draw, PNG: part, passes and tool axes from three sides; or the speeds.',
)  # fmt: skip
@click.option(
    '--programmed', type=FILE,
    help='The programme that the robot ran, a RAPID module or a table of passes: the speed '
    'driven against the programmed one.',
)  # fmt: skip
@model_option('Model that says where the spray goes; default: a 50 mm bell.')
@motion_options
@MESH_SCALE
@BODY
@direction_option('--down', 'Gravity in the mesh frame; default: as guessed.')
@MAX_POSE_GAP
@JSON
def inspect_command(
    recording: Path | None,
    mesh: Path | None,
    trajectory: Path | None,
    programmed: Path | None,
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

    With --programmed: the speed of the TCP along the way sprayed, pass by pass, against the
    programmed one.
    """
    path = trajectory or recording
    if path is None or (trajectory and recording):
        raise click.UsageError('give one recording: RECORDING, or --mesh M --trajectory T')
    if programmed is not None:
        if mesh is not None or options['model_file']:
            raise click.UsageError('--programmed goes without --mesh and --model: ask twice')
        from paint_deposition.cli.speeds import show_speeds

        show_speeds(path, programmed, motion, max_pose_gap_s, options['output'], as_json)
        return
    if mesh is not None:
        from paint_deposition.cli.geometry import show_gun_on_part

        show_gun_on_part(mesh, path, motion, max_pose_gap_s, as_json, **options)
        return
    gun_signal = motion.pop('gun_signal')
    if any(options[name] for name in ('output', 'model_file')) or any(motion.values()):
        raise click.UsageError(
            '--out, --model and how the motion is read go with --mesh or --programmed'
        )
    from paint_deposition.cli.recording_contents import show_contents

    show_contents(path, gun_signal, max_pose_gap_s, as_json)


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

    from paint_deposition.cli.progress import SHOW_PROGRESS_AFTER_S
    from paint_deposition.files.json_files import json_text
    from paint_deposition.files.provenance import origin
    from paint_deposition.files.recordings.bag_files import mcap_files
    from paint_deposition.files.recordings.mcap_recovery import recover

    output = output or run.with_name(f'{run.stem if run.is_file() else run.name}_recovered')
    size = sum(file.stat().st_size for file in mcap_files(run))
    with tqdm(
        total=size,
        unit='B',
        unit_scale=True,
        desc='recover',
        delay=SHOW_PROGRESS_AFTER_S,
        disable=None,
    ) as bar:
        recovery = recover(run, output, on_bytes=bar.update)
    if as_json:
        made_from = origin(files={'recording': run})
        click.echo(json_text(_figures(recovery) | {'provenance': made_from}))
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


def _figures(recovery: Recovery) -> dict:
    return {
        'folder': str(recovery.folder),
        'messages': recovery.message_count,
        'topics': recovery.counts,
        'damaged_chunks': recovery.damaged_chunks,
        'breaks': recovery.breaks,
        'skipped_topics': recovery.skipped_topics,
    }

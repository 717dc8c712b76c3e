"""The command `inspect`: what a recording, a program, a table or a mesh holds."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import paint_deposition as pd
from paint_deposition.cli import options
from paint_deposition.cli.models import model_for
from paint_deposition.cli.results import print_all, progress
from paint_deposition.errors import PaintError, some
from paint_deposition.files.atomic import json_text
from paint_deposition.files.provenance import origin
from paint_deposition.request import MotionOptions, validate

if TYPE_CHECKING:
    from paint_deposition.files.recordings.bag_files import BagTopic
    from paint_deposition.files.recordings.pose_topics import PoseSource
    from paint_deposition.motion.stream_quality import StreamQuality

# Figures, and the same in words.
Contents = tuple[dict[str, Any], list[str]]


@click.command('inspect')
@click.argument('recording', type=options.FILE)
@options.POINTS
@options.part_options(0.02, required=False)
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
    recording: Path,
    points_file: Path | None,
    part: options.Part,
    output: Path | None,
    model_file: Path | None,
    motion: dict[str, Any],
    max_pose_gap_s: float,
    as_json: bool,
) -> None:
    """Show what RECORDING holds, or how the gun ran over a part.

    Of a bag: topics, streams of poses and their gaps, triggers. Of a RAPID program (.mod, .prg,
    .sys, .pgf or a folder of modules): moves, speeds, where the gun is switched, and what was left
    out. Of a table of poses (.csv, .tsv, .txt): what was understood. Of gauge readings: also their
    zeros and repeats. Of a mesh: its size, unit and bodies.

    With --mesh: passes, speed, distance and angle of the gun, the share of its paint over the
    part, and warnings of what is odd, each with its likely cause.
    """
    if part.mesh is None:
        model, files = None, {'recording': str(recording)}
        figures, lines = _contents(recording, points_file, part, motion, max_pose_gap_s)
    elif points_file:
        raise click.UsageError('--points is for gauge readings; leave it or --mesh out')
    else:
        # A picture says what drew it.
        if output and output.is_file() and b'Matplotlib' not in output.read_bytes():
            raise PaintError(f'{output} was not drawn by paint; choose another --output')
        with progress('inspect') as show:
            show('reading')
            poses = pd.read_recording(recording, **motion)
            model = model_for(model_file, recording)[0].model
            seen = pd.look_at(part.surface(), poses, model, max_pose_gap_s=max_pose_gap_s)
            if output is not None:
                from paint_deposition.report.plan_pictures import write_geometry_picture

                show('drawing')
                title = f'{recording.name} over {part.mesh.name}'
                write_geometry_picture(output, seen.surface, seen.path, seen.geometry, title)
        print_all('note', seen.notes)
        print_all('warning', [*seen.trajectory.warnings, *seen.geometry.warnings])
        files = {'mesh': str(part.mesh), 'trajectory': str(recording)}
        told = {'mesh_file': str(part.mesh), 'trajectory': str(recording), 'picture': output}
        figures, lines = seen.to_dict() | told, [seen.geometry.sentence]
        lines += [seen.geometry.facet_sentence, *([f'  {output}'] if output else [])]
    if as_json:  # the digests of long recordings take their time
        lines = [json_text(figures | {'provenance': origin(model, files)})]
    click.echo('\n'.join(lines))


def _only(what: str, *names: str) -> None:
    """Refuse the options that were given and do nothing for what is shown; these do something."""
    given = options.given_beside(*names, 'recording', 'as_json', 'allow_effects')
    if given:
        raise click.UsageError(f'{" ".join(given)}: not for {what}; leave it out, or give --mesh')


def _contents(
    path: Path, points_file: Path | None, part: options.Part, motion: dict[str, Any],
    max_pose_gap_s: float,
) -> Contents:  # fmt: skip
    """What a module, table, mesh or bag holds."""
    from paint_deposition.errors import RecordingError
    from paint_deposition.files.meshes import SUFFIXES
    from paint_deposition.files.motion_files import MOTION_KINDS, read_table, require_kind
    from paint_deposition.files.rapid.program import is_rapid, program_as_text, read_program
    from paint_deposition.files.recordings.bag_files import open_bag
    from paint_deposition.files.recordings.bags import BOOL_TYPE
    from paint_deposition.files.recordings.messages import STATE_TYPE
    from paint_deposition.files.recordings.pose_topics import sources_of_poses
    from paint_deposition.files.tables.poses import holds_readings, is_pose_table

    source = validate(MotionOptions, 'motion', motion, RecordingError)
    if path.suffix.lower() in SUFFIXES:
        _only('a mesh', 'mesh_scale', 'body')
        return _mesh_contents(path, part)
    if holds_readings(path, points_file is not None):
        _only('gauge readings', 'points_file')
        return _readings_contents(path, points_file)
    if is_pose_table(path):
        _only('a table of poses', *MOTION_KINDS, 'max_pose_gap_s')
        poses = read_table(path, source)
        print_all('warning', poses.warnings)
        return _table_contents(poses, max_pose_gap_s)
    kind = 'a RAPID module' if is_rapid(path) else 'a bag'
    require_kind(source, path, kind)
    if is_rapid(path):
        _only(kind, 'gun_signal', 'procedure')
        program = read_program(path, source.gun_signal, source.procedure)
        return asdict(program), [program_as_text(program)]
    _only(kind, 'max_pose_gap_s')
    with open_bag(path) as bag:
        topics, sources = bag.topics, [*sources_of_poses(bag, max_pose_gap_s)]
    triggers = [t.name for kind in (STATE_TYPE, BOOL_TYPE) for t in topics if t.type == kind]
    figures = {
        'path': str(path), 'topics': [asdict(topic) for topic in topics],
        'pose_streams': [
            {name: value for name, value in vars(source).items() if name != 'quality'}
            | (vars(source.quality) if source.quality else {})
            | {'will_do': source.quality is not None}
            for source in sources
        ],
        'triggers': triggers,
    }  # fmt: skip
    return figures, _bag_lines(path, topics, sources, triggers)


def _mesh_contents(path: Path, part: options.Part) -> Contents:
    """A mesh: its size in the unit that it has, is said or seems to have, and its bodies."""
    import numpy as np

    from paint_deposition.files.meshes import LARGEST_M, WITH_UNIT, read_bodies

    ((vertices, faces), *_), scale = read_bodies(path, part.body), part.mesh_scale
    unit = '' if scale == 1.0 else f'read with --mesh-scale {scale:g}'
    if not unit and path.suffix.lower() not in WITH_UNIT:
        unit = 'it has no unit and is taken for metres'
        largest = float(np.ptp(vertices, axis=0).max()) if len(vertices) else 0.0
        if largest > LARGEST_M:
            scale, unit = 1e-3, (
                f'it has no unit and looks like millimetres, else it would be {largest:.4g} m '
                'large: give --mesh-scale 0.001'
            )  # fmt: skip
    surface = pd.read_mesh(path, scale, LARGEST_M, body=part.body)
    box, where = _box(surface.vertices_m)
    area_m2 = float(surface.vertex_areas_m2.sum())
    figures = {
        'triangles': len(faces), **box, 'area_m2': area_m2, 'mesh_scale': scale,
        'notes': list(surface.notes),
    }  # fmt: skip
    size = ' x '.join(f'{side:.3f}' for side in np.ptp(surface.vertices_m, axis=0))
    what = f'{path.name}: a mesh of {len(faces)} triangles, {size} m, {area_m2:.3g} m2'
    return figures, [*filter(None, [what, unit, where]), *surface.notes]


def _readings_contents(path: Path, points_file: Path | None) -> Contents:
    """The readings of a table: how many, where, of what film, their zeros and repeats."""
    import numpy as np

    from paint_deposition.inference.readings.gauge_noise import gauge_noise

    readings = pd.read_readings(path, points_file)
    # A point that is read in two layers is two points.
    named = zip(readings.point, readings.layer, strict=True)
    places = [f'{point}, {layer}' if layer else point for point, layer in named]
    readings = replace(readings, point=np.array(places))
    film, noise = readings.thickness_um, gauge_noise(readings)
    zeros, repeated = (
        list(dict.fromkeys(readings.point[rows].tolist()))
        for rows in (film == 0.0, (readings.repeats > 1)[readings.owner])
    )
    warnings = [*readings.doubts]
    if zeros:
        warnings.append(
            f'{np.count_nonzero(film == 0.0)} readings are 0 (points {some(zeros, most=8)}): '
            'bare metal, or not measured; write n/a for the latter, or say zero: in the campaign'
        )
    print_all('warning', warnings)
    box, where = _box(readings.positions_m)
    figures = {
        'readings': len(readings), 'points': len(readings.first), 'zeros': zeros,
        'repeated': repeated, 'noise_um': noise.typical_um, 'noise_source': noise.source,
        'mean_um': film.mean(), 'min_um': film.min(), 'max_um': film.max(), **box,
        'notes': [readings.understood], 'warnings': warnings,
    }  # fmt: skip
    repeats = f'{len(repeated)} of them measured again' if repeated else 'none measured again'
    return figures, [
        readings.understood,
        f'{len(readings)} readings at {len(readings.first)} points, {repeats}: noise of the gauge '
        f'{noise.typical_um:.2f} µm, {noise.source}',
        f'film {film.min():.1f} to {film.max():.1f} µm, mean {film.mean():.1f} µm',
        where,
    ]


def _table_contents(poses: pd.Trajectory, max_pose_gap_s: float) -> Contents:
    """What was understood of a table of poses."""
    import numpy as np

    from paint_deposition.motion.stream_quality import StreamQuality

    values = np.hstack([poses.positions_m, poses.quaternions_xyzw])
    quality = StreamQuality.of(poses.stamps_ns, values, max_gap_s=max_pose_gap_s)
    box, where = _box(poses.positions_m)
    figures = {
        'poses': len(poses), 'duration_s': poses.duration_s, 'frame_id': poses.frame_id, **box,
        'notes': list(poses.notes), **vars(quality),
    }  # fmt: skip
    frame = f"'{poses.frame_id}'" if poses.frame_id else 'a frame that is not named'
    line = f'{len(poses)} poses in {frame} over {poses.duration_s:.3f} s: {where}'
    return figures, [line, *poses.notes, _stream_words(quality)]


def _box(points_m: Any) -> tuple[dict[str, list[float]], str]:
    """The box around points (N, 3): figures, and the same in words."""
    from paint_deposition.part.points import box_words

    corners = {'low_m': points_m.min(axis=0), 'high_m': points_m.max(axis=0)}
    return {name: corner.tolist() for name, corner in corners.items()}, box_words(points_m)


def _bag_lines(
    path: Path, topics: list[BagTopic], sources: list[PoseSource], triggers: list[str]
) -> list[str]:
    from paint_deposition.files.recordings.messages import JOINT_TYPE, TF_TYPES

    width = max((len(topic.name) for topic in topics), default=0)
    lines = [str(path), *(f'  {t.name:{width}}  {t.message_count:8d}  {t.type}' for t in topics)]
    kinds = {JOINT_TYPE: 'joints on', 'transforms': 'transforms from'}
    for source in sources:
        what = f'{kinds.get(source.type, "poses on")} {source.topic}'
        if source.quality is None:
            lines.append(f'{what} will not do: {source.faults[0]}')
            continue
        frame = f" in frame '{source.frame_id}'" if source.frame_id else ''
        lines += [
            f'{what}: {source.quality.poses}{frame} over {source.quality.duration_s:.3f} s, '
            f'{_stream_words(source.quality)}, in {source.unit}',
            *(f'  warning: {fault}' for fault in source.faults),
            f'  {"to be used with care" if source.faults else "will do"}: {source.options}',
        ]
    if not sources:
        lines.append('no poses: there are no messages with poses, joints or transforms that move')
    if {topic.type for topic in topics} & {*TF_TYPES}:
        lines.append('transforms: --tf TARGET SOURCE takes the motion from them')
    return [*lines, f'triggers: {" ".join(triggers) or "none"}']


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

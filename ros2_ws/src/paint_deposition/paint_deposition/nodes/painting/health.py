"""The diagnostics of the nodes that paint, and what puts their film in doubt."""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING

import numpy as np

from paint_deposition.files.recordings.messages import STATE_TYPE
from paint_deposition.film.live_film import LiveFilm
from paint_deposition.nodes.frames import SILENT_S
from paint_deposition.nodes.node import ERROR, OK, WARN, Status
from paint_deposition.nodes.painting.atomizer_input import (
    STATES_REFUSED,
    AtomizerInput,
)
from paint_deposition.nodes.topics import STATE_TOPIC, gun_topic

if TYPE_CHECKING:
    from paint_deposition.nodes.painting.painting_node import PaintingNode

NO_BRUSH = 'no state names one of the brushes yet: nothing is painted'
# What a count of poses and states is called, and whether the film lacks something because of it.
COUNTS = {
    'gaps': ('gaps', False),
    'restarts': ('restarts of the stream', False),
    'repeated_stamps': ('repeated stamps', False),
    'repeated_samples': ('repeated samples', False),
    'backward_stamps': ('backward stamps', True),
    'not_finite': ('poses that are not finite', True),
    'not_unit_quaternions': ('quaternions not of unit length', True),
    'late_triggers': ('late states', True),
}
LOST, REFUSED = 'messages lost by the middleware', 'poses refused for their frame'
UNPAINTED = 'poses not painted while inactive'
DOUBTFUL = {name for name, lacks in COUNTS.values() if lacks} | {
    LOST, REFUSED, UNPAINTED, STATES_REFUSED,
}  # fmt: skip


def what_was_wrong(source: AtomizerInput, film: LiveFilm) -> dict[str, int]:
    """How often something was wrong with a gun's poses and states since the last reset."""
    return {
        **{words: getattr(film.counts, name) for name, (words, _) in COUNTS.items()},
        'steps faster than a robot': source.steps.jumps,
        **source.anomalies,
        LOST: sum(topic.lost for topic in source.topics),
        REFUSED: source.refused_frames.total(),
    }


def poses_status(node: PaintingNode, number: int) -> Status:
    """The status of a gun's poses and states since the last reset."""
    source, film = node.inputs[number], node.film.guns[number]
    counts, rhythm_ns = film.counts, source.steps.typical_ns
    programmed, wrong = source.programmed_m_per_s, what_was_wrong(source, film)
    gun = 'off'
    if film.flow is None:
        gun = NO_BRUSH if len(film.model.brushes) > 1 else 'no state seen: always spraying'
    elif film.flow:
        gun = f'spraying, flow {film.flow:g}' + (f', brush {film.brush}' if film.brush else '')
    values: dict[str, object] = {
        'poses taken': counts.received,
        'poses refused': counts.rejected + wrong[REFUSED],
        **wrong,
        'longest interval [s]': f'{source.steps.longest_ns * 1e-9:.3f}',
        'intervals over 1.5 times the usual one': source.steps.long,
        'usual rate [Hz]': f'{1e9 / rhythm_ns:.1f}' if rhythm_ns else 'unknown',
        'speed [m/s]': f'{source.last_poses.speed_m_per_s:.3f}',
        'programmed speed [m/s]': f'{programmed:.3f}' if programmed > 0.0 else 'unknown',
        'fastest step [m/s]': f'{source.steps.fastest_m_per_s:.1f}',
        UNPAINTED: source.unpainted,
        'poses in the tf queue': len(source.tf_queue),
        'gun': gun,
    }
    if not node.active:
        if source.unpainted:
            words = f'inactive: {source.unpainted} poses came and were not painted'
            return WARN, words, values
        return OK, 'inactive', values
    # A Bool, say, which nobody hears.
    topic, unheard = gun_topic(source.name, STATE_TOPIC), ''
    for info in node.get_publishers_info_by_topic(node.resolve_topic_name(topic)):
        if info.topic_type != STATE_TYPE:
            unheard = (
                f'{topic} comes as {info.topic_type} and does not switch the gun: publish it on '
                'a topic of its own, and start atomizer_source with that topic as trigger'
            )
    if unheard and unheard != source.unheard_states:
        node.get_logger().error(unheard)
    source.unheard_states = unheard
    if unheard:
        return ERROR, unheard, values
    if source.refused_frames and time.monotonic() - source.refused_s < 5.0:
        frames = ', '.join(f"'{frame}'" for frame in source.refused_frames)
        words = (
            f'{wrong[REFUSED]} poses refused: they are in frame {frames}, the mesh is in '
            f"'{node.frame.frame_id}' and {source.refusal}"
        )
        return ERROR, words, values
    warnings = [NO_BRUSH] if gun == NO_BRUSH and counts.received else []
    warnings += sprays_without_poses(source)
    warnings += [f'{count} {words}' for words, count in wrong.items() if count]
    warnings += sorted(source.state_errors)
    if warnings:
        return WARN, ', '.join(warnings), values
    is_silent = time.monotonic() - source.pose_s > SILENT_S
    return OK, 'waiting for poses' if is_silent else 'painting', values


def sprays_without_poses(source: AtomizerInput) -> list[str]:
    """That a gun sprays and no pose comes, if that is so."""
    silent_s = time.monotonic() - source.pose_s
    if not source.spraying or silent_s <= SILENT_S:
        return []
    since = f'for {silent_s:.0f} s' if math.isfinite(silent_s) else 'since the start'
    return [f'the gun sprays, and no pose has come {since}']


def film_status(node: PaintingNode) -> Status:
    """The status of part, model, computing time and the share of each gun."""
    guns = node.film.guns
    # Computing time over duration of the motion; above 1 the node falls behind.
    sums = [np.sum(source.times_s, axis=0) for source in node.inputs if source.times_s]
    factor = float(sum(spent_s / duration_s for spent_s, duration_s in sums))
    files = dict.fromkeys(file or 'default' for file in node.files_in_use)
    effects = dict.fromkeys(effect.id for gun in guns for effect in gun.model.effects)
    values = {
        'mesh': node.mesh_file,
        'triangles': len(node.surface.faces),
        'down': ' '.join(f'{value:g}' for value in node.surface.down),
        'model': ' '.join(files),
        'effects': ' '.join(effects) or 'none',
        'poses remembered': sum(gun.log.poses for gun in guns),
        'real-time factor': f'{factor:.2f}',
        **{f'share of {gun}': f'{share:.1%}' for gun, share in node.shares.items() if gun},
        **{f'note {number}': note for number, note in enumerate(node.surface.notes, start=1)},
    }
    if problem := node.side_problem or node.model_problem:
        return WARN, problem, values
    if not all(gun.log.complete for gun in guns):
        limit = f'over {node.values["pose_memory"]} poses (pose_memory)'
        return WARN, f'{limit}: a new model paints from then on only', values
    if factor > 0.8:
        share = f'painting takes {factor:.0%} of the time that the motion lasts'
        remedy = 'poses may be lost; use a larger max_edge_length_m'
        return WARN, f'{share}: {remedy}', values
    return OK, 'preparing a changed model' if node.repainting else 'up to date', values

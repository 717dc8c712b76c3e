"""What the recorder keeps, under which name: its parameters, usual topics, and a part's run."""

import itertools
import os
import time
from collections.abc import Sequence
from pathlib import Path

from paint_msgs.msg import Part

from paint_deposition.files.provenance import provenance
from paint_deposition.files.recordings.mcap_run import COMPRESSIONS
from paint_deposition.nodes.runtime.managed_node import MANAGED
from paint_deposition.nodes.runtime.parameters import (
    FILE_NAME,
    FILE_NAME_RULE,
    NodeParameter,
    atomizers_parameter,
    fixed_while_configured,
    require_file_name,
)
from paint_deposition.nodes.runtime.topics import gun_topic

POSES, STATES = 'atomizer/pose', 'atomizer/state'
STATIC_TF, PART_POSE, PARAMETER_EVENTS = '/tf_static', 'part_pose', '/parameter_events'
# Without the mesh markers: cloud and field hold the same in a fortieth of their size.
CELL_TOPICS = (
    'thickness/cloud',
    'thickness/field',
    'thickness/stats',
    'comparison/stats',
    'planned_path',
    # The pose of the part, for poses of the TCP in other frames.
    PART_POSE,
    '/tf',
    STATIC_TF,
    '/diagnostics',
    PARAMETER_EVENTS,
)

RECORDER = dict(
    **MANAGED,
    output_directory=NodeParameter(
        'runs',
        'Folder in which the run is created [path]',
        fixed_because='remote nodes must not choose where files are written; restart the node',
    ),
    **fixed_while_configured(
        'the run is made with it; clean the node up, or call ~/stop and start another recorder',
        topics=NodeParameter(
            [],
            'Topics to record; empty: motion, film, plan, diagnostics and parameter changes '
            '[topics]',
            element=str,
        ),
        atomizers=atomizers_parameter('whose run is recorded'),
        name=NodeParameter(
            '',
            "Run's name; empty: run_<date>_<time> [text]",
            constraints=FILE_NAME_RULE,
            allows=lambda value: not value or bool(FILE_NAME.fullmatch(value)),
        ),
        compression=NodeParameter(
            'zstd', 'Compression of the chunks in the file [name]', choices=tuple(COMPRESSIONS)
        ),
        max_pose_gap_s=NodeParameter(
            0.25, 'A longer interval between pose stamps counts as a gap [s]', (0.001, 60.0)
        ),
        mesh_file=NodeParameter('', 'Mesh whose digest to keep with the run; empty: none [path]'),
        model_file=NodeParameter('', 'Model to keep with the run; empty: none [path]'),
    ),
)


def default_topics(guns: Sequence[str]) -> list[str]:
    """Motion, film, plan, diagnostics, parameter changes; of several guns the film of each."""
    motion = [gun_topic(gun, topic) for gun in guns for topic in (POSES, STATES)]
    shares = [gun_topic(gun, 'thickness/field') for gun in guns if len(guns) > 1]
    return [*motion, *shares, *CELL_TOPICS]


def part_data(part: Part, model_file: str) -> dict[str, str]:
    """The custom data of a part's run."""
    data = {'part_type': part.type, 'serial': part.serial, 'coat': str(part.coat)}
    if part.part_pose:
        data['part_pose'] = ' '.join(map(str, part.part_pose))
    # The mesh file of a simulator on another machine may not exist here.
    mesh_file = part.mesh_file if os.path.isfile(part.mesh_file) else ''
    return provenance(mesh_file, model_file) | data


def unused_name(folder: Path, run: str) -> str:
    """The name of a run, with date and time appended if it already exists."""
    require_file_name('run', run)
    dated = run + time.strftime('_%Y%m%d_%H%M%S')
    names = itertools.chain([run, dated], (f'{dated}_{number}' for number in itertools.count(2)))
    return next(name for name in names if not (folder / name).exists())

"""Parameters of `run_recorder`."""

from __future__ import annotations

from paint_deposition.files.recordings.mcap_run import COMPRESSIONS
from paint_deposition.nodes.runtime.parameters import NodeParameter

RUN_OPEN = "the run's file is open; call ~/stop and start another recorder"
KEPT = 'it was stored when the run began; call ~/stop and start another recorder'

RECORDER = (
    NodeParameter(
        'topics',
        [],
        'Topics to record; empty: motion, film, plan, diagnostics and parameter changes [topics]',
        element=str,
        fixed_because='a run holds its topics from beginning to end; start another recorder',
    ),
    NodeParameter(
        'output_directory',
        'runs',
        'Folder to make the run in [path]',
        is_path=True,
        fixed_because=RUN_OPEN,
    ),
    NodeParameter(
        'name',
        '',
        "Run's name; empty: run_<date>_<time> [text]",
        fixed_because=RUN_OPEN,
    ),
    NodeParameter(
        'compression',
        'zstd',
        'Compression of the chunks in the file [name]',
        choices=tuple(COMPRESSIONS),
        fixed_because=RUN_OPEN,
    ),
    NodeParameter(
        'max_pose_gap_s',
        0.25,
        'Longest interval between pose stamps that is no gap [s]',
        low=0.001,
        high=60.0,
        fixed_because='the gaps so far were counted with it; start another recorder',
    ),
    NodeParameter(
        'mesh_file',
        '',
        'Mesh whose digest to keep with the run; empty: none [path]',
        is_path=True,
        fixed_because=KEPT,
    ),
    NodeParameter(
        'model_file',
        '',
        'Model to keep with the run; empty: none [path]',
        is_path=True,
        fixed_because=KEPT,
    ),
)

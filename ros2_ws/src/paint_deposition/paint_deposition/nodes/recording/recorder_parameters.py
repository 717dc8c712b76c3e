"""Parameters of `run_recorder`."""

from __future__ import annotations

from paint_deposition.files.recordings.mcap_run import COMPRESSIONS
from paint_deposition.nodes.runtime.parameters import NodeParameter, fixed

RECORDER = fixed(
    "the run's file is open; call ~/stop and start another recorder",
    NodeParameter(
        'topics',
        [],
        'Topics to record; empty: motion, film, plan, diagnostics and parameter changes [topics]',
        element=str,
    ),
    NodeParameter('output_directory', 'runs', 'Folder to make the run in [path]', is_path=True),
    NodeParameter('name', '', "Run's name; empty: run_<date>_<time> [text]"),
    NodeParameter(
        'compression',
        'zstd',
        'Compression of the chunks in the file [name]',
        choices=tuple(COMPRESSIONS),
    ),
    NodeParameter(
        'max_pose_gap_s',
        0.25,
        'Longest interval between pose stamps that is no gap [s]',
        low=0.001,
        high=60.0,
    ),
    NodeParameter(
        'mesh_file',
        '',
        'Mesh whose digest to keep with the run; empty: none [path]',
        is_path=True,
    ),
    NodeParameter(
        'model_file', '', 'Model to keep with the run; empty: none [path]', is_path=True
    ),
)

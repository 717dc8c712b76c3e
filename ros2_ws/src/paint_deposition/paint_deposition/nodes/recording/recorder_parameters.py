"""Parameters of the recorder."""

from __future__ import annotations

from paint_deposition.files.recordings.mcap_run import COMPRESSIONS
from paint_deposition.nodes.runtime.file_names import FILE_NAME, FILE_NAME_WORDS
from paint_deposition.nodes.runtime.managed_node import MANAGED
from paint_deposition.nodes.runtime.parameters import (
    NodeParameter,
    atomizer_names,
    read_to_configure,
)

RECORDER = dict(
    **MANAGED,
    output_directory=NodeParameter(
        'runs',
        'Folder to make the run in [path]',
        fixed_because='the network does not choose where files are written; restart the node',
    ),
    **read_to_configure(
        'the run is made with it; clean the node up, or call ~/stop and start another recorder',
        topics=NodeParameter(
            [],
            'Topics to record; empty: motion, film, plan, diagnostics and parameter changes '
            '[topics]',
            element=str,
        ),
        atomizers=atomizer_names('whose run is recorded'),
        name=NodeParameter(
            '',
            "Run's name; empty: run_<date>_<time> [text]",
            constraints=FILE_NAME_WORDS,
            allows=lambda value: not value or bool(FILE_NAME.fullmatch(value)),
        ),
        compression=NodeParameter(
            'zstd', 'Compression of the chunks in the file [name]', choices=tuple(COMPRESSIONS)
        ),
        max_pose_gap_s=NodeParameter(
            0.25, 'Longest interval between pose stamps that is no gap [s]', (0.001, 60.0)
        ),
        mesh_file=NodeParameter('', 'Mesh whose digest to keep with the run; empty: none [path]'),
        model_file=NodeParameter('', 'Model to keep with the run; empty: none [path]'),
    ),
)

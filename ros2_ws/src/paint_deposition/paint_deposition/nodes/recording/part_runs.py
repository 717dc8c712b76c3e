"""The name of a part's run, and what is kept with it."""

import itertools
import os
import time
from pathlib import Path

from paint_msgs.msg import Part

from paint_deposition.files.provenance import provenance
from paint_deposition.nodes.runtime.parameters import require_file_name


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

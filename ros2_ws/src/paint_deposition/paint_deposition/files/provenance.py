"""What a run or a result was made with, so that a film can be explained years later.

A plan lies in a folder with its ``model.yaml``; its bag holds a copy. Bag, RAPID module and
``plan.json`` hold the digest of the model, so that another ``model.yaml`` is not taken for it.
"""

import hashlib
import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from paint_deposition import __version__, git_version
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import ModelError, PaintError
from paint_deposition.files.atomic import BLOCK_BYTES, json_text, plain, read_file, require_file
from paint_deposition.files.model_file import model_source
from paint_deposition.files.rapid.program import is_rapid
from paint_deposition.files.recordings.bag_files import custom_data


def provenance(mesh_file: str = '', model_file: str = '') -> dict[str, str]:
    """Texts by name: versions, the mesh's digest, the model in full. Empty paths are left out."""
    notes = {'package_version': __version__, 'git_version': git_version()}
    for what, path in (('mesh_file', mesh_file), ('model_file', model_file)):
        if not path:
            continue
        notes[what] = path
        try:
            if what == 'mesh_file':
                if not Path(path).exists():
                    raise PaintError(f'{path}: No such file or directory')
                notes['mesh_sha256'] = sha256(path)
            else:
                notes['model_yaml'] = model_source(Path(path))
        except PaintError as error:
            raise PaintError(f'{what} {error}') from None
    return {key: value for key, value in notes.items() if value}


def origin(
    model: DepositionModel | Mapping[str, DepositionModel] | None = None,
    files: Mapping[str, str | Path] | None = None,
    campaign: str = '',
) -> dict[str, Any]:
    """What figures were computed from, for ``provenance`` of every JSON."""
    models = model if isinstance(model, Mapping) else {'model': model} if model else {}
    named = {'campaign': campaign, **(files or {})}
    return {
        'package_version': __version__,
        'git_version': git_version(),
        'campaign': campaign,
        'models': {
            name: _values(one) | {'sha256': model_digest(one)} for name, one in models.items()
        },
        'files': [
            {'what': what, 'file': str(file), 'sha256': sha256(file)}
            for what, file in named.items() if str(file) not in ('', '.')
        ],
    }  # fmt: skip


def model_digest(model: DepositionModel) -> str:
    """SHA-256 of a model's values, wherever its file lies and however it is commented."""
    return hashlib.sha256(json_text(_values(model)).encode()).hexdigest()


def _values(model: DepositionModel) -> dict[str, Any]:
    # The patterns come last, as digests have always had them.
    brushes = {
        'brushes': [
            plain(brush.model_dump(exclude={'planar'}) | {'planar': brush.planar.model_dump()})
            for brush in model.brushes
        ]
    }
    return {
        **(brushes if model.brushes else {'planar': plain(model.planar.model_dump())}),
        'projection': plain(model.projection.model_dump()),
        'effects': [{'id': e.id, **plain(e.model_dump())} for e in model.effects],
    }


def sha256(path: str | Path) -> str:
    """Digest of a file, or of all files of a folder with their names, such as a bag's."""
    path, digest = Path(path), hashlib.sha256()
    try:
        for file in sorted(path.rglob('*')) if path.is_dir() else [path]:
            if path.is_dir():
                digest.update(str(file.relative_to(path)).encode())
            require_file(file, PaintError, math.inf)
            if file.is_file():
                with file.open('rb') as content:
                    while block := content.read(BLOCK_BYTES):
                        digest.update(block)
    except OSError as error:
        raise PaintError(f'{path}: {error.strerror}') from None
    return digest.hexdigest()


MODEL_FILE = 'model.yaml'
PLAN_FILE = 'plan.json'
IMPROVEMENT_FILE = 'improvement.json'
# The key of the digest in a bag's custom data and in plan.json.
DIGEST = 'model_sha256'


def planned_model(motion: Path) -> tuple[Path, str] | None:
    """Where the model of a plan's bag, module or table should lie, and its digest.

    None for a motion that was not planned.
    """
    folder = motion if motion.is_dir() else motion.parent
    if not is_rapid(motion) and motion.suffix != '.csv':
        digest = custom_data(motion).get(DIGEST, '')
        return (folder / MODEL_FILE, digest) if digest else None
    files, pattern = [motion], r'!.*\bmodel\b.*\bsha256 ([0-9a-f]{64})'
    if not is_rapid(motion):
        plans = (PLAN_FILE, IMPROVEMENT_FILE) if motion.name == 'passes.csv' else ()
        files, pattern = [folder / name for name in plans], rf'"{DIGEST}":\s*"([0-9a-f]{{64}})"'
    for file in filter(Path.is_file, files):
        text = read_file(file, ModelError).decode('utf-8', errors='replace')
        found = re.search(pattern, text, re.IGNORECASE)
        return (folder / MODEL_FILE, found[1]) if found else None
    return None

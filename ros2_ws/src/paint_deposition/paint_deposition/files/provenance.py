"""What a run was made with: kept in its metadata, so that a film can be explained years later."""

from __future__ import annotations

import hashlib
import subprocess
from pathlib import Path

from paint_deposition import __version__
from paint_deposition.errors import PaintError


def provenance(mesh_file: str = '', model_file: str = '') -> dict[str, str]:
    """Texts by name: versions, the mesh's digest, the model in full. Empty paths are left out."""
    notes = {'package_version': __version__, 'git_version': git_version()}
    if mesh_file:
        digest = hashlib.sha256(_content(mesh_file, 'mesh_file')).hexdigest()
        notes |= {'mesh_file': mesh_file, 'mesh_sha256': digest}
    if model_file:
        text = _content(model_file, 'model_file').decode('utf-8', errors='replace')
        notes |= {'model_file': model_file, 'model_yaml': text}
    return {key: value for key, value in notes.items() if value}


def git_version() -> str:
    """`git describe` of the sources, '' where they are installed away from their repository."""
    command = ['git', 'describe', '--always', '--dirty', '--tags']
    folder = Path(__file__).resolve().parent
    if 'site-packages' in folder.parts:  # what repository there is, it is another project's
        return ''
    try:
        done = subprocess.run(
            command, cwd=folder, capture_output=True, text=True, timeout=10, check=True
        )
    except (OSError, subprocess.SubprocessError):
        return ''
    return done.stdout.strip()


def _content(path: str, parameter: str) -> bytes:
    try:
        return Path(path).read_bytes()
    except OSError as error:
        raise PaintError(f'{parameter} {path}: {error.strerror}') from None

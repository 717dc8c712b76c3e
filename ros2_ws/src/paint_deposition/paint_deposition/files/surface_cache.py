"""Prepared parts kept on disk, so that a part seen before is there at once.

A part is found by all that it was made from: the bytes and the name of its file, the options,
and the code and libraries that prepared it. Processes may share the folder: files appear
whole, what is broken or gone is prepared again, and the parts unused for longest make room.
"""

import hashlib
import os
from dataclasses import fields
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np
from platformdirs import user_cache_path

from paint_deposition.files.atomic import replacing
from paint_deposition.part.facets import CurvedEdges
from paint_deposition.part.surface import Surface

# Where parts are kept; set but empty: nowhere.
FOLDER_VARIABLE = 'PAINT_CACHE_DIR'
MOST_BYTES = 2_000_000_000
# Smaller parts are prepared in milliseconds.
LEAST_VERTICES = 1_000
LIBRARIES = ('numpy', 'scipy', 'trimesh', 'numba', 'cascadio')
ARRAYS = ('vertices_m', 'normals', 'vertex_areas_m2', 'down', 'rim_m', 'in_hem')
INDICES = ('faces', 'neighbours')


def place_of(path: Path, *options: object) -> Path | None:
    """The file for a part prepared with these options; None where it is not kept."""
    folder = os.environ.get(FOLDER_VARIABLE)
    # A .gltf refers to other files, whose bytes are not seen here.
    if folder == '' or path.suffix.lower() == '.gltf' or not path.is_file():
        return None
    digest = hashlib.sha256(repr((path.name, options, _prepared_by())).encode())
    with path.open('rb') as file:
        # Each block waits for whatever else Python does meanwhile: few of them, within memory.
        while block := file.read(1 << 24):
            digest.update(block)
    kept_in = Path(folder) if folder else user_cache_path('paint_deposition')
    return kept_in / 'parts' / f'{digest.hexdigest()[:32]}.npz'


def find(place: Path) -> Surface | None:
    """The part that is kept there, or None."""
    try:
        with place.open('rb') as file, np.load(file, allow_pickle=False) as kept:
            arrays = {name: kept[name] for name in ARRAYS}
            curved = [kept[f'curved_{item.name}'] for item in fields(CurvedEdges)]
            faces, neighbours = (kept[name].astype(np.int64) for name in INDICES)
            notes = tuple(kept['notes'].tolist())
        os.utime(place)
    except Exception:  # whatever broken bytes provoke in NumPy; the part is prepared again
        return None
    arrays |= {'faces': faces, 'neighbours': neighbours}
    return Surface(notes=notes, curved_edges=CurvedEdges(*curved), **arrays)


def keep(place: Path, surface: Surface) -> None:
    """Keep a part for the next time, if it is large and the folder can be written."""
    if len(surface.vertices_m) < LEAST_VERTICES:
        return
    arrays = {name: getattr(surface, name) for name in ARRAYS}
    for item in fields(CurvedEdges):
        arrays[f'curved_{item.name}'] = getattr(surface.curved_edges, item.name)
    arrays |= {name: getattr(surface, name).astype(np.int32) for name in INDICES}
    arrays['notes'] = np.array(surface.notes, dtype=np.str_)
    try:
        with replacing(place) as temporary:
            np.savez(temporary, **arrays)
        _make_room(place.parent)
    except OSError:  # a full disk or a folder of somebody else: only time is lost
        return


def _make_room(folder: Path) -> None:
    """Remove the parts unused for longest, until the others take no more than ``MOST_BYTES``."""
    kept = [(path.stat(), path) for path in folder.glob('*.npz')]
    excess = sum(about.st_size for about, _ in kept) - MOST_BYTES
    for about, path in sorted(kept, key=lambda pair: pair[0].st_mtime):
        if excess <= 0:
            return
        path.unlink(missing_ok=True)
        excess -= about.st_size


@cache
def _prepared_by() -> tuple[str, ...]:
    """Digest of the code that prepares parts, and the versions of what it is built on."""
    package = Path(__file__).parent.parent
    sources = [*package.glob('part/*.py'), *package.glob('files/*mesh*.py'), Path(__file__)]
    sources = sorted([*sources, package / 'kernel/blocks.py'])
    code = hashlib.sha256(b'\0'.join(file.read_bytes() for file in sources))
    return (code.hexdigest(), *(_version(name) for name in LIBRARIES))


def _version(library: str) -> str:
    try:
        return f'{library} {version(library)}'
    except PackageNotFoundError:
        return ''

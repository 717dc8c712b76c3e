"""The bodies in a mesh file, by name, and the unit of the file."""

from __future__ import annotations

import importlib.util
import zipfile
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from paint_deposition.errors import MeshError, did_you_mean, some
from paint_deposition.files.atomic import require_file, require_small_package

if TYPE_CHECKING:
    from trimesh import Scene

# Suffixes by kind. Of those in the second row the unit is known.
PLAIN = ('.stl', '.ply', '.obj')
WITH_UNIT = ('.gltf', '.glb', '.3mf', '.step', '.stp')
SUFFIXES = (*PLAIN, *WITH_UNIT)
METRES = {'micron': 1e-6, 'millimeter': 1e-3, 'centimeter': 1e-2, 'inch': 0.0254, 'foot': 0.3048}
STEP_READER = 'cascadio'
# A binary STL: 80 bytes of anything, the number of triangles, and each with its normal.
STL_HEAD = 84
STL_TRIANGLE = np.dtype([('normal', '<f4', 3), ('corners', '<f4', (3, 3)), ('colour', '<u2')])


# Vertices (V, 3) in the file's own unit and precision, and faces (F, 3).
Body = tuple[np.ndarray, np.ndarray]


def read_bodies(path: Path, body: str | None = None) -> tuple[Body, float, list[str]]:
    """All bodies of a file as one mesh, or the one of a name (object, solid, node or part).

    With the metres of its unit, 1 where the file has none, and what was understood, for the user.
    Raises MeshError, saying what to do, for what is no mesh or has no such body.
    """
    require_file(path, MeshError)
    kind = path.suffix.lower()
    if kind == '.stl' and (triangles := _binary_stl(path)):
        if body not in (None, path.stem):
            raise MeshError(f'{path} has no body {body!r}; {did_you_mean(body, [path.stem])}')
        return triangles, 1.0, []
    scene = _scene(path, kind)
    found = _by_name(path, scene)
    if len(found) == 1 and not {*found} & {body}:  # the only one also has the name of its file
        found = {path.stem: next(iter(found.values()))}
    notes, unit_m = [], 1.0
    if kind in WITH_UNIT:
        unit_m, unit_words = _unit(path, kind, scene)
        notes.append(f'{path.name}: {unit_words}')
    if body is not None:
        if body not in found:
            raise MeshError(f'{path} has no body {body!r}; {did_you_mean(body, found)}')
        if len(found) > 1:
            notes.append(f'{path.name}: of its {len(found)} bodies {body!r} was taken')
        found = {body: found[body]}
    elif len(found) > 1:
        names = some([*found], 8)
        notes.append(
            f'{path.name}: its {len(found)} bodies were taken as one part: {names}; --body NAME '
            'takes one of them'
        )
    return _joined([*found.values()]), unit_m, notes


def _binary_stl(path: Path) -> Body | None:
    """Vertices, as in the file, and faces of a complete binary STL.

    trimesh takes five times the memory of the file.
    """
    with path.open('rb') as file:
        head = file.read(STL_HEAD)
    count = int.from_bytes(head[80:], 'little')
    if not count or path.stat().st_size != STL_HEAD + STL_TRIANGLE.itemsize * count:
        return None
    corners = np.fromfile(path, STL_TRIANGLE, offset=STL_HEAD)['corners']
    return corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3)


def _scene(path: Path, kind: str) -> Scene:
    import trimesh

    options: dict[str, Any] = {'process': False, 'skip_materials': True}
    if kind in PLAIN:
        # Letters of any encoding; other kinds know their own.
        content = _as_utf8(path, kind)
        options |= {'validate': False, 'split_objects': True} if kind == '.obj' else {}
        source: Any = BytesIO(content)
    elif kind == '.glb':
        # A file would be read for as many bytes at once as its head claims.
        source = BytesIO(path.read_bytes())
        options['resolver'] = trimesh.resolvers.FilePathResolver(str(path))
    else:
        source = str(path)
    if kind == '.3mf':
        try:
            with zipfile.ZipFile(path) as package:
                require_small_package(package)
        except zipfile.BadZipFile as error:
            raise MeshError(f'{path}: not readable as a mesh ({error}); export it again') from None
    if kind in ('.step', '.stp'):
        if importlib.util.find_spec(STEP_READER) is None:
            raise MeshError(
                f'{path}: STEP files are read by {STEP_READER}, which is not installed; run: pip '
                f'install {STEP_READER}, or export the part as one of {", ".join(PLAIN)}'
            )
        # How finely its surfaces are cut [mm, rad]: the film is then off by less than 1 % on folds
        # of 10 mm and more.
        options |= {'tol_linear': 0.1, 'tol_angular': 0.15}
    try:
        return trimesh.load_scene(source, file_type=kind[1:], **options)
    except Exception as error:  # trimesh's readers raise whatever the broken bytes provoke
        reason = (str(error).strip() or type(error).__name__).splitlines()[0][:120]
        raise MeshError(f'{path}: not readable as a mesh ({reason}); export it again') from error


def _by_name(path: Path, scene: Scene) -> dict[str, Body]:
    """Each body with triangles, placed as in the file."""
    found: dict[str, Body] = {}
    for node in scene.graph.nodes_geometry:
        pose, name = scene.graph[node]
        faces = getattr(scene.geometry[name], 'faces', None)
        if faces is None or not len(faces):
            continue
        vertices: np.ndarray = np.asarray(scene.geometry[name].vertices, dtype=np.float64)
        if vertices.shape[1:] != (3,):
            raise MeshError(f'{path}: the vertices of {name!r} have no x, y, z; export it again')
        faces = np.asarray(faces, dtype=np.int64).reshape(-1, 3)
        if np.linalg.det(pose[:3, :3]) < 0.0:
            faces = faces[:, ::-1]
        if not np.array_equal(pose, np.eye(4)):
            vertices = vertices @ pose[:3, :3].T + pose[:3, 3]
        found[str(node)] = vertices, faces
    return dict(sorted(found.items()))  # the library gives them in any order


def _joined(bodies: Sequence[Body]) -> Body:
    if not bodies:
        return np.empty((0, 3)), np.empty((0, 3), dtype=np.int64)
    if len(bodies) == 1:
        return bodies[0]
    first = np.cumsum([0, *(len(vertices) for vertices, _ in bodies)])
    faces = [faces + start for (_, faces), start in zip(bodies, first, strict=False)]
    return np.concatenate([vertices for vertices, _ in bodies]), np.concatenate(faces)


def _unit(path: Path, kind: str, scene: Scene) -> tuple[float, str]:
    """Metres to the unit of a file that has one, and how that was understood."""
    if kind in ('.gltf', '.glb'):
        return 1.0, 'glTF, in metres by its standard'
    if kind in ('.step', '.stp'):
        return 1.0, 'STEP, its unit converted to metres'
    name = str(scene.metadata.get('units') or scene.units or 'millimeter').lower()
    singular = name.removesuffix('s').replace('inche', 'inch').replace('feet', 'foot')
    if singular in ('meter', 'm'):
        return 1.0, '3MF, in metres'
    if singular not in METRES:
        raise MeshError(f'{path}: its unit is {name!r}; export it in millimetres')
    return METRES[singular], f'3MF in {singular}, converted to metres'


def _as_utf8(path: Path, kind: str) -> bytes:
    """The file's bytes, those of a text with letters of any encoding made readable."""
    content = path.read_bytes()
    if kind == '.ply':
        return content
    if kind == '.stl' and content and b'facet' not in content:
        raise MeshError(
            f'{path}: not readable as a mesh, neither a text STL nor, with its {len(content)} '
            'bytes, a complete binary one; export it again'
        )
    return content.decode('utf-8', errors='replace').encode()

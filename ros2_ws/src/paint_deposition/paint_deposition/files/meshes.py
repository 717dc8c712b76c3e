"""Part meshes in, and painted meshes out (PLY)."""

from __future__ import annotations

import importlib.util
from io import BytesIO
from itertools import repeat
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic_core import from_json

from paint_deposition.errors import LONGEST_REASON, MeshError, did_you_mean, shortened, some
from paint_deposition.files.atomic import replacing, require_file
from paint_deposition.part.edges import matched_half_edges, weld
from paint_deposition.part.refinement import edge_lengths_m, face_areas_m2
from paint_deposition.part.surface import Surface

if TYPE_CHECKING:
    from trimesh import Scene

# Suffixes by kind. Those in the second row are read in metres.
PLAIN = ('.stl', '.ply', '.obj')
WITH_UNIT = ('.gltf', '.glb', '.step', '.stp')
SUFFIXES = (*PLAIN, *WITH_UNIT)
STEP_READER = 'cascadio'
# A binary STL: 80 bytes of anything, the number of triangles, and each with its normal.
STL_HEAD = 84
STL_TRIANGLE = np.dtype([('normal', '<f4', 3), ('corners', '<f4', (3, 3)), ('colour', '<u2')])
# Vertices (V, 3) in the file's own unit and precision, and faces (F, 3).
Body = tuple[np.ndarray, np.ndarray]
LARGEST_M = 50.0
# Bodies that trimesh makes of a file, of 30 kB each; triangles of bodies that are repeated;
# vectors and indices in lists of glTF, which may be the same bytes or none.
MOST_BODIES, MOST_REPEATED, MOST_NUMBERS = 20_000, 5_000_000, 30_000_000
# Types of a PLY, little-endian.
PLY = {'float': '<f4', 'uchar': 'u1', 'int': '<i4'}


def read_mesh(
    path: str | Path,
    scale: float = 1.0,
    max_edge_length_m: float = 0.02,
    down: np.ndarray | None = None,
    body: str | None = None,
) -> Surface:
    """Read a part and refine it.

    The winding says which side is outward, toward the gun. An open surface is taken as it is; a
    closed body that is inside out is turned round, and triangles wound against their neighbours
    are turned to the majority, both with a note in ``Surface.notes``.

    Args:
        path: STL, PLY, OBJ, glTF (.gltf, .glb) or STEP (.step, .stp).
        scale: metres per unit of the file, 0.001 for millimetres; with glTF and STEP on top of
            the unit that they have.
        max_edge_length_m: longest edge after refinement [m].
        down: gravity in the mesh frame; default: -z, or -y if it is drawn flat at z = 0.
        body: name of the one body to take of several; default: all as one part, with a note.

    Raises:
        MeshError: no file, not a mesh, or nothing that could be painted; says what to do.
    """
    _require_above_zero('max_edge_length_m', max_edge_length_m, 'metres, 0.02 for instance')
    if down is not None and not (np.isfinite(down).all() and np.any(down)):
        given = np.asarray(down, dtype=float).tolist()
        raise MeshError(f'down = {given}; give the direction of gravity, [0, 0, -1] usually')
    vertices_m, faces, _, notes = read_triangles(path, scale, body)
    return Surface.from_triangles(vertices_m, faces, max_edge_length_m, down, tuple(notes))


def read_triangles(
    path: str | Path, scale: float = 1.0, body: str | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray | None, list[str]]:
    """Read the triangles of a part, all of one winding where they join; see ``read_mesh``.

    They are vertices (V, 3) [m], faces (F, 3), the number (F,) of each in the file or in the body
    taken of it, from 0, and what was put right, for the user. Triangles of several bodies have no
    numbers: the readers do not keep the order of bodies.
    """
    path = Path(path)
    meaning = 'metres per unit of the file, 0.001 for millimetres'
    _require_above_zero('mesh_scale', scale, meaning)
    if path.suffix.lower() not in SUFFIXES:
        raise MeshError(
            f'{path}: a mesh of type "{path.suffix}" cannot be read; '
            f'export it as one of {", ".join(SUFFIXES)}'
        )
    if not path.exists() or path.is_dir():
        raise MeshError(f'{path}: no such mesh file; check the path')
    (vertices, faces), notes, count = read_bodies(path, body)
    if not len(faces):
        raise MeshError(f'{path}: holds no triangles; export the surface as a triangle mesh')
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise MeshError(
            f'{path}: a triangle names vertex {int(faces.max())} of {len(vertices)}; '
            'export it again'
        )
    if not np.isfinite(vertices).all():
        wrong = np.sum(~np.isfinite(vertices).all(axis=1))
        raise MeshError(
            f'{path}: {wrong} of {len(vertices)} vertices are not finite; export it again'
        )
    if scale != 1.0:
        vertices = vertices.astype(np.float64) * scale
    used = np.zeros(len(vertices), dtype=bool)
    used[faces] = True
    extent = float(np.ptp(vertices if used.all() else vertices[used], axis=0).max())
    if not 0.005 <= extent <= LARGEST_M:
        found = f'only {extent * 1e3:.3g} mm large, it looks scaled down; use a larger '
        remedy = '--mesh-scale, or mesh_scale'
        if extent > LARGEST_M:
            found = f'{extent:.4g} m large, it looks like millimetres; use '
            remedy = '--mesh-scale 0.001, or mesh_scale: 0.001'
        raise MeshError(
            f"{path}: the part would be {found}{remedy} in a campaign or as the node's parameter"
        )
    vertices, faces = weld(vertices, faces)
    # Triangles lower than this have no direction that could be trusted.
    heights_wanted = 1e-7 * edge_lengths_m(vertices, faces).max(axis=1)
    rows = np.flatnonzero(2.0 * face_areas_m2(vertices, faces) > heights_wanted)
    if not len(rows):
        raise MeshError(f'{path}: none of its {len(faces)} triangles has an area; export it again')
    if left_out := len(faces) - len(rows):
        notes.append(f'{left_out} of {len(faces)} triangles without area were left out')
    faces = faces[rows] if len(rows) < len(faces) else faces
    return vertices, _oriented(vertices, faces, notes), rows if count == 1 else None, notes


def _require_above_zero(name: str, value: float, meaning: str) -> None:
    if not (np.isfinite(value) and value > 0.0):
        raise MeshError(f'{name} = {value:g}; give a number above 0: {meaning}')


def _oriented(vertices_m: np.ndarray, faces: np.ndarray, notes: list[str]) -> np.ndarray:
    """Each connected surface wound alike, as most of its area was; a closed body outward."""
    paired, clashing, single = matched_half_edges(faces)
    if len(clashing):
        from trimesh import Trimesh
        from trimesh.graph import connected_component_labels
        from trimesh.repair import fix_winding

        mesh = Trimesh(vertices_m, faces, process=False, validate=False)
        fix_winding(mesh)
        turned = (np.asarray(mesh.faces) != faces).any(axis=1)
        pairs = np.concatenate([paired, clashing]) // 3
        sheet = connected_component_labels(pairs, len(faces))
        areas = face_areas_m2(vertices_m, faces)
        turned_share = np.bincount(sheet, areas * turned) / np.bincount(sheet, areas)
        turned ^= (turned_share > 0.5)[sheet]
        notes.append(f'{turned.sum()} triangles wound against their neighbours were turned round')
        faces = np.where(turned[:, None], faces[:, ::-1], faces)
        _, clashing, single = matched_half_edges(faces)
    if not len(single) and not len(clashing):
        a, b, c = (vertices_m - vertices_m.mean(axis=0))[faces].transpose(1, 0, 2)
        if np.einsum('ij,ij->', a, np.cross(b, c)) < 0.0:  # six times its volume
            notes.append('the closed body was inside out and was turned round')
            faces = faces[:, ::-1]
    return np.ascontiguousarray(faces)


def read_bodies(path: Path, body: str | None = None) -> tuple[Body, list[str], int]:
    """All bodies of a file as one mesh, or the one of a name (object, solid, node or part).

    With what was understood, for the user, and how many bodies it is of. Raises MeshError, saying
    what to do, for what is no mesh or has no such body.
    """
    require_file(path, MeshError)
    kind = path.suffix.lower()
    if kind == '.stl':
        with path.open('rb') as file:
            head = file.read(STL_HEAD)
        count = int.from_bytes(head[80:], 'little')
        # A complete binary STL; trimesh takes five times the memory of the file.
        if count and path.stat().st_size == STL_HEAD + STL_TRIANGLE.itemsize * count:
            if body not in (None, path.stem):
                raise MeshError(f'{path} has no body {body!r}; {did_you_mean(body, [path.stem])}')
            corners = np.fromfile(path, STL_TRIANGLE, offset=STL_HEAD)['corners']
            return (corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3)), [], 1
    try:
        found = _by_name(path, _scene(path, kind))
    except MeshError:
        raise
    except Exception as error:  # trimesh's readers raise whatever the broken bytes provoke
        reason = shortened(str(error), LONGEST_REASON) or type(error).__name__
        raise MeshError(f'{path}: not readable as a mesh ({reason}); export it again') from error
    if len(found) == 1 and not {*found} & {body}:  # the only one also has the name of its file
        found = {path.stem: next(iter(found.values()))}
    notes = []
    if kind in WITH_UNIT:
        unit = 'glTF, in metres by its standard'
        if kind in ('.step', '.stp'):
            unit = 'STEP, its unit converted to metres'
        notes.append(f'{path.name}: {unit}')
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
    bodies = [*found.values()] or [(np.empty((0, 3)), np.empty((0, 3), dtype=np.int64))]
    first = np.cumsum([0, *(len(vertices) for vertices, _ in bodies)])
    faces = [faces + start for (_, faces), start in zip(bodies, first, strict=False)]
    whole = np.concatenate([vertices for vertices, _ in bodies]), np.concatenate(faces)
    return whole, notes, len(bodies)


def _scene(path: Path, kind: str) -> Scene:
    import trimesh

    options: dict[str, Any] = {'process': False, 'skip_materials': True}
    source: Any = str(path)
    bodies = 0
    if kind not in ('.step', '.stp'):
        content = path.read_bytes()
        if kind == '.stl' and content and b'facet' not in content:
            raise MeshError(
                f'{path}: not readable as a mesh, neither a text STL nor, with its {len(content)} '
                'bytes, a complete binary one; export it again'
            )
        if kind in ('.stl', '.obj'):  # a text with letters of any encoding
            content = content.decode('utf-8', errors='replace').encode()
        if kind == '.obj':
            options |= {'validate': False, 'split_objects': True}
            content = content.replace(b'\r\n', b'\n').replace(b'\\\n', b'')  # one line each
            bodies = content.count(b'\no') + content.count(b'usemtl ')
        if kind in ('.gltf', '.glb'):
            glb = slice(20, 20 + int.from_bytes(content[12:16], 'little'))
            head = from_json(content[glb] if kind == '.glb' else content)
            bodies = sum(len(one['primitives']) for one in head.get('meshes', ()))
            bodies = max(bodies, len(head.get('nodes', ())))
            numbers = sum(one['count'] for one in head.get('accessors', ()))
            if numbers > MOST_NUMBERS:
                raise MeshError(f'{path}: lists {numbers} numbers; give {MOST_NUMBERS} at most')
            options['resolver'] = beside = trimesh.resolvers.FilePathResolver(str(path))
            place = beside.absolute
            vars(beside)['absolute'] = lambda name: require_file(place(name), MeshError)
        # A file would be read for as many bytes at once as its head claims.
        source = BytesIO(content)
    else:
        if importlib.util.find_spec(STEP_READER) is None:
            raise MeshError(
                f'{path}: STEP files are read by {STEP_READER}, which is not installed; run: pip '
                f'install {STEP_READER}, or export the part as one of {", ".join(PLAIN)}'
            )
        # How finely its surfaces are cut [mm, rad]: the film is then off by less than 1 % on folds
        # of 10 mm and more.
        options |= {'tol_linear': 0.1, 'tol_angular': 0.15}
    if bodies > MOST_BODIES:
        raise MeshError(
            f'{path}: has {bodies} bodies, over {MOST_BODIES}; join them, or export fewer'
        )
    return trimesh.load_scene(source, file_type=kind[1:], **options)


def _by_name(path: Path, scene: Scene) -> dict[str, Body]:
    """Each body with triangles, placed as in the file."""
    found: dict[str, Body] = {}
    placed, repeated = set(), 0
    for node in scene.graph.nodes_geometry:
        pose, name = scene.graph[node]
        faces = getattr(scene.geometry[name], 'faces', None)
        if faces is None or not len(faces):
            continue
        repeated += len(faces) if name in placed else 0
        if repeated > MOST_REPEATED:
            raise MeshError(f'{path}: repeats bodies of over {MOST_REPEATED} triangles; use fewer')
        placed.add(name)
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


def write_mesh_ply(
    path: str | Path, surface: Surface, colours: np.ndarray, **properties: np.ndarray
) -> None:
    """Write a surface with its normals as PLY, replacing the file at once.

    ``colours`` are (V, 3) or (V, 4) uint8; ``properties`` (V,) values of the vertices by name.
    """
    columns = [
        *zip(('x', 'y', 'z'), repeat('float'), surface.vertices_m.T, strict=False),
        *zip(('nx', 'ny', 'nz'), repeat('float'), surface.normals.T, strict=False),
        *zip(('red', 'green', 'blue', 'alpha'), repeat('uchar'), colours.T, strict=False),
        *((name, 'float', values) for name, values in properties.items()),
    ]
    vertices = np.empty(len(surface.vertices_m), [(name, PLY[kind]) for name, kind, _ in columns])
    for name, _, values in columns:
        vertices[name] = values
    faces = np.empty(len(surface.faces), [('count', PLY['uchar']), ('corners', PLY['int'], 3)])
    faces['count'], faces['corners'] = 3, surface.faces
    head = [
        'ply', 'format binary_little_endian 1.0', f'element vertex {len(vertices)}',
        *(f'property {kind} {name}' for name, kind, _ in columns),
        f'element face {len(faces)}', 'property list uchar int vertex_indices', 'end_header', '',
    ]  # fmt: skip
    with replacing(path) as temporary, temporary.open('wb') as file:
        file.write('\n'.join(head).encode())
        vertices.tofile(file)
        faces.tofile(file)

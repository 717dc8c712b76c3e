"""Part meshes in, and painted meshes out (PLY)."""

from dataclasses import dataclass
from itertools import repeat
from pathlib import Path

import numpy as np

from paint_deposition.errors import MeshError
from paint_deposition.files.atomic import replacing
from paint_deposition.files.mesh_bodies import SUFFIXES, read_bodies
from paint_deposition.part.edges import Edges, weld
from paint_deposition.part.points import box_extent_m
from paint_deposition.part.refinement import face_areas_m2, longest_edges_m
from paint_deposition.part.surface import Surface

LARGEST_M = 50.0
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
        path: STL, PLY, OBJ, glTF (.gltf, .glb), 3MF or STEP (.step, .stp).
        scale: metres per unit of the file, 0.001 for millimetres; with glTF, 3MF and STEP on top
            of the unit that they have.
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
    read = read_triangles(path, scale, body)
    return Surface.from_triangles(
        read.vertices_m, read.faces, max_edge_length_m, down, tuple(read.notes)
    )


@dataclass(frozen=True)
class Triangles:
    """The triangles of a file, ready to be refined."""

    vertices_m: np.ndarray  # (V, 3) [m]
    faces: np.ndarray  # (F, 3) wound alike
    rows: np.ndarray  # (F,) number of each in the file, or in the body taken of it, from 0
    notes: list[str]  # what was put right, for the user


def read_triangles(path: str | Path, scale: float = 1.0, body: str | None = None) -> Triangles:
    """Read the triangles of a part, all of one winding where they join; see ``read_mesh``."""
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
    (vertices, faces), unit_m, notes = read_bodies(path, body)
    _require_whole(path, vertices, faces)
    if unit_m * scale != 1.0:
        vertices = vertices.astype(np.float64) * (unit_m * scale)
    _check_extent(path, vertices, faces)
    vertices, faces = weld(vertices, faces)
    rows = np.flatnonzero(_with_area(path, vertices, faces, notes))
    faces = faces[rows] if len(rows) < len(faces) else faces
    return Triangles(vertices, _oriented(vertices, faces, notes), rows, notes)


def _require_above_zero(name: str, value: float, meaning: str) -> None:
    if not (np.isfinite(value) and value > 0.0):
        raise MeshError(f'{name} = {value:g}; give a number above 0: {meaning}')


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


def _require_whole(path: Path, vertices: np.ndarray, faces: np.ndarray) -> None:
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


def _check_extent(path: Path, vertices_m: np.ndarray, faces: np.ndarray) -> None:
    used = np.zeros(len(vertices_m), dtype=bool)
    used[faces] = True
    corners_m = vertices_m if used.all() else vertices_m[used]
    extent = float(box_extent_m(corners_m).max())
    if not 0.005 <= extent <= LARGEST_M:
        found = f'only {extent * 1e3:.3g} mm large, it looks scaled down; use a larger '
        remedy = '--mesh-scale, or mesh_scale'
        if extent > LARGEST_M:
            found = f'{extent:.4g} m large, it looks like millimetres; use '
            remedy = '--mesh-scale 0.001, or mesh_scale: 0.001'
        raise MeshError(
            f"{path}: the part would be {found}{remedy} in a campaign or as the node's parameter"
        )


def _with_area(
    path: Path, vertices_m: np.ndarray, faces: np.ndarray, notes: list[str]
) -> np.ndarray:
    """(F,) bool, which of the triangles have an area."""
    # Triangles lower than this have no direction that could be trusted.
    heights_wanted = 1e-7 * longest_edges_m(vertices_m, faces)
    good = 2.0 * face_areas_m2(vertices_m, faces) > heights_wanted
    if not good.any():
        raise MeshError(f'{path}: none of its {len(faces)} triangles has an area; export it again')
    if not good.all():
        notes.append(f'{np.sum(~good)} of {len(faces)} triangles without area were left out')
    return good


def _oriented(vertices_m: np.ndarray, faces: np.ndarray, notes: list[str]) -> np.ndarray:
    edges = Edges.of(faces)
    if len(edges.clashing):
        turned = _turned_to_majority(vertices_m, faces, edges)
        count = np.sum((turned != faces).any(axis=1))
        notes.append(f'{count} triangles wound against their neighbours were turned round')
        faces, edges = turned, Edges.of(turned)
    if not len(edges.single) and not len(edges.clashing):
        a, b, c = (vertices_m - vertices_m.mean(axis=0))[faces].transpose(1, 0, 2)
        if np.einsum('ij,ij->', a, np.cross(b, c)) < 0.0:  # six times its volume
            notes.append('the closed body was inside out and was turned round')
            faces = faces[:, ::-1]
    return np.ascontiguousarray(faces)


def _turned_to_majority(vertices_m: np.ndarray, faces: np.ndarray, edges: Edges) -> np.ndarray:
    """Wind each connected surface alike, as most of its area was."""
    from trimesh import Trimesh
    from trimesh.graph import connected_component_labels
    from trimesh.repair import fix_winding

    mesh = Trimesh(vertices_m, faces, process=False, validate=False)
    fix_winding(mesh)
    turned = (np.asarray(mesh.faces) != faces).any(axis=1)
    pairs = np.concatenate([edges.paired, edges.clashing]) // 3
    sheet = connected_component_labels(pairs, len(faces))
    areas = face_areas_m2(vertices_m, faces)
    turned_share = np.bincount(sheet, areas * turned) / np.bincount(sheet, areas)
    turned ^= (turned_share > 0.5)[sheet]
    return np.where(turned[:, None], faces[:, ::-1], faces)

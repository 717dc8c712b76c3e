"""The simulator's film as messages."""

from __future__ import annotations

import sys
from array import array
from collections.abc import Mapping
from functools import cached_property

import numpy as np
from paint_msgs.msg import ThicknessField, ThicknessStats
from rclpy.serialization import serialize_message
from sensor_msgs.msg import PointCloud2, PointField
from visualization_msgs.msg import Marker

from paint_deposition.film.integrator import NO_PAINT_UM
from paint_deposition.film.statistics import FilmStatistics
from paint_deposition.nodes.runtime.messages import ColouredMesh, header, white_marker
from paint_deposition.part.surface import Surface

# Triangles of a marker, which takes 120 bytes for each.
MOST_FACES = 150_000
KINDS = {'f': PointField.FLOAT32, 'u': PointField.UINT32}
POINT = np.dtype([(name, np.float32) for name in ('x', 'y', 'z', 'thickness_um')])
CHANGED_POINT = np.dtype([*POINT.descr, ('vertex', np.uint32)])


class ShownFilm:
    """A part as the simulator shows it: its messages."""

    def __init__(self, surface: Surface, frame_id: str) -> None:
        self.surface, self._frame_id = surface, frame_id
        self._made: dict[int, ColouredMesh] = {}

    @cached_property
    def mesh_id(self) -> str:
        """Digest of the refined mesh."""
        return self.surface.mesh_id

    @property
    def tiles(self) -> int:
        """How many markers the mesh takes."""
        return -(-len(self.surface.faces) // MOST_FACES)

    def corners(self, tile: int) -> np.ndarray:
        """(3 F,) vertices at the corners of a marker's triangles."""
        return self._faces_of(tile).ravel()

    def tile(self, number: int) -> ColouredMesh:
        """A marker of the mesh, made when it is first needed."""
        if number not in self._made:
            faces, vertices = self._faces_of(number), self.surface.vertices_m
            self._made[number] = ColouredMesh(vertices, faces, self._frame_id, 'thickness', number)
        return self._made[number]

    def _faces_of(self, tile: int) -> np.ndarray:
        faces = self._faces
        return faces[len(faces) * tile // self.tiles : len(faces) * (tile + 1) // self.tiles]

    @cached_property
    def _faces(self) -> np.ndarray:
        """Those of the part; of a large one along its longest side, so that few markers change."""
        vertices, faces = self.surface.vertices_m, self.surface.faces
        if self.tiles == 1:
            return faces
        along = vertices[:, np.ptp(vertices, axis=0).argmax()]
        return faces[np.argsort(along[faces].sum(axis=1), kind='stable')]

    def cloud(
        self, stamp_ns: int, film_um: np.ndarray, vertices: np.ndarray | None = None
    ) -> PointCloud2:
        """x, y, z [m] and thickness_um of all vertices, or of these with their numbers.

        Args:
            film_um: (V,) film [um]. vertices: (N,) their numbers.
        """
        layout = POINT if vertices is None else CHANGED_POINT
        rows = slice(None) if vertices is None else vertices
        points = np.empty(len(film_um[rows]), layout)
        for name, column in zip('xyz', self.surface.vertices_m.T, strict=True):
            points[name] = column[rows]
        points['thickness_um'] = film_um[rows]
        if vertices is not None:
            points['vertex'] = vertices
        return PointCloud2(
            height=1,
            width=len(points),
            fields=[
                PointField(name=name, offset=4 * k, datatype=KINDS[layout[name].kind], count=1)
                for k, name in enumerate(layout.names or ())
            ],
            is_bigendian=sys.byteorder == 'big',
            point_step=layout.itemsize,
            row_step=points.nbytes,
            data=array('B', points.tobytes()),
            is_dense=True,
            header=header(self._frame_id, stamp_ns),
        )

    def field(self, stamp_ns: int, film_um: np.ndarray) -> ThicknessField:
        """(V,) film [um] in the order of the vertices."""
        return ThicknessField(
            header=header(self._frame_id, stamp_ns),
            mesh_id=self.mesh_id,
            thickness_um=array('f', film_um.astype(np.float32).tobytes()),
        )


class FilmChanges:
    """Clouds of the points whose film has changed since they were last in one.

    The first holds the whole film, a point for each vertex in their order. The others have one
    more field, the number of the vertex.
    """

    def __init__(self, shown_as: ShownFilm) -> None:
        self._shown_as = shown_as
        self._sent_um: np.ndarray | None = None

    def message(
        self, stamp_ns: int, film_um: np.ndarray, whole: bool, exact: bool
    ) -> PointCloud2 | None:
        """What has changed, None if nothing has.

        Args:
            film_um: (V,) the film as it is now [um].
            whole: show all of it, as the first time.
            exact: show every change, also what no gauge would show.
        """
        now_um = film_um.astype(np.float32)
        if whole or self._sent_um is None:
            self._sent_um = now_um
            return self._shown_as.cloud(stamp_ns, now_um)
        change_um = np.abs(now_um - self._sent_um)
        vertices = np.flatnonzero(change_um > (0.0 if exact else NO_PAINT_UM))
        if not len(vertices):
            return None
        self._sent_um[vertices] = now_um[vertices]
        return self._shown_as.cloud(stamp_ns, now_um, vertices)


class MeshTiles:
    """The coloured mesh: one marker, or several of a large part, each sent as its colours change.

    To make and send a marker of a million triangles takes half a second, during which poses and
    statistics wait. A large part therefore goes out in turns.

    Args:
        shown_as: the part, which has the markers.
        clear: whether markers of another part are to be removed first.
    """

    def __init__(self, shown_as: ShownFilm, clear: bool = False) -> None:
        self._shown_as = shown_as
        self._clear = clear
        self._sent: list[tuple[object, np.ndarray] | None] = [None] * shown_as.tiles
        self._next = 0

    def message(
        self, edition: object, stamp_ns: int, palette: np.ndarray, rows: np.ndarray, whole: bool
    ) -> bytes | None:
        """The next marker, None if there is nothing to show.

        A part of one marker is sent in every edition; of several, those whose colours changed.

        Args:
            edition: of the film. palette, rows: as for ``ColouredMesh.serialised``.
            whole: send all of them, as to somebody who is new.
        """
        count = len(self._sent)
        if whole:
            self._sent = [None] * count
        if self._clear:
            self._clear = False
            return serialize_message(
                white_marker(Marker.TRIANGLE_LIST, '', 0, '', action=Marker.DELETEALL)
            )
        for tile in ((self._next + k) % count for k in range(count)):
            sent = self._sent[tile]
            if sent is not None and sent[0] == edition:
                continue
            now = rows[self._shown_as.corners(tile)]
            if sent is not None and count > 1 and np.array_equal(sent[1], now):
                continue
            self._sent[tile] = edition, now
            self._next = (tile + 1) % count
            return self._shown_as.tile(tile).serialised(stamp_ns, palette, rows)
        return None


def shares(laid_cm3: Mapping[str, float]) -> dict[str, float]:
    """Each gun's share of the paint on the part, 0 to 1; all 0 where there is none."""
    total = sum(laid_cm3.values())
    return {gun: laid / total if total else 0.0 for gun, laid in laid_cm3.items()}


def stats_message(
    frame_id: str, stamp_ns: int, figures: FilmStatistics, laid_cm3: Mapping[str, float]
) -> ThicknessStats:
    """The film's figures; counts of poses are the caller's to add.

    Args:
        laid_cm3: solids on the part by the name of the gun that laid them [cm3].
    """
    message = ThicknessStats(header=header(frame_id, stamp_ns))
    message.atomizers = list(laid_cm3)
    message.atomizer_volume_cm3 = list(laid_cm3.values())
    message.atomizer_share = list(shares(laid_cm3).values())
    for name in (
        'mean_um', 'std_dev_um', 'min_um', 'max_um', 'coverage', 'within_target',
        'painted_volume_cm3', 'capture_fraction',
    ):  # fmt: skip
        setattr(message, name, getattr(figures, name))
    return message

"""The simulator's film as messages, whose arrays are filled in place."""

from __future__ import annotations

import sys
from array import array
from collections.abc import Mapping

import numpy as np
from paint_msgs.msg import ThicknessField, ThicknessStats
from rclpy.time import Time
from sensor_msgs.msg import PointCloud2, PointField

from paint_deposition.film.statistics import FilmStatistics
from paint_deposition.nodes.runtime.messages import ColouredMesh, header
from paint_deposition.part.surface import Surface


class ShownFilm:
    """A part as the simulator shows it: mesh, cloud and field, ready to be filled.

    Attributes:
        mesh_id: digest of the refined mesh.
    """

    def __init__(self, surface: Surface, frame_id: str) -> None:
        self.mesh_id = surface.mesh_id
        self.mesh = ColouredMesh(surface.vertices_m, surface.faces, frame_id, 'thickness')
        self.cloud = FilmCloud(surface.vertices_m, frame_id)
        self.field = FilmField(len(surface.vertices_m), self.mesh_id, frame_id)


def shares(laid_cm3: Mapping[str, float]) -> dict[str, float]:
    """Each gun's share of the paint on the part, 0 to 1; all 0 where there is none."""
    total = sum(laid_cm3.values())
    return {gun: laid / total if total else 0.0 for gun, laid in laid_cm3.items()}


class FilmCloud:
    """A PointCloud2 with x, y, z [m] and thickness_um, filled in place."""

    FIELDS = ('x', 'y', 'z', 'thickness_um')

    def __init__(self, positions_m: np.ndarray, frame_id: str) -> None:
        size = 4 * len(self.FIELDS)
        self._message = PointCloud2(
            height=1,
            width=len(positions_m),
            fields=[
                PointField(name=name, offset=4 * k, datatype=PointField.FLOAT32, count=1)
                for k, name in enumerate(self.FIELDS)
            ],
            is_bigendian=sys.byteorder == 'big',
            point_step=size,
            row_step=size * len(positions_m),
            data=array('B', bytes(size * len(positions_m))),
            is_dense=True,
            header=header(frame_id, 0),
        )
        self._values = np.frombuffer(self._message.data, np.float32).reshape(-1, len(self.FIELDS))
        self._values[:, :3] = positions_m

    def message(self, stamp_ns: int, film_um: np.ndarray) -> PointCloud2:
        """The one message that is filled; publish it before the next call."""
        self._message.header.stamp = Time(nanoseconds=stamp_ns).to_msg()
        self._values[:, 3] = film_um
        return self._message


class FilmField:
    """A ThicknessField, filled in place."""

    def __init__(self, vertex_count: int, mesh_id: str, frame_id: str) -> None:
        self._message = ThicknessField(
            header=header(frame_id, 0),
            mesh_id=mesh_id,
            thickness_um=array('f', bytes(4 * vertex_count)),
        )
        self._values = np.frombuffer(self._message.thickness_um, np.float32)

    def message(self, stamp_ns: int, film_um: np.ndarray) -> ThicknessField:
        """The one message that is filled; publish it before the next call."""
        self._message.header.stamp = Time(nanoseconds=stamp_ns).to_msg()
        self._values[:] = film_um
        return self._message


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

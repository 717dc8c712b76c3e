"""The simulator's film as messages."""

from __future__ import annotations

import sys
from array import array
from collections.abc import Mapping
from functools import cached_property

import numpy as np
from paint_msgs.msg import ThicknessField, ThicknessStats
from sensor_msgs.msg import PointCloud2, PointField

from paint_deposition.film.statistics import FilmStatistics
from paint_deposition.nodes.runtime.messages import ColouredMesh, header
from paint_deposition.part.surface import Surface

POINT = ('x', 'y', 'z', 'thickness_um')


class ShownFilm:
    """A part as the simulator shows it: its messages."""

    def __init__(self, surface: Surface, frame_id: str) -> None:
        self.surface, self._frame_id = surface, frame_id

    @cached_property
    def mesh_id(self) -> str:
        """Digest of the refined mesh."""
        return self.surface.mesh_id

    @cached_property
    def mesh(self) -> ColouredMesh:
        """The marker, made when it is first needed."""
        surface = self.surface
        return ColouredMesh(surface.vertices_m, surface.faces, self._frame_id, 'thickness')

    def cloud(self, stamp_ns: int, film_um: np.ndarray) -> PointCloud2:
        """x, y, z [m] and thickness_um (V,) of all vertices."""
        points = np.column_stack([self.surface.vertices_m, film_um]).astype(np.float32)
        kind = PointField.FLOAT32
        return PointCloud2(
            height=1,
            width=len(points),
            fields=[
                PointField(name=name, offset=4 * k, datatype=kind, count=1)
                for k, name in enumerate(POINT)
            ],
            is_bigendian=sys.byteorder == 'big',
            point_step=4 * len(POINT),
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

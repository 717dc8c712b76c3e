"""The colour bar beside the part, for viewers that have none of their own."""

from __future__ import annotations

import numpy as np
from geometry_msgs.msg import Point, Vector3
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from paint_deposition.film.colour_scales import TABLE, ColourScale
from paint_deposition.nodes.runtime.messages import white_marker
from paint_deposition.part.orientation import across_axis, downhill_axis
from paint_deposition.part.surface import Surface

STEPS = 64
LABELS = 5


def legend(scale: ColourScale, unit: str, surface: Surface, frame_id: str) -> MarkerArray:
    """A bar in the scale's colours with values beside it, upright at the side of the part."""
    across = across_axis(surface.outward, surface.down)
    up = -downhill_axis(surface.outward, surface.down)
    heights, widths = surface.vertices_m @ up, surface.vertices_m @ across
    size = float(np.ptp(heights)) or float(np.ptp(widths))
    corner = (
        surface.vertices_m.mean(axis=0)
        + (widths.max() + 0.08 * size - widths.mean()) * across
        + (heights.min() - heights.mean()) * up
    )
    bar = _bar(scale, corner, size * up, 0.04 * size * across, frame_id)
    labels = [
        _label(
            number,
            f'{scale.low + (scale.high - scale.low) * share:g} {unit}',
            corner + share * size * up + 0.1 * size * across,
            0.04 * size,
            frame_id,
        )
        for number, share in enumerate(np.linspace(0.0, 1.0, LABELS))
    ]
    return MarkerArray(markers=[bar, *labels])


def _bar(
    scale: ColourScale, corner: np.ndarray, up: np.ndarray, across: np.ndarray, frame_id: str
) -> Marker:
    marker = white_marker(Marker.TRIANGLE_LIST, 'legend', 0, frame_id)
    square = [(0, 0), (1, 0), (1, 1), (0, 0), (1, 1), (0, 1)]
    for step in range(STEPS):
        r, g, b, a = (scale.palette[step * TABLE // STEPS] / 255.0).tolist()
        for right, over in square:
            x, y, z = (corner + right * across + (step + over) / STEPS * up).tolist()
            marker.points.append(Point(x=x, y=y, z=z))
            marker.colors.append(ColorRGBA(r=r, g=g, b=b, a=a))
    return marker


def _label(number: int, text: str, place: np.ndarray, height_m: float, frame_id: str) -> Marker:
    marker = white_marker(Marker.TEXT_VIEW_FACING, 'legend', number + 1, frame_id)
    marker.text = text
    marker.scale = Vector3(z=height_m)
    x, y, z = place.tolist()
    marker.pose.position = Point(x=x, y=y, z=z)
    return marker

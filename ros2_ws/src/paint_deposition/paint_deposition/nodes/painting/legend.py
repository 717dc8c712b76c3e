"""A colour bar beside the part, for viewers without one of their own."""

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
    bar = white_marker(Marker.TRIANGLE_LIST, 'legend', 0, frame_id)
    for step in range(STEPS):
        r, g, b, a = (scale.palette[step * TABLE // STEPS] / 255.0).tolist()
        for right, over in ((0, 0), (1, 0), (1, 1), (0, 0), (1, 1), (0, 1)):
            place = corner + 0.04 * size * right * across + size * (step + over) / STEPS * up
            bar.points.append(_point(place))
            bar.colors.append(ColorRGBA(r=r, g=g, b=b, a=a))
    markers = [bar]
    for number, share in enumerate(np.linspace(0.0, 1.0, LABELS), start=1):
        label = white_marker(Marker.TEXT_VIEW_FACING, 'legend', number, frame_id)
        label.text = f'{scale.low + (scale.high - scale.low) * share:g} {unit}'
        label.scale = Vector3(z=0.04 * size)
        label.pose.position = _point(corner + share * size * up + 0.1 * size * across)
        markers.append(label)
    return MarkerArray(markers=markers)


def _point(place_m: np.ndarray) -> Point:
    x, y, z = place_m.tolist()
    return Point(x=x, y=y, z=z)

"""The publishers of the simulator's film: statistics, legend, trust, mesh, cloud and field."""

import sys
import time
from array import array
from collections.abc import Callable, Mapping
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Point, Vector3
from paint_msgs.msg import PoseProgress, ThicknessField, ThicknessStats
from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from sensor_msgs.msg import PointCloud2, PointField
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from paint_deposition.files.recordings.messages import stamp_ns
from paint_deposition.film.common_film import CommonFilm
from paint_deposition.film.statistics import FIGURES, FilmStatistics, film_statistics
from paint_deposition.nodes import topics
from paint_deposition.nodes.node import OK, WARN
from paint_deposition.nodes.painting.atomizer_input import LONGEST_NAME, MOST_NAMES
from paint_deposition.nodes.painting.health import (
    DOUBTFUL,
    UNPAINTED,
    sprays_without_poses,
    what_was_wrong,
)
from paint_deposition.nodes.painting.painting_node import PaintingNode
from paint_deposition.nodes.topics import (
    PROGRESS_TOPIC,
    MeshMessage,
    coloured_mesh,
    gun_topic,
    header,
    node_name,
    white_marker,
)
from paint_deposition.part.points import across_axis, downhill_axis
from paint_deposition.part.surface import Surface
from paint_deposition.part.zones import Zones
from paint_deposition.report.colour_scales import TABLE, ColourScale, film_scale

# A subscriber that acknowledges nothing for so long does not delay the others.
ACKNOWLEDGE_TIMEOUT_S = 5.0


def film_figures(
    values: Mapping[str, Any],
    surface: Surface,
    film: CommonFilm,
    film_um: np.ndarray,
    zones: Zones | None,
) -> tuple[FilmStatistics, list[float], list[float]]:
    """The statistics of a film (V,), by the targets and the thresholds among the parameters.

    After them come the solids that each gun laid on the part [cm3], and its share of them, 0 to 1;
    0 without any paint.
    """
    chosen = {k: values[k] for k in ('painted_above_um', 'target_um', 'target_tolerance_um')}
    area_m2, emitted_cm3 = surface.vertex_areas_m2, film.used.emitted_cm3
    laid_cm3 = film.laid_cm3(area_m2).tolist()
    total = sum(laid_cm3)
    shares = [laid / total if total else 0.0 for laid in laid_cm3]
    return film_statistics(film_um, area_m2, emitted_cm3, zones=zones, **chosen), laid_cm3, shares


def cloud_message(surface: Surface, film_um: np.ndarray, at: Header) -> PointCloud2:
    """A cloud of all vertices, x, y, z [m], with their film (V,) as thickness_um."""
    points = np.column_stack([surface.vertices_m, film_um]).astype(np.float32)
    names, kind = ('x', 'y', 'z', 'thickness_um'), PointField.FLOAT32
    return PointCloud2(
        header=at,
        height=1,
        width=len(points),
        fields=[
            PointField(name=name, offset=4 * k, datatype=kind, count=1)
            for k, name in enumerate(names)
        ],
        is_bigendian=sys.byteorder == 'big',
        point_step=4 * len(names),
        row_step=points.nbytes,
        data=array('B', points.tobytes()),
        is_dense=True,
    )


def field_message(surface: Surface, film_um: np.ndarray, at: Header) -> ThicknessField:
    """A field of the film (V,) in the order of the vertices."""
    thickness_um = array('f', film_um.astype(np.float32).tobytes())
    return ThicknessField(header=at, mesh_id=surface.mesh_id, thickness_um=thickness_um)


def large_publisher(
    node: Node, message: type, topic: str, profile: QoSProfile
) -> Callable[[int, Callable[[], Any]], None]:
    """Make what publishes large messages, only when a subscriber lacks the newest version.

    It is called again and again, with the version and what makes its message. The next message
    waits until all reliable subscribers have acknowledged the last one, so that a slow link gets
    fewer messages instead of a queue. It also waits as long as needed to keep the work within a
    fifth of a core.
    """
    # The event of the last subscriber that came or left.
    last: Any = SimpleNamespace(event=SimpleNamespace(current_count=0, total_count=0))
    # The last version sent, and the total number of subscribers by then.
    sent: tuple[int, int] | None = None
    sent_s = next_allowed_s = 0.0
    events = PublisherEventCallbacks(matched=partial(setattr, last, 'event'))
    publisher: Publisher = node.create_publisher(message, topic, profile, event_callbacks=events)

    def publish_if_wanted(version: int, make: Callable[[], Any]) -> None:
        nonlocal sent, sent_s, next_allowed_s
        # Not the publisher's own count, which grows before the event of a new subscriber.
        subscribers, began_s = last.event, time.monotonic()
        wanted = version, subscribers.total_count
        if not subscribers.current_count or wanted == sent or began_s < next_allowed_s:
            return
        acknowledged = publisher.wait_for_all_acked(Duration(nanoseconds=0))
        if not acknowledged and began_s < sent_s + ACKNOWLEDGE_TIMEOUT_S:
            return
        publisher.publish(make())
        sent, sent_s = wanted, time.monotonic()
        next_allowed_s = began_s + 5.0 * (sent_s - began_s)

    return publish_if_wanted


class FilmDisplay:
    """Publishes `thickness/...`: statistics, legend, and the large messages if subscribed to.

    `thickness/trust` is sent twice a second. Nodes that report the poses they have taken on
    `atomizer/progress`, as a recorder does, must not fall behind.
    """

    def __init__(self, node: PaintingNode) -> None:
        self._node = node
        # With several guns the film of each is published, too.
        names = node.gun_names if len(node.gun_names) > 1 else []
        self._share_topics = [gun_topic(name, 'thickness/field') for name in names]
        self._legend = node.create_publisher(MarkerArray, 'thickness/legend', topics.LATCHED)
        self._figures = node.create_publisher(ThicknessStats, 'thickness/stats', topics.LATCHED)
        self._large = {
            topic: large_publisher(node, message, topic, profile)
            for topic, message, profile in (
                ('thickness/mesh', Marker, topics.LATCHED),
                ('thickness/cloud', PointCloud2, topics.RESULTS),
                ('thickness/field', ThicknessField, topics.RESULTS),
                *((topic, ThicknessField, topics.RESULTS) for topic in self._share_topics),
            )
        }
        self._surface: Surface | None = None
        self._mesh: MeshMessage | None = None
        self._stats = ThicknessStats()
        self._counts: tuple | None = None
        # Counts the films shown, and changes of their colours.
        self._version = 0
        self._film_um = np.empty(0)
        self._scale = film_scale(self._film_um)
        self._legend_ends: tuple[float, float] | None = None
        # Of each gun and reporter: stamp of its newest pose, and when it said so.
        self._reports: dict[tuple[str, str], tuple[int, float]] = {}
        self._trust = node.create_publisher(DiagnosticStatus, topics.TRUST_TOPIC, topics.LATCHED)
        for source in node.inputs:
            topic = gun_topic(source.name, PROGRESS_TOPIC)
            take = partial(self._take_report, source.name)
            node.create_subscription(PoseProgress, topic, take, topics.PROGRESS)
        node.create_steady_timer(0.5, self._publish_trust)

    def _take_report(self, gun: str, report: PoseProgress) -> None:
        key = gun, report.reporter[:LONGEST_NAME]
        own = report.reporter == self._node.get_fully_qualified_name()
        if not own and (key in self._reports or len(self._reports) < MOST_NAMES):
            self._reports[key] = stamp_ns(report.header), time.monotonic()

    def _publish_trust(self) -> None:
        """Publish whether all that was sent is in the film, and why not."""
        node, doubts = self._node, []
        for source, film in zip(node.inputs, node.film.guns, strict=True):
            wrong = what_was_wrong(source, film) | {UNPAINTED: source.unpainted}
            found = [f'{n} {words}' for words, n in wrong.items() if n and words in DOUBTFUL]
            found += sprays_without_poses(source)
            topic = node.resolve_topic_name(gun_topic(source.name, PROGRESS_TOPIC))
            present = {node_name(info) for info in node.get_publishers_info_by_topic(topic)}
            for (gun, name), (newest_ns, heard_s) in tuple(self._reports.items()):
                behind_s = 1e-9 * (source.newest_ns - newest_ns)
                if gun == source.name and name not in present:  # it has ended
                    del self._reports[gun, name]
                elif gun == source.name and time.monotonic() - heard_s > 3.0:
                    found.append(f'{name} has stalled, or is inactive')
                elif gun == source.name and newest_ns and behind_s > 2.0:
                    found.append(f'{name} is {behind_s:.0f} s behind')
            doubts += [f'{source.name}: {doubt}' if source.name else doubt for doubt in found]
        doubts += filter(None, (node.side_problem, node.model_problem))
        self._trust.publish(
            DiagnosticStatus(
                level=WARN if doubts else OK, name=topics.TRUST_TOPIC,
                message='; '.join(doubts) or 'all that was sent is in the film',
                hardware_id=node.get_fully_qualified_name(),
            )
        )  # fmt: skip

    def show(self, film: CommonFilm, changed: bool, run: str) -> None:
        """Publish the film if it has changed, or to new subscribers."""
        if self._surface is not self._node.surface:  # another part, or the same turned
            self._surface, self._mesh, self._legend_ends = self._node.surface, None, None
        at = header(self._node.frame.frame_id, self._node.film.newest_ns or 0)
        if changed:
            self._update_stats(film, run, at)
        film_um, surface = self._film_um, self._node.surface
        make: dict[str, Callable[[], Any]] = {
            'thickness/mesh': lambda: self._mesh_message(at.frame_id),
            'thickness/cloud': lambda: cloud_message(surface, film_um, at),
            'thickness/field': lambda: field_message(surface, film_um, at),
        }
        for gun, topic in enumerate(self._share_topics):
            make[topic] = partial(lambda k: field_message(surface, film.shares_um[k], at), gun)
        for topic, message in make.items():
            self._large[topic](self._version, message)
        # The statistics are published when a count has changed, too.
        node, message = self._node, self._stats
        refused = sum(source.refused_frames.total() for source in node.inputs)
        counts = node.film.counts
        longest_s = max(source.steps.longest_ns for source in node.inputs) * 1e-9
        now = counts.received + refused, counts.rejected + refused, counts.gaps, longest_s
        if now != self._counts:
            self._counts = now
            message.poses_received, message.poses_rejected, message.pose_gaps = now[:3]
            message.longest_gap_s = longest_s
            self._figures.publish(message)

    def _update_stats(self, film: CommonFilm, run: str, at: Header) -> None:
        node, values = self._node, self._node.values
        self._version += 1
        self._film_um = film.film_um
        figures, laid_cm3, shares = film_figures(
            values, node.surface, film, self._film_um, node.zones
        )
        self._stats = ThicknessStats(
            header=at,
            run=run,
            atomizers=node.gun_names,
            atomizer_volume_cm3=laid_cm3,
            atomizer_share=shares,
            **{name: getattr(figures, name) for name in FIGURES},
        )
        node.shares = dict(zip(node.gun_names, shares, strict=True))
        self._counts = None
        self._scale = film_scale(self._film_um, values['color_min_um'], values['color_max_um'])
        ends = self._scale.low, self._scale.high
        if ends != self._legend_ends:
            self._legend_ends = ends
            self._legend.publish(legend(self._scale, node.surface, at.frame_id))

    def _mesh_message(self, frame_id: str) -> bytes:
        surface = self._node.surface
        if self._mesh is None:
            self._mesh = coloured_mesh(surface.vertices_m, surface.faces, frame_id, 'thickness')
        is_painted = self._film_um > self._node.values['painted_above_um']
        rows = self._scale.rows(self._film_um, is_painted)
        return self._mesh(self._node.film.newest_ns or 0, self._scale.palette, rows)


def legend(scale: ColourScale, surface: Surface, frame_id: str) -> MarkerArray:
    """A bar in the scale's colours with values [um] beside it, upright at the side of the part."""
    across = across_axis(surface.outward, surface.down)
    up = -downhill_axis(surface.outward, surface.down)
    heights, widths = surface.vertices_m @ up, surface.vertices_m @ across
    size = float(np.ptp(heights)) or float(np.ptp(widths))
    corner = (
        surface.vertices_m.mean(axis=0)
        + (widths.max() + 0.08 * size - widths.mean()) * across
        + (heights.min() - heights.mean()) * up
    )
    bar, steps = white_marker(Marker.TRIANGLE_LIST, 'legend', 0, frame_id), 64
    for step in range(steps):
        r, g, b, a = (scale.palette[step * TABLE // steps] / 255.0).tolist()
        for right, over in ((0, 0), (1, 0), (1, 1), (0, 0), (1, 1), (0, 1)):
            place = corner + 0.04 * size * right * across + size * (step + over) / steps * up
            x, y, z = place.tolist()
            bar.points.append(Point(x=x, y=y, z=z))
            bar.colors.append(ColorRGBA(r=r, g=g, b=b, a=a))
    markers = [bar]
    for number, share in enumerate(np.linspace(0.0, 1.0, 5), start=1):
        label = white_marker(Marker.TEXT_VIEW_FACING, 'legend', number, frame_id)
        label.text = f'{scale.low + (scale.high - scale.low) * share:g} µm'
        label.scale = Vector3(z=0.04 * size)
        x, y, z = (corner + share * size * up + 0.1 * size * across).tolist()
        label.pose.position = Point(x=x, y=y, z=z)
        markers.append(label)
    return MarkerArray(markers=markers)

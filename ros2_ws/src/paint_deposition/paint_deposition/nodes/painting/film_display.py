"""What the simulator publishes of its film."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from paint_msgs.msg import ThicknessField, ThicknessStats
from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from sensor_msgs.msg import PointCloud2
from visualization_msgs.msg import Marker, MarkerArray

from paint_deposition.film.colour_scales import film_scale
from paint_deposition.film.common_film import CommonFilm
from paint_deposition.nodes.painting.film_files import figures_of, laid_by
from paint_deposition.nodes.painting.film_messages import ShownFilm, stats_message
from paint_deposition.nodes.painting.legend import legend
from paint_deposition.nodes.painting.painting_node import PaintingNode
from paint_deposition.nodes.runtime import topics
from paint_deposition.nodes.runtime.topics import of_gun
from paint_deposition.part.surface import Surface

# Of one core that making and sending such a message may take.
SHARE = 0.2
# A listener that acknowledges nothing for so long does not hold up the others.
PATIENCE_S = 5.0
AT_ONCE = Duration(nanoseconds=0)


class LargeTopic:
    """Publishes when somebody listens who does not have the newest edition yet.

    The next message waits until all reliable subscribers have acknowledged the last one: a slow
    link gets fewer of them, never a queue. It also waits for as long as keeps the work within
    ``SHARE`` of a core.
    """

    def __init__(self, node: Node, message: type, topic: str, profile: QoSProfile) -> None:
        self._listeners = self._newcomers = 0
        self._publisher: Publisher = node.create_publisher(
            message, topic, profile,
            event_callbacks=PublisherEventCallbacks(matched=self._count_listeners),
        )  # fmt: skip
        self._edition: int | None = None
        self._greeted = 0
        self._sent_s = self._rested_s = 0.0

    def offer(self, edition: int, make: Callable[[], Any]) -> None:
        """Publish an edition, if it is wanted and the link is free; otherwise offer it again."""
        # Not the publisher's own count: it grows before the newcomer is counted.
        newcomers = self._newcomers
        known = edition == self._edition and newcomers == self._greeted
        if not self._listeners or known or not self._is_free():
            return
        began_s = time.monotonic()
        self._publisher.publish(make())
        self._sent_s = time.monotonic()
        self._rested_s = began_s + (self._sent_s - began_s) / SHARE
        self._edition, self._greeted = edition, newcomers

    def _count_listeners(self, event: Any) -> None:
        self._listeners = event.current_count
        self._newcomers += event.total_count_change

    def _is_free(self) -> bool:
        now_s = time.monotonic()
        if now_s < self._rested_s:
            return False
        return self._publisher.wait_for_all_acked(AT_ONCE) or now_s > self._sent_s + PATIENCE_S


class FilmDisplay:
    """Publishes `thickness/...`: statistics, legend, and the large messages to who listens.

    `shown_as` are the messages of the part.
    """

    def __init__(self, node: PaintingNode) -> None:
        self._node = node
        # Of several guns the film of each, too.
        names = node.gun_names if len(node.gun_names) > 1 else []
        self._share_topics = [of_gun(name, 'thickness/field') for name in names]
        self._legend = node.create_publisher(MarkerArray, 'thickness/legend', topics.LATCHED)
        self._figures = node.create_publisher(ThicknessStats, 'thickness/stats', topics.LATCHED)
        self._large = {
            topic: LargeTopic(node, message, topic, profile)
            for topic, message, profile in (
                ('thickness/mesh', Marker, topics.LATCHED),
                ('thickness/cloud', PointCloud2, topics.RESULTS),
                ('thickness/field', ThicknessField, topics.RESULTS),
                *((topic, ThicknessField, topics.RESULTS) for topic in self._share_topics),
            )
        }
        self._stats = ThicknessStats()
        # Counts what has been shown: another film, or the same in other colours.
        self._edition = 0
        self._film_um = np.empty(0)
        self._scale = film_scale(self._film_um)
        self._took_s = 0.0
        self.take(node.surface)

    def take(self, surface: Surface) -> None:
        """Show another part, or the same turned."""
        self.shown_as = ShownFilm(surface, self._node.frame.frame_id)
        self._counts: tuple | None = None
        self._legend_ends: tuple[float, float] | None = None

    def of(self, surface: Surface) -> ShownFilm:
        """The messages of the part as it is now, which the gun may have turned."""
        if self.shown_as.surface is not surface:
            self.take(surface)
        return self.shown_as

    def details(self) -> dict[str, object]:
        """What the diagnostics say of the film beside part and model."""
        parts = zip(self._stats.atomizers, self._stats.atomizer_share, strict=True)
        each = {f'share of {gun}': f'{share:.1%}' for gun, share in parts if gun}
        return {'last publication [ms]': f'{self._took_s * 1e3:.0f}', **each}

    def show(self, film: CommonFilm, changed: bool, run: str) -> None:
        """Publish the film if it has changed, or to those who do not have it yet."""
        began_s = time.monotonic()
        self.of(self._node.surface)
        if changed:
            self._sum_up(film, run)
        self._offer(film)
        if changed:
            self._took_s = time.monotonic() - began_s
        self._publish_stats()

    def _sum_up(self, film: CommonFilm, run: str) -> None:
        node, values = self._node, self._node.values
        self._edition += 1
        self._film_um = film_um = film.film_um
        figures = figures_of(values, node.surface, film_um, film.emitted_cm3)
        laid_cm3 = laid_by(node.gun_names, node.surface, film)
        stamp_ns = node.film.newest_ns or 0
        self._stats = stats_message(node.frame.frame_id, stamp_ns, figures, laid_cm3)
        self._stats.run = run
        self._counts = None
        scale = film_scale(film_um, values['color_min_um'], values['color_max_um'])
        self._scale = scale
        if (scale.low, scale.high) != self._legend_ends:
            self._legend_ends = scale.low, scale.high
            self._legend.publish(legend(scale, 'µm', node.surface, node.frame.frame_id))

    def _offer(self, film: CommonFilm) -> None:
        film_um, shown_as, scale = self._film_um, self.shown_as, self._scale
        values, stamp_ns = self._node.values, self._node.film.newest_ns or 0

        def mesh() -> bytes:
            rows = scale.rows(film_um, film_um > values['painted_above_um'])
            return shown_as.mesh.serialised(stamp_ns, scale.palette, rows)

        large: dict[str, Callable[[], Any]] = {
            'thickness/cloud': lambda: shown_as.cloud(stamp_ns, film_um),
            'thickness/field': lambda: shown_as.field(stamp_ns, film_um),
        } | {
            topic: lambda gun=gun: shown_as.field(stamp_ns, film.shares_um[gun])
            for gun, topic in enumerate(self._share_topics)
        }
        if values['publish_mesh']:
            large['thickness/mesh'] = mesh
        for topic, make in large.items():
            self._large[topic].offer(self._edition, make)

    def _publish_stats(self) -> None:
        """Publish the statistics if the film or a count has changed."""
        node, message = self._node, self._stats
        refused = sum(source.poses_refused for source in node.inputs)
        counts = node.film.counts
        longest_s = max(source.intervals.longest_ns for source in node.inputs) * 1e-9
        now = counts.received + refused, counts.rejected + refused, counts.gaps, longest_s
        if now == self._counts:
            return
        self._counts = now
        message.poses_received, message.poses_rejected, message.pose_gaps = now[:3]
        message.longest_gap_s = longest_s
        self._figures.publish(message)

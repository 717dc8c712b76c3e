"""What the simulator publishes of its film."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from paint_msgs.msg import ThicknessField, ThicknessStats
from rclpy.duration import Duration
from rclpy.qos import QoSProfile
from sensor_msgs.msg import PointCloud2
from visualization_msgs.msg import Marker, MarkerArray

from paint_deposition.film.colour_scales import film_scale
from paint_deposition.film.common_film import CommonFilm
from paint_deposition.nodes.painting.film_files import figures_of, laid_by
from paint_deposition.nodes.painting.film_messages import (
    FilmChanges,
    MeshTiles,
    ShownFilm,
    stats_message,
)
from paint_deposition.nodes.painting.legend import legend
from paint_deposition.nodes.painting.painting_node import PaintingNode
from paint_deposition.nodes.runtime import topics
from paint_deposition.nodes.runtime.topics import QosWatch, of_gun
from paint_deposition.part.surface import Surface

# Of one core that making and sending such a message may take.
SHARE = 0.2
# A listener that acknowledges nothing for so long does not hold up the others.
PATIENCE_S = 5.0
# What is sent in pieces is sent again so long after the last one, then after twice as long, ...
REPEAT_S = 1.0
AT_ONCE = Duration(nanoseconds=0)


class LargeTopic:
    """Publishes when somebody listens who does not have the newest edition yet.

    The next message waits until all reliable subscribers have acknowledged the last one: a slow
    link gets fewer of them, never a queue. It also waits for as long as keeps the work within
    ``SHARE`` of a core.

    A middleware acknowledges what it has received, before the listener takes it: the next
    message then takes its place in a full queue. Where each message shows all there is, the
    newest is enough. Where each shows a piece, all are sent again when the film rests, after
    pauses that double, so that a listener that lost some has them in the end.

    Args:
        watch: makes the publisher.
        message: its type.
        in_pieces: whether a message shows only a piece, or what changed.
    """

    def __init__(
        self,
        watch: QosWatch,
        message: type,
        topic: str,
        profile: QoSProfile,
        in_pieces: bool = False,
    ) -> None:
        self._watch = watch
        self._topic = topic
        self._publisher = watch.publisher(message, topic, profile)
        self.in_pieces = in_pieces
        self._edition: object = None
        self._complete = False
        self._greeted = 0
        self._pause_s = REPEAT_S
        self._sent_s = self._rested_s = 0.0

    def offer(self, edition: object, make: Callable[[bool], Any]) -> None:
        """Publish an edition, if it is wanted and the link is free; otherwise offer it again.

        Args:
            edition: what the message would show; equal where it would show the same.
            make: the message, None where there is nothing left to show; its argument says whether
                all is to be shown, to somebody who is new or once more.
        """
        # Not the publisher's own count: it grows before the newcomer is counted.
        if not self._watch.listeners[self._topic]:
            self._edition = None
            return
        newcomers = self._watch.newcomers[self._topic]
        known = edition == self._edition and self._complete
        rested = time.monotonic() - self._sent_s > self._pause_s
        repeat = known and self.in_pieces and rested
        whole = self._edition is None or newcomers > self._greeted or repeat
        if (known and not whole) or not self._is_free():
            return
        if repeat:
            self._pause_s *= 2.0
        elif edition != self._edition:
            self._pause_s = REPEAT_S
        began_s = time.monotonic()
        message = make(whole)
        if message is not None:
            self._publisher.publish(message)
            self._sent_s = time.monotonic()
            self._rested_s = began_s + (self._sent_s - began_s) / SHARE
        self._edition, self._greeted = edition, newcomers
        self._complete = message is None or not self.in_pieces

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
        self._legend = node.watch.publisher(MarkerArray, 'thickness/legend', topics.LATCHED)
        self._figures = node.watch.publisher(ThicknessStats, 'thickness/stats', topics.LATCHED)
        self._large = {
            topic: LargeTopic(node.watch, message, topic, profile, in_pieces)
            for topic, message, profile, in_pieces in (
                ('thickness/mesh', Marker, topics.LATCHED, False),
                ('thickness/cloud', PointCloud2, topics.RESULTS, False),
                ('thickness/changes', PointCloud2, topics.RESULTS, True),
                ('thickness/field', ThicknessField, topics.RESULTS, False),
                *((topic, ThicknessField, topics.RESULTS, False) for topic in self._share_topics),
            )
        }
        self._stats = ThicknessStats()
        # Counts what has been shown: another film, or the same in other colours.
        self._edition = 0
        self._film_um = np.empty(0)
        self._scale = film_scale(self._film_um)
        self._took_s = 0.0
        self.take(ShownFilm(node.surface, node.frame.frame_id))

    def take(self, shown_as: ShownFilm, clear: bool = False) -> None:
        """Show another part, or the same turned; `clear` removes the markers of the one before."""
        self.shown_as = shown_as
        self._mesh = MeshTiles(shown_as, clear)
        self._changes = FilmChanges(shown_as)
        self._large['thickness/mesh'].in_pieces = shown_as.tiles > 1 or clear
        self._counts: tuple | None = None
        self._legend_ends: tuple[float, float] | None = None

    def of(self, surface: Surface) -> ShownFilm:
        """The messages of the part as it is now, which the gun may have turned."""
        if self.shown_as.surface is not surface:
            self.take(ShownFilm(surface, self._node.frame.frame_id))
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
        self._offer(film, at_rest=not changed)
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

    def _offer(self, film: CommonFilm, at_rest: bool) -> None:
        film_um, shown_as, scale = self._film_um, self.shown_as, self._scale
        values, stamp_ns = self._node.values, self._node.film.newest_ns or 0

        def mesh(whole: bool) -> bytes | None:
            rows = scale.rows(film_um, film_um > values['painted_above_um'])
            return self._mesh.message(self._edition, stamp_ns, scale.palette, rows, whole)

        def changes(whole: bool) -> PointCloud2 | None:
            return self._changes.message(stamp_ns, film_um, whole, exact=at_rest)

        if values['publish_mesh']:
            self._large['thickness/mesh'].offer(self._edition, mesh)
        self._large['thickness/changes'].offer((self._edition, at_rest), changes)
        whole_films = {
            'thickness/cloud': lambda _: shown_as.cloud(stamp_ns, film_um),
            'thickness/field': lambda _: shown_as.field(stamp_ns, film_um),
        } | {
            topic: lambda _, gun=gun: shown_as.field(stamp_ns, film.shares_um[gun])
            for gun, topic in enumerate(self._share_topics)
        }
        for topic, make in whole_films.items():
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

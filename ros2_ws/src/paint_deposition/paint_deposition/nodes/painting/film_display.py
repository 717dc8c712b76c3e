"""What the simulator publishes of its film."""

from __future__ import annotations

import time
from functools import partial

import numpy as np
from paint_msgs.msg import ThicknessField, ThicknessStats
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
from paint_deposition.nodes.painting.large_topic import LargeTopic
from paint_deposition.nodes.painting.legend import legend
from paint_deposition.nodes.painting.painting_node import PaintingNode
from paint_deposition.nodes.runtime import topics
from paint_deposition.nodes.runtime.topics import of_gun
from paint_deposition.part.surface import Surface


class FilmDisplay:
    """Publishes `thickness/...`: statistics, legend, and the large messages to who listens.

    Args:
        node: paints the film.

    Attributes:
        shown_as: the part's messages.
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
        """Publish the film if it has changed, or to those who do not have it yet.

        Args:
            film: up to date. changed: since it was last shown.
            run: of the part.
        """
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

        def cloud(_: bool) -> PointCloud2:
            return shown_as.cloud.message(stamp_ns, film_um)

        def changes(whole: bool) -> PointCloud2 | None:
            return self._changes.message(stamp_ns, film_um, whole, exact=at_rest)

        def field(_: bool) -> ThicknessField:
            return shown_as.field.message(stamp_ns, film_um)

        def share(_: bool, gun: int) -> ThicknessField:
            return shown_as.field.message(stamp_ns, film.shares_um[gun])

        if values['publish_mesh']:
            self._large['thickness/mesh'].offer(self._edition, mesh)
        self._large['thickness/cloud'].offer(self._edition, cloud)
        self._large['thickness/changes'].offer((self._edition, at_rest), changes)
        self._large['thickness/field'].offer(self._edition, field)
        for gun, topic in enumerate(self._share_topics):
            self._large[topic].offer(self._edition, partial(share, gun=gun))

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

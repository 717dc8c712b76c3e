"""The coloured mesh of a part: one marker, or several of a large part, each sent as it changes."""

from __future__ import annotations

import numpy as np
from rclpy.serialization import serialize_message
from visualization_msgs.msg import Marker

from paint_deposition.nodes.painting.film_messages import ShownFilm
from paint_deposition.nodes.runtime.messages import white_marker


class MeshTiles:
    """Which markers of a part have been sent, and with which colours.

    To make and send a marker of a million triangles takes half a second, during which poses and
    statistics wait. A large part is therefore told in turns.

    Args:
        shown_as: the part, which has the markers.
        clear: whether markers of another part are to be removed first.

    Attributes:
        sent: messages so far.
    """

    def __init__(self, shown_as: ShownFilm, clear: bool = False) -> None:
        self._shown_as = shown_as
        self._clear = clear
        self._told: list[tuple[object, np.ndarray] | None] = [None] * shown_as.tiles
        self.sent = 0

    def message(
        self, edition: object, stamp_ns: int, palette: np.ndarray, rows: np.ndarray, whole: bool
    ) -> bytes | None:
        """The next marker, None if there is nothing to tell.

        A part of one marker is told in every edition; of several, those whose colours changed.

        Args:
            edition: of the film. palette, rows: as for ``ColouredMesh.serialised``.
            whole: tell all of them, as to somebody who is new.
        """
        if whole:
            self._told = [None] * len(self._told)
        if self._clear:
            self._clear = False
            self.sent += 1
            return serialize_message(
                white_marker(Marker.TRIANGLE_LIST, '', 0, '', action=Marker.DELETEALL)
            )
        count = len(self._told)
        for tile in ((self.sent + k) % count for k in range(count)):
            told = self._told[tile]
            if told is not None and told[0] == edition:
                continue
            now = rows[self._shown_as.corners(tile)]
            if told is not None and count > 1 and np.array_equal(told[1], now):
                continue
            self._told[tile] = edition, now
            self.sent += 1
            return self._shown_as.tile(tile).serialised(stamp_ns, palette, rows)
        return None

"""Which side of a part is outward, as the guns show it."""

from __future__ import annotations

from paint_deposition.film.common_film import LiveFilms
from paint_deposition.part.facing import facing, toward_the_gun
from paint_deposition.part.surface import Surface

# So many poses that look at the part settle it; after so many poses in all it stays as it is.
POSES_FACING = 50
POSES_CONSIDERED = 2000


class OutwardSide:
    """Turns a part as the first gun wants it whose poses look at it.

    As long as an earlier gun has not settled it, it may still decide otherwise: which side is
    outward does not depend on whose poses came first.

    Args:
        guns: how many there are.
    """

    def __init__(self, guns: int) -> None:
        self._may_say = list(range(guns))

    @property
    def settled(self) -> bool:
        """Whether no gun can say anything more."""
        return not self._may_say

    def turned(self, surface: Surface, film: LiveFilms) -> Surface:
        """The part as it is to be, which may be the same, by the poses of the guns so far."""
        for gun in tuple(self._may_say):
            poses = film.guns[gun].log.first_poses(POSES_CONSIDERED)
            if poses is None:
                continue
            positions, axes = poses.finite_axes()
            seen = facing(surface, positions, axes)
            looking = seen.front + seen.back
            settled = looking >= POSES_FACING or len(poses) >= POSES_CONSIDERED
            if settled:
                self._may_say.remove(gun)
            if looking:
                if settled:
                    self._may_say = [earlier for earlier in self._may_say if earlier < gun]
                return toward_the_gun(surface, positions, axes)
        return surface

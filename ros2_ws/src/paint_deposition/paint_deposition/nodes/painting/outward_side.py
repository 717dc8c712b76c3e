"""Which side of the part is outward: the side that the guns point at."""

from collections.abc import Sequence

from paint_deposition.film.live_film import LiveFilm
from paint_deposition.part.facing import facing, toward_the_gun
from paint_deposition.part.surface import Surface

# After so many poses that point at the part, or so many in all, a gun's poses have decided.
POSES_FACING = 50
POSES_CONSIDERED = 2000


class OutwardSide:
    """Decides the outward side by the poses of the first gun that points at the part.

    An earlier gun may still overrule a later one, as long as its own poses have not decided: the
    side does not depend on whose poses arrive first.
    """

    def __init__(self, gun_count: int) -> None:
        self._undecided = list(range(gun_count))

    def orient(self, surface: Surface, guns: Sequence[LiveFilm]) -> Surface:
        """The surface with its outward side toward the guns, by their poses so far."""
        for number in tuple(self._undecided):
            poses = guns[number].log.first_poses(POSES_CONSIDERED)
            if poses is None:
                continue
            positions, axes = poses.finite_axes()
            seen = facing(surface, positions, axes)
            pointing = seen.front + seen.back
            decided = pointing >= POSES_FACING or len(poses) >= POSES_CONSIDERED
            if decided:
                self._undecided.remove(number)
            if pointing:
                if decided:
                    self._undecided = [gun for gun in self._undecided if gun < number]
                return toward_the_gun(surface, positions, axes)
        return surface

"""What a recommendation of an index is asked for."""

import math
from dataclasses import dataclass

from paint_deposition.errors import PlanError

USUAL_RANGE_M = (0.2, 0.8)
# A pattern whose SB50 lies here is searched over the usual range, another one over its own scale.
USUAL_HALF_WIDTHS_M = (0.25, 0.75)
RANGE_IN_HALF_WIDTHS = (0.35, 1.4)
FASTEST_M_PER_S = 3.0
# Beyond, a length is in other units; the search would be too coarse or the passes too many.
INDEX_LIMITS_M = (0.001, 10.0)
LIMITS_M = {
    'index_min_m': INDEX_LIMITS_M,
    'index_max_m': INDEX_LIMITS_M,
    'width_m': (0.0, 100.0),
    'length_m': (0.0, 100.0),
}


@dataclass(frozen=True)
class Request:
    """What is asked for; None is not given.

    Attributes:
        speed_m_per_s: of the passes. target_um: mean film that the speed is chosen for if it is
            not given.
        index_min_m, index_max_m: range to search.
        tolerance: largest sigma_n accepted.
        width_m: to paint across the passes. length_m: along them; as wide as long if not given.
        one_way, gun_turns, standoff_m, travel_rad: see ``PassSetup``; the standoff is the one at
            which the part lies on the model plane if not given.
    """

    speed_m_per_s: float | None = None
    target_um: float | None = None
    index_min_m: float | None = None
    index_max_m: float | None = None
    tolerance: float | None = None
    width_m: float | None = None
    length_m: float | None = None
    one_way: bool = False
    gun_turns: bool = False
    standoff_m: float | None = None
    travel_rad: float = 0.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if name == 'travel_rad' or value is None or isinstance(value, bool):
                continue
            if not (math.isfinite(value) and value > 0.0):
                raise PlanError(f'{name} is {value:g}; give a number above 0, or leave it out')
        for name, (low, high) in LIMITS_M.items():
            value = getattr(self, name)
            if value is not None and not low <= value <= high:
                raise PlanError(f'{name} is {value:g}; give metres, {low:g} to {high:g}')
        if not math.isfinite(self.travel_rad):
            raise PlanError(f'travel_rad is {self.travel_rad}; give an angle')
        if self.tolerance is not None and self.tolerance >= 1.0:
            raise PlanError(
                f'tolerance is {self.tolerance:g}, which is {100 * self.tolerance:g} % of the '
                'mean film; give a share below 1, 0.05 for 5 %'
            )
        if self.speed_m_per_s is None and self.target_um is None:
            raise PlanError('neither speed_m_per_s nor target_um is given; give one of them')
        if self.speed_m_per_s is not None and self.speed_m_per_s > FASTEST_M_PER_S:
            raise PlanError(
                f'speed_m_per_s is {self.speed_m_per_s:g}; a painting robot moves at up to '
                f'{FASTEST_M_PER_S:g} m/s, give metres per second'
            )

    def index_range_m(self, half_width_m: float) -> tuple[float, float]:
        """Range to search for a pass of this SB50 [m].

        Raises:
            PlanError: it is empty.
        """
        least, greatest = USUAL_HALF_WIDTHS_M
        usual = USUAL_RANGE_M
        if not least <= half_width_m <= greatest:
            least, greatest = RANGE_IN_HALF_WIDTHS
            usual = round(least * half_width_m, 3), round(greatest * half_width_m, 3)
        low = usual[0] if self.index_min_m is None else self.index_min_m
        high = usual[1] if self.index_max_m is None else self.index_max_m
        if not low < high:
            raise PlanError(
                f'the index range {low:g} to {high:g} m is empty; give index_min_m < index_max_m'
            )
        return low, high

"""What passes on a part are asked for."""

from dataclasses import dataclass, fields

from paint_deposition.planning.improvement.limits import Limits
from paint_deposition.planning.index_request import Request

DEFAULT_SMOOTHING_RADIUS_M = 0.1


@dataclass(frozen=True)
class PlanRequest:
    """What passes are asked for; None is not given.

    Attributes:
        direction: 'horizontal' or 'vertical'.
        speed_m_per_s: of the passes. target_um: mean film on the painted side that the speed is
            chosen for if it is not given.
        index_m: fixes the index; or else index_min_m and index_max_m bound it.
        tolerance: largest sigma_n on the part accepted.
        standoff_m: TCP to smoothed surface; default: the surface lies on the model plane.
        smoothing_radius_m: what is finer on the part is not followed.
        overspray_m: the gun opens this far before the part; default: where 90 % of the
            pattern's volume reach it.
        acceleration_m_per_s2: of the robot.
        one_way: every pass in the direction of the first; else they alternate. The gun keeps its
            orientation either way.
        travel_rad: direction of the first pass in the tool's x-y frame.
        outward: (3,) from the part to the gun; default: the mean normal.
        paint_weight, time_weight: what an optimised plan gives, in units of sigma_n squared, for
            the paint sprayed over that wanted on the part, and for the cycle time over that of the
            plain plan.
        speed_min_m_per_s, speed_max_m_per_s: of an optimised plan while spraying.
        standoff_min_m, standoff_max_m: an optimised plan chooses the standoff of each pass within
            them; default: all have the same.
        lean_max_rad: an optimised plan may turn the gun so far about the line of a pass.
    """

    direction: str = 'horizontal'
    speed_m_per_s: float | None = None
    target_um: float | None = None
    index_m: float | None = None
    index_min_m: float | None = None
    index_max_m: float | None = None
    tolerance: float | None = None
    standoff_m: float | None = None
    smoothing_radius_m: float = DEFAULT_SMOOTHING_RADIUS_M
    overspray_m: float | None = None
    acceleration_m_per_s2: float = 2.0
    one_way: bool = False
    travel_rad: float = 0.0
    outward: tuple[float, float, float] | None = None
    paint_weight: float = 5e-3
    time_weight: float = 5e-3
    speed_min_m_per_s: float = 0.1
    speed_max_m_per_s: float = 1.0
    standoff_min_m: float | None = None
    standoff_max_m: float | None = None
    lean_max_rad: float = 0.0

    def limits(self, overspray_m: float) -> Limits:
        """Of speeds to be chosen; the gun may be closed up to the edge of the part."""
        return Limits(
            speed_min_m_per_s=self.speed_min_m_per_s,
            speed_max_m_per_s=self.speed_max_m_per_s,
            acceleration_m_per_s2=self.acceleration_m_per_s2,
            trigger_cut_m=overspray_m,
        )

    def for_plane(self, width_m: float, length_m: float) -> Request:
        """The same for a plane of the part's size.

        Raises:
            PlanError: a value is impossible.
        """
        shared = {item.name for item in fields(Request)} & vars(self).keys()
        asked = {name: getattr(self, name) for name in shared}
        return Request(**asked, width_m=width_m, length_m=length_m)

"""What robot, gun and shop allow, and what a better film is worth."""

import math
from dataclasses import dataclass, fields
from typing import Any

from paint_deposition.errors import PlanError, require_above_zero


@dataclass(frozen=True)
class Limits:
    """Bounds that the improved motion keeps.

    Attributes:
        speed_min_m_per_s, speed_max_m_per_s: of the TCP while it sprays.
        acceleration_m_per_s2: along the path; also across it, where a bend lets the gun go faster
            than it was programmed.
        jerk_m_per_s3: change of the acceleration from one stretch of the path to the next.
        move_min_m: shortest move of the robot program while it sprays.
        settings_per_s: so many moves with a speed of their own the controller follows.
        flow_min, flow_max: flow of a pass relative to the programmed one; both 1 keep it.
        trigger_shift_m: the gun opens and closes at most this far outside where it did.
        trigger_cut_m: and at most this far inside.
        film_min_um, film_max_um: of the film on the judged part; None is no bound.

    Raises:
        PlanError: a value is impossible.
    """

    speed_min_m_per_s: float = 0.1
    speed_max_m_per_s: float = 1.0
    acceleration_m_per_s2: float = 2.0
    jerk_m_per_s3: float = 50.0
    move_min_m: float = 0.02
    settings_per_s: float = 20.0
    flow_min: float = 1.0
    flow_max: float = 1.0
    trigger_shift_m: float = 0.1
    trigger_cut_m: float = 0.3
    film_min_um: float | None = None
    film_max_um: float | None = None

    def __post_init__(self) -> None:
        may_be_zero = ('trigger_shift_m', 'trigger_cut_m')
        given = {
            item.name: getattr(self, item.name)
            for item in fields(self)
            if getattr(self, item.name) is not None
        }
        require_above_zero(**{k: v for k, v in given.items() if k not in may_be_zero})
        for name in may_be_zero:
            if not (math.isfinite(given[name]) and given[name] >= 0.0):
                raise PlanError(f'{name} is {given[name]:g}; give 0 or more')
        for low, high in (
            ('speed_min_m_per_s', 'speed_max_m_per_s'),
            ('flow_min', 'flow_max'),
            ('film_min_um', 'film_max_um'),
        ):
            if low in given and high in given and given[low] > given[high]:
                raise PlanError(
                    f'{low} is {given[low]:g}, above {high}, {given[high]:g}; swap them'
                )

    @property
    def flow_is_free(self) -> bool:
        """Whether passes may have flows of their own."""
        return self.flow_min < self.flow_max


@dataclass(frozen=True)
class Wish:
    """What film is wanted, and what else counts.

    The optimiser minimises the variance of film / target on the judged part, which is sigma_n
    squared where the mean is on target, and it is held there; plus these weights times what they
    weigh.

    Attributes:
        target_um: mean film; None keeps the one that the programme lays.
        tolerance: film within so much of the target is as good as any, 0.1 for 10 %; film outside
            counts ``beyond_tolerance`` more. None is none.
        paint_weight: of the paint sprayed, as a share of the programme's at the wanted mean film.
        time_weight: of the time sprayed, as a share of the same.
        smoothness: of the mean square change of slowness over 0.1 m, relative to its mean.
    """

    target_um: float | None = None
    tolerance: float | None = None
    paint_weight: float = 3e-3
    time_weight: float = 0.0
    smoothness: float = 1e-2
    beyond_tolerance: float = 3.0

    def __post_init__(self) -> None:
        given = {'target_um': self.target_um, 'tolerance': self.tolerance}
        require_above_zero(**{k: v for k, v in given.items() if v is not None})
        for name in ('paint_weight', 'time_weight', 'smoothness', 'beyond_tolerance'):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise PlanError(f'{name} is {value:g}; give 0 or more')


def split_options(wanted: dict[str, Any]) -> tuple[Limits, Wish]:
    """Limits and wish from keywords; the names of both differ.

    Raises:
        PlanError: a name is none of them, or a value is impossible.
    """
    names = {kind: {item.name for item in fields(kind)} for kind in (Limits, Wish)}
    strangers = wanted.keys() - names[Limits] - names[Wish]
    if strangers:
        known = ', '.join(sorted(names[Limits] | names[Wish]))
        raise PlanError(f'{sorted(strangers)[0]} is no option of improve; there are: {known}')
    limits = Limits(**{k: v for k, v in wanted.items() if k in names[Limits]})
    return limits, Wish(**{k: v for k, v in wanted.items() if k in names[Wish]})

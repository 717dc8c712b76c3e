"""Requests to planning: an index, passes on a part, a better programme, points to measure.

Options of the command line and keywords of Python are these fields; None is not given.
"""

from typing import Annotated, Literal

from pydantic import BeforeValidator, Field, model_validator

from paint_deposition.errors import PaintError, ReadingsError
from paint_deposition.request import Request, given

SLOWEST_M_PER_S, FASTEST_M_PER_S = 0.005, 3.0

Positive = Annotated[float, Field(gt=0.0)]
Vector = Annotated[tuple[float, float, float], BeforeValidator(tuple)]


class PassRequest(Request):
    """How passes run and what they lay."""

    speed_m_per_s: float | None = given(
        None, 'Speed of the passes [m/s].', '--speed',
        least=SLOWEST_M_PER_S, most=FASTEST_M_PER_S,
    )  # fmt: skip
    target_um: float | None = given(
        None, 'Mean film wanted; without --speed the speed is chosen for it [µm].', above=0.0
    )
    index_min_m: float | None = given(
        None,
        'Least index [m]; default: 0.2; where SB50 is outside 0.25 to 0.75 m, 0.35 of it.',
        '--index-min',
        least=0.001,
        most=10.0,
    )
    index_max_m: float | None = given(
        None,
        'Greatest index [m]; default: 0.8; where SB50 is outside 0.25 to 0.75 m, 1.4 of it.',
        '--index-max',
        least=0.001,
        most=10.0,
    )
    tolerance: float | None = given(
        None,
        'Largest sigma_n accepted, 0.05 for 5 %; no tolerance of the film.',
        above=0.0,
        below=1.0,
    )
    one_way: bool = given(False, 'Every pass in one direction; default: they alternate.')
    standoff_m: float | None = given(
        None, 'Distance of the TCP from the part [m]; default: the part lies on the model plane.',
        '--standoff', above=0.0, most=10.0,
    )  # fmt: skip
    travel_rad: float = given(
        0.0, "Direction of the first pass in the tool's x-y frame, from x to y."
    )


# What the robot allows while the speeds along a path are chosen.
ACCELERATION = given(
    2.0, 'Acceleration of the robot along its path, and across it in bends [m/s2].',
    '--acceleration', above=0.0,
)  # fmt: skip


class SpeedLimits(Request):
    """How fast and how slow the gun may go."""

    speed_min_m_per_s: float = given(
        0.1, 'Least speed while spraying [m/s].', '--speed-min', above=0.0
    )
    speed_max_m_per_s: float = given(
        1.0, 'Greatest speed while spraying [m/s].', '--speed-max', above=0.0
    )

    @model_validator(mode='after')
    def _speeds_in_order(self) -> 'SpeedLimits':
        self._require_order('speed_min_m_per_s', 'speed_max_m_per_s')
        return self

    def _require_order(self, low: str, high: str) -> None:
        least, most = getattr(self, low), getattr(self, high)
        if least is not None and most is not None and least > most:
            raise PaintError(f'{low} is {least:g}, above {high}, {most:g}; swap them')


class IndexRequest(SpeedLimits, PassRequest):
    """An index between parallel passes on a plane, at a speed or at one chosen for a target."""

    width_m: float | None = given(
        None, 'Width to paint across the passes [m].', '--width', above=0.0, most=100.0
    )
    length_m: float | None = given(
        None, 'Length of a pass [m]; default: the width.', '--length', above=0.0, most=100.0
    )
    gun_turns: bool = given(
        False,
        'The gun is turned by 180 deg for every way back; default: it keeps its orientation.',
    )

    @model_validator(mode='after')
    def _has_speed_or_target(self) -> 'IndexRequest':
        if self.speed_m_per_s is None and self.target_um is None:
            raise PaintError('neither speed_m_per_s nor target_um is given; give one of them')
        return self

    @property
    def assumption(self) -> str:
        """What is assumed about the gun, in words."""
        if self.one_way:
            return 'all passes run the same way with the gun held alike'
        if self.gun_turns:
            return 'passes alternate and the gun turns by 180 deg with them: every other mirrored'
        return 'passes alternate and the gun keeps its orientation: all lay the same profile'

    def index_range_m(self, half_width_m: float) -> tuple[float, float]:
        """Range to search for a pass of this SB50 [m]. Raises PaintError: it is empty."""
        # A pattern of a usual SB50 is searched over the usual range, another over its own scale.
        usual = 0.2, 0.8
        if not 0.25 <= half_width_m <= 0.75:
            usual = round(0.35 * half_width_m, 3), round(1.4 * half_width_m, 3)
        low = usual[0] if self.index_min_m is None else self.index_min_m
        high = usual[1] if self.index_max_m is None else self.index_max_m
        if not low < high:
            raise PaintError(
                f'the index range {low:g} to {high:g} m is empty; give index_min_m < index_max_m'
            )
        return low, high


class PlanRequest(SpeedLimits, PassRequest):
    """Passes on a part; the speeds along them are chosen for ``optimise`` only, and for zones."""

    acceleration_m_per_s2: float = ACCELERATION
    direction: Literal['horizontal', 'vertical'] = given('horizontal', 'How the passes run.')
    index_m: float | None = given(
        None, 'Index between passes [m]; default: the most even one.', '--index',
        least=0.001, most=10.0,
    )  # fmt: skip
    smoothing_radius_m: float = given(
        0.1, 'Features of the part smaller than this are not followed.', above=0.0
    )
    overspray_m: float | None = given(
        None,
        'The gun opens this far before the part; default: where 90 % of the pattern reach.',
        least=0.0,
    )
    outward: Vector | None = given(
        None,
        'Direction from the part to the gun; default: the mean normal of the mesh.',
        metavar='X Y Z',
    )
    optimise: bool = given(
        False,
        'Choose number and place of the passes and the speeds along them for an even film and '
        'little paint; default: even passes at one speed. Zones imply it.',
    )
    paint_weight: float = given(
        5e-3,
        'With --optimise: cost, in units of sigma_n squared, of as much paint as the '
        'film on the part holds.', least=0.0,
    )  # fmt: skip
    time_weight: float = given(
        5e-3, 'With --optimise: the same for the time of the plan without it.', least=0.0
    )

    @model_validator(mode='after')
    def _side_and_index(self) -> 'PlanRequest':
        if self.outward is not None and not any(self.outward):
            raise PaintError('outward is 0 0 0; give a direction, 0 -1 0 say')
        for end, side in ((self.index_min_m, 1.0), (self.index_max_m, -1.0)):
            if self.index_m is not None and end is not None and side * (end - self.index_m) > 0.0:
                name = 'index_min_m' if side > 0.0 else 'index_max_m'
                raise PaintError(
                    f'index_m is {self.index_m:g}, beyond {name}, {end:g}; leave out one of them'
                )
        return self

    def index_range_m(self, best_m: float) -> tuple[float, float]:
        """Where the index is looked for; without a range about the one that is best on a plane."""
        if self.index_m is not None:
            return self.index_m, self.index_m
        return self.index_min_m or 0.75 * best_m, self.index_max_m or 1.25 * best_m


class ImproveRequest(SpeedLimits):
    """A more even film along the path of a programme: what is wanted, and what is allowed.

    The variance of film / target on the part is minimised, which is sigma_n squared where the
    mean is on target, and these weights times what they weigh.
    """

    acceleration_m_per_s2: float = ACCELERATION
    target_um: float | None = given(
        None, 'Mean film wanted [µm]; default: that of the programme.', above=0.0
    )
    tolerance: float | None = given(
        None, 'Accepted difference of the film from its target, 0.1 for 10 %, which is no '
        'sigma_n; film outside counts more.',
        above=0.0, below=1.0,
    )  # fmt: skip
    paint_weight: float = given(
        3e-3, 'Cost of all the paint of the programme, in units of sigma_n squared.',
        least=0.0,
    )  # fmt: skip
    time_weight: float = given(0.0, 'The same for the time sprayed.', least=0.0)
    smoothness: float = given(
        1e-2, 'Weight of changes of speed; a greater weight gives steadier speeds.', least=0.0
    )
    jerk_m_per_s3: float = given(
        50.0, 'Jerk of the robot along its path [m/s3].', '--jerk', above=0.0
    )
    move_min_m: float = given(
        0.02, 'Shortest move of the robot program while spraying [m].', '--move-min', above=0.0
    )
    settings_per_s: float = given(
        20.0, 'Moves with a speed of their own that the controller can follow per second.',
        above=0.0,
    )  # fmt: skip
    flow: tuple[Positive, Positive] = given(
        (1.0, 1.0), 'Range of the flow of a pass, relative to the programmed one.',
        metavar='MIN MAX',
    )  # fmt: skip
    trigger_shift_m: float = given(
        0.1, 'The gun opens earlier and closes later by this much at most [m].',
        '--trigger-shift', least=0.0,
    )  # fmt: skip
    trigger_cut_m: float = given(
        0.3, 'The gun opens later and closes earlier by this much at most [m].',
        '--trigger-cut', least=0.0,
    )  # fmt: skip
    spray_turns: bool = given(
        False,
        'Keep spraying in turns beside the part where the programme does; default: the gun is '
        'closed there.',
    )
    film_min_um: float | None = given(None, 'Least film accepted anywhere [µm].', above=0.0)
    film_max_um: float | None = given(None, 'Greatest film accepted anywhere [µm].', above=0.0)

    @model_validator(mode='after')
    def _bounds_in_order(self) -> 'ImproveRequest':
        self._require_order('film_min_um', 'film_max_um')
        if self.flow[0] > self.flow[1]:
            raise PaintError(f'flow is {self.flow[0]:g} to {self.flow[1]:g}; swap the two')
        return self


class MeasureRequest(Request):
    """Where to put the gauge on a part."""

    error_class = ReadingsError
    points: int = given(60, 'Number of points.', least=1)
    repeats: int = given(
        8, 'Points to be read twice, which show the noise of the gauge; 0 if you know it.',
        least=0,
    )  # fmt: skip
    foot_m: float = given(
        0.015, "Radius of the gauge's foot: points keep this far off edges and bends.", above=0.0
    )
    seed: int = given(0, 'Random seed of the places tried and the noise simulated.')


class GunEnvelope(Request):
    """What must stay clear of the part, on the tool's axis."""

    radius_m: float = given(
        0.08, 'Radius of the gun, and of the cylinder before it that must stay clear.',
        '--gun-radius-m', above=0.0,
    )  # fmt: skip
    length_m: float = given(0.4, 'Length of the gun behind its TCP.', '--gun-length-m', above=0.0)
    before_m: float = given(
        0.1,
        'Length of the cylinder before the TCP that must stay clear.',
        '--keep-off-m',
        least=0.0,
    )

"""The result of `improve`: a programme with other speeds, and its film before and after."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.motion.programmed import Move
from paint_deposition.motion.trajectory import Trajectory
from paint_deposition.part.surface import Surface
from paint_deposition.planning.driving import Drive
from paint_deposition.planning.nodes import BEND, FASTEST, JOINT, LEAD
from paint_deposition.planning.planned_film import Contact, LaidFilm, WantedFilm
from paint_deposition.planning.programme import STANDING_M, Programme, strokes_of
from paint_deposition.planning.quadratic_program import SLOWEST
from paint_deposition.planning.requests import ImproveRequest


@dataclass(frozen=True)
class PassChange:
    """What changes in a pass, in the robot's terms."""

    number: int  # of the pass, from 1, as a simulation counts
    place_m: tuple[float, float]  # travel of the TCP at its begin and at its end
    speed_m_per_s: tuple[float, float]  # mean speeds before and after
    # After.
    slowest_m_per_s: float
    fastest_m_per_s: float
    # Along the path; negative is the other way; 0 where the pass does not begin or end with the
    # gun.
    opens_earlier_m: float
    closes_later_m: float
    # The same at the speed of the new programme.
    opens_earlier_s: float
    closes_later_s: float
    flow: tuple[float, float]  # relative to the calibrated one, before and after

    @property
    def sentence(self) -> str:
        """The change in a line."""
        before, after = self.speed_m_per_s
        parts = [
            f'{before:.3f} → {after:.3f} m/s on average, now {self.slowest_m_per_s:.3f} to '
            f'{self.fastest_m_per_s:.3f} m/s'
        ]
        for verb, metres, seconds, sides in (
            ('opens', self.opens_earlier_m, self.opens_earlier_s, ('earlier', 'later')),
            ('closes', self.closes_later_m, self.closes_later_s, ('later', 'earlier')),
        ):
            # Smaller shifts of a trigger are left out of the sentence [m].
            if abs(metres) >= 0.002:
                side = sides[metres < 0.0]
                parts.append(
                    f'{verb} {1e3 * abs(seconds):.0f} ms {side} ({1e3 * abs(metres):.0f} mm)'
                )
        if abs(self.flow[1] - self.flow[0]) > 5e-4:
            parts.append(f'flow {self.flow[0]:.3f} → {self.flow[1]:.3f}')
        return f'pass {self.number}: ' + '; '.join(parts)


@dataclass(frozen=True)
class Improvement:
    """A programme with other speeds, flows and triggers for a more even film.

    Attributes:
        surface: the part. wanted: the film on the side where it counts.
        model: what the gun sprays. request: objective and limits.
        trajectory: the improved motion.
        moves: the improved one as moves of a robot program.
        original, programme: the motion as it was, its gun closed in turns, and the improved one.
        target_um: mean film aimed at [um].
        binding: names of all limits that bind; binding_limits: those of them that cost evenness,
            the strongest first, with sigma_n without each alone.
        sigma_n_of_path: of the most even film of any speeds along this path.
        before, after: films of the motion as it was and of the improved one.
        program_difference: largest difference between the films of the robot program and of the
            bag, as a share of the greatest film.
        geometry_warnings: oddities of the motion over the part, each with its likely cause.
        drive: of the robot that it was made for.
    """

    surface: Surface
    wanted: WantedFilm
    model: DepositionModel
    request: ImproveRequest
    trajectory: Trajectory
    moves: Sequence[Move]
    original: Programme
    programme: Programme
    target_um: float
    binding: tuple[str, ...]
    binding_limits: dict[str, float]
    sigma_n_of_path: float
    before: LaidFilm
    after: LaidFilm
    program_difference: float
    geometry_warnings: tuple[str, ...] = ()
    drive: Drive | None = None
    contacts: tuple[Contact, ...] = ()  # the path is the user's, and not looked at

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks for the user on what was done unasked."""
        given_m = Programme.of(self.before.trajectory).ends_m
        if np.array_equal(given_m, self.original.ends_m):
            return ()
        return (
            'the programme sprays through turns beside the part; the gun is closed there now '
            '(--spray-turns keeps it open)',
        )

    @cached_property
    def changes(self) -> tuple[PassChange, ...]:
        """What changes, pass by pass, numbered as a simulation of the improved programme does."""
        original, improved = self.original, self.programme
        ends_m, numbers, begins_pass = strokes_of(improved)
        opened_m, closed_m = Programme.of(self.before.trajectory).ends_m.T
        on_m, off_m = improved.ends_m.T
        found: list[PassChange] = []
        for (begin, end), number in zip(ends_m[begins_pass], numbers[begins_pass], strict=True):
            # Less of an opening, or of a short pass or opening, is of its neighbour [m].
            common_m = np.minimum(off_m, end) - np.maximum(on_m, begin)
            enough_m = np.minimum(0.3 * (off_m - on_m), min(0.05, 0.3 * (end - begin)))
            own = np.flatnonzero(common_m > enough_m)
            if not len(own):
                continue
            first, last = own[[0, -1]]
            on, off = float(max(on_m[first], begin)), float(min(off_m[last], end))
            given_on, given_off = original.ends_m[first, 0], original.ends_m[last, 1]
            inside = on + STANDING_M, off - STANDING_M  # without a stay at either end
            # A turn that is sprayed through has no trigger that could be earlier or later.
            opens = on == on_m[first] and given_on in opened_m
            closes = off == off_m[last] and given_off in closed_m
            earlier = float(given_on - on) if opens else 0.0
            later = float(off - given_off) if closes else 0.0
            old, new = (float(p.speed_between(*inside)) for p in (original, improved))
            places = np.linspace(*inside, 61)
            speed = improved.speed_between(places[:-1], places[1:])
            found.append(PassChange(
                int(number) + 1, (on, off), (old, new), float(speed.min()), float(speed.max()),
                earlier, later, earlier / float(speed[0]), later / float(speed[-1]),
                (float(original.flow[first]), float(improved.flow[first])),
            ))  # fmt: skip
        return tuple(found)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What may be wrong, a line each with its likely cause."""
        found = [*self.geometry_warnings, *(self.drive.limits if self.drive else ())]
        found += self.wanted.doubts(self.after.statistics)
        off = self.after.mean_um / self.target_um - 1.0
        # A mean film further from the target than this share gives a warning.
        if abs(off) > 0.02:
            thick, slowed = off > 0.0, bool(self.drive and self.drive.limits)
            other = (SLOWEST,) if thick else (FASTEST, BEND, LEAD, JOINT)
            names = [name for name in self.binding if name not in other]
            remedy = 'allow a lower speed (--speed-min) or a greater flow (--flow)'
            if thick and slowed:
                names = ['the joints that slow its passes down']
                remedy = 'let the part stand elsewhere, paint place shows where'
            elif thick:
                remedy = 'allow a greater speed (--speed-max) or a lower flow (--flow)'
            found.append(
                f'the mean film is {self.after.mean_um:.1f} µm instead of {self.target_um:.1f}, '
                f'bound by {" and ".join(names) or "the path"}; '
                f'{100 * self.before.within:.0f} → {100 * self.after.within:.0f} % of the area '
                f'within the tolerance; {remedy}'
            )
        # The films of bag and robot program should agree to this share of the peak.
        if self.program_difference > 2e-3:
            found.append(
                f'the film of the robot program differs from that of the bag by '
                f'{100 * self.program_difference:.2f} % of the peak: its moves are too long for '
                'the changes of speed; allow shorter moves (--move-min, --settings-per-s) or give '
                'more --smoothness'
            )
        return tuple(found)

    @property
    def band(self) -> str:
        """The film accepted, in words."""
        if self.wanted.zones:
            return 'the band of its zone'
        return f'±{100 * self.after.tolerance:g} % of {self.target_um:.1f} µm'

    @property
    def sentence(self) -> str:
        """The improvement in a sentence."""
        a, b = self.before, self.after
        more = 100.0 * (b.paint.emitted_cm3 / a.paint.emitted_cm3 - 1.0)
        return (
            f'sigma_n {100 * a.sigma_n:.1f} → {100 * b.sigma_n:.1f} %, within {self.band} '
            f'{100 * a.within:.0f} → {100 * b.within:.0f} % of the area, paint '
            f'sprayed {more:+.0f} %, {a.cycle_time_s:.1f} → {b.cycle_time_s:.1f} s'
        )

    @property
    def region(self) -> str:
        """Where its figures are taken, in words."""
        area = self.surface.vertex_areas_m2
        where = ' and a film is wanted' if self.wanted.zones else ''
        return (
            f'the {float(area[self.wanted.region].sum()):.2f} of {self.surface.area_m2:.2f} m2 '
            f'that the programme paints{where}, by area'
        )

    @property
    def limit_sentences(self) -> tuple[str, ...]:
        """Which limits keep the film from being more even, a line each."""
        found = [
            f'limited by {name}: sigma_n {100 * sigma_n:.1f} % without it'
            for name, sigma_n in self.binding_limits.items()
        ]
        window = -self.request.trigger_cut_m, self.request.trigger_shift_m
        ends = [
            f'pass {one.number} {verb}' for one in self.changes
            for verb, metres in (('opens', one.opens_earlier_m), ('closes', one.closes_later_m))
            if any(end and abs(metres - end) < 0.002 for end in window)
        ]  # fmt: skip
        if ends:
            found.append(
                f'the trigger window binds: {", ".join(ends)} at its end; allow more with '
                '--trigger-shift or --trigger-cut'
            )
        found.append(
            'along this path, without limits and without weights for paint, time and smoothness, '
            f'sigma_n comes down to {100 * self.sigma_n_of_path:.1f} %: beyond that other passes '
            'are needed'
        )
        return tuple(found)

    def __repr__(self) -> str:
        return f'Improvement({self.sentence})'

    def to_dict(self) -> dict[str, Any]:
        """Figures, under the names of ``improvement.json``."""
        of_film: dict[str, Callable[[LaidFilm], float]] = {
            'mean_um': lambda of: of.mean_um,
            'sigma_n': lambda of: of.sigma_n,
            'within': lambda of: of.within,
            'spraying_s': lambda of: float(of.path.dwell_s[of.path.flow > 0.0].sum()),
            'cycle_s': lambda of: of.cycle_time_s,
            'paint_cm3': lambda of: of.paint.emitted_cm3,
            'min_um': lambda of: of.statistics.min_um,
            'max_um': lambda of: of.statistics.max_um,
            'on_part_cm3': lambda of: of.whole_part.painted_volume_cm3,
        }
        both = {
            name: {'before': figure(self.before), 'after': figure(self.after)}
            for name, figure in of_film.items()
        }
        films = {'before': self.before, 'after': self.after}
        laid = {when: film.statistics.to_dict().get('zones', []) for when, film in films.items()}
        region = float(self.surface.vertex_areas_m2[self.wanted.region].sum())
        return {
            'region': self.region,
            **both,
            'whole_part': {when: film.whole_part.to_dict() for when, film in films.items()},
            'target_um': self.target_um,
            'tolerance': self.after.tolerance,
            'sigma_n_of_path': self.sigma_n_of_path,
            'program_difference': self.program_difference,
            'sentence': self.sentence,
            'zones': [
                {'name': before['name'], 'before': before, 'after': after}
                for before, after in zip(*laid.values(), strict=True)
            ],
            'target_region_m2': region,
            'area_m2': self.surface.area_m2,
            'binding_limits': [
                {'name': name, 'sigma_n': sigma_n} for name, sigma_n in self.binding_limits.items()
            ],
            'passes': [{**asdict(one), 'sentence': one.sentence} for one in self.changes],
            'request': self.request.model_dump(),
            'robot': self.drive and self.drive.to_dict(),
            'warnings': list(self.warnings),
        }

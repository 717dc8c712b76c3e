"""Slowness along the openings of the gun: nodes, their films, a timed programme."""

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.film.integrator import FilmIntegrator
from paint_deposition.motion.path import SprayPath
from paint_deposition.motion.path_builder import spray_path
from paint_deposition.part.surface import Surface
from paint_deposition.planning.programme import STANDING_M, Programme
from paint_deposition.planning.requests import ImproveRequest

# What limits the speed, as messages call it.
FASTEST, BEND = 'the greatest speed', 'the speed in bends'
LEAD, JOINT = 'the way to and from the opening of the gun', 'the speed of a joint of the robot'


@dataclass(frozen=True)
class Nodes:
    """Places along the openings; slowness [s/m] is linear between them."""

    travel_m: np.ndarray  # (n,) length of the path up to each node, opening after opening
    opening: np.ndarray  # (n,) number of its opening
    ends_m: np.ndarray  # (m, 2) travel at which the openings that they belong to begin and end

    @staticmethod
    def of(ends_m: np.ndarray, spacing_m: float) -> 'Nodes':
        """Even nodes, about so far apart, both ends of each opening included."""
        places = [
            np.linspace(on, off, max(2, math.ceil((off - on) / spacing_m) + 1))
            for on, off in ends_m.tolist()
        ]
        numbers = [np.full(len(place), k) for k, place in enumerate(places)]
        return Nodes(np.concatenate(places), np.concatenate(numbers), ends_m)

    def __len__(self) -> int:
        return len(self.travel_m)

    @property
    def followed(self) -> np.ndarray:
        """(k,) nodes with a next one in the same opening."""
        return np.flatnonzero(self.opening[1:] == self.opening[:-1])

    def rows(self, opening: int) -> slice:
        """The nodes of an opening."""
        first, last = np.searchsorted(self.opening, [opening, opening + 1])
        return slice(int(first), int(last))


def retime(
    programme: Programme, nodes: Nodes, slowness: np.ndarray, limits: ImproveRequest
) -> Programme:
    """The programme at slowness (n,) [s/m] where the gun is open.

    Elsewhere it keeps its speed, but for what it takes to reach the speed at which the gun opens
    and to leave that at which it closes.
    """
    ends = programme.ends_m
    whole = programme.with_poses_at(ends.ravel())
    begin, end = whole.travel_m[:-1], whole.travel_m[1:]
    middle, length = 0.5 * (begin + end), end - begin
    moving = length > STANDING_M
    square = np.where(moving, length / whole.duration_s, 0.0) ** 2
    duration = whole.duration_s.copy()
    for number, (own_ends, around) in enumerate(zip(ends, programme.around_m, strict=True)):
        rows = nodes.rows(number)
        places = (rows.start, rows.stop - 1)
        for at, far, place, side in zip(own_ends, around, places, (-1.0, 1.0), strict=True):
            away = side * (middle - at)
            reach = 2.0 * limits.acceleration_m_per_s2 * away
            own = slowness[place] ** -2
            beside = (away > 0.0) & (away < side * (far - at))
            programmed = square[beside][np.abs(away[beside]).argmin()] if beside.any() else own
            # The programme's own way to a slower opening serves for any that is no faster.
            least = np.maximum(own - reach[beside], 0.0) if own > programmed else 0.0
            square[beside] = np.clip(square[beside], least, own + reach[beside])
    outside = moving & (square > 0.0)
    duration[outside] = length[outside] / np.sqrt(square[outside])
    for number, (on, off) in enumerate(ends):
        inside, rows = (middle > on) & (middle < off), nodes.rows(number)
        line = make_interp_spline(nodes.travel_m[rows], slowness[rows], k=1)
        since_on_s = line.antiderivative()
        duration[inside] = since_on_s(end[inside]) - since_on_s(begin[inside])
    # Poses that are reached in less than this [s] are left out: the gun stood there and does so no
    # more.
    kept = np.append(True, duration > 1e-5)
    return replace(
        whole,
        positions_m=whole.positions_m[kept],
        quaternions_xyzw=whole.quaternions_xyzw[kept],
        travel_m=whole.travel_m[kept],
        duration_s=duration[kept[1:]],
    )


def speed_bounds(
    programme: Programme, nodes: Nodes, limits: ImproveRequest
) -> tuple[np.ndarray, np.ndarray]:
    """(n,) how fast the gun may go at the nodes [m/s], and (n,) which limit sets that.

    In a bend no faster than the acceleration allows, unless it was programmed so; where it opens
    and closes, no faster than can be reached from its way there and slowed down on its way on.
    """
    places, at, length = nodes.travel_m, programme.positions_at_m, programme.travel_m[-1]
    # Half the length over which bends of the path and its programmed speed are measured [m].
    half = 0.02
    programmed = programme.speed_between(places - half, places + half)
    inner = np.clip(places, half, length - half)
    bend = at(inner + half) - 2.0 * at(inner) + at(inner - half)
    curvature = np.linalg.norm(bend, axis=1) / half**2
    allowed = np.sqrt(limits.acceleration_m_per_s2 / np.maximum(curvature, 1e-9))
    greatest = np.full(len(nodes), limits.speed_max_m_per_s)
    limit = np.full(len(nodes), FASTEST, dtype=object)
    others = [(BEND, np.maximum(allowed, programmed))]
    if programme.allowed:
        others.append((JOINT, np.interp(places, *programme.allowed)))
    for name, speed in others:
        slower = speed < greatest
        greatest[slower], limit[slower] = speed[slower], name
    for number, ends in enumerate(zip(programme.ends_m, programme.around_m, strict=True)):
        rows = nodes.rows(number)
        for end, far, node in zip(*ends, (rows.start, rows.stop - 1), strict=True):
            # The closed path beside the opening: a place on it that is much slower sets how fast
            # the gun can be where it opens or closes.
            step = 0.01
            count = math.ceil(abs(far - end) / step)
            beside = np.linspace(end, far, count + 1)
            speed = programme.speed_between(beside - step, beside + step)
            if count < 2 or speed.min() > 0.8 * speed[0]:
                continue
            slow = np.abs(beside - end)[speed <= 1.05 * speed.min()].min()
            reached = math.sqrt(speed.min() ** 2 + 2.0 * limits.acceleration_m_per_s2 * slow)
            # What the programme does there itself is possible, whatever is said of acceleration.
            fastest = max(reached, speed[0])
            if fastest < greatest[node]:
                greatest[node], limit[node] = fastest, LEAD
    return greatest, limit


class FilmAtPoints:
    """Films at vertices of a part, with the model's effects, the film's own included.

    They are divided by ``share`` (V,), the target of each vertex over the mean target.
    """

    def __init__(
        self, surface: Surface, rows: np.ndarray, model: DepositionModel, share: np.ndarray
    ) -> None:
        self.model, self._share = model, share
        self._surface, self._rows = surface, rows
        points = surface.points().select(rows)
        self._integrator = FilmIntegrator(points, model, occluder=surface)
        narrow = min(min(p.sigma1_m, p.sigma2_m) for p in model.patterns)
        self.step_m = max(model.max_step_m, narrow / 6.0)

    def film_um(self, programme: Programme) -> np.ndarray:
        """(V,) film of a programme at the points [um]."""
        path, _ = spray_path(programme.trajectory(), max_step_m=self.step_m)
        return self._integrator.raw_of(path) * self._finished_over_arrived(path) / self._share

    def of_nodes(self, programme: Programme, nodes: Nodes, density: np.ndarray) -> np.ndarray:
        """(n, V) films for a density of paint of 1 s/m at each node [um].

        Density is slowness times flow. The film is linear in it, but for effects that depend on
        the speed or on the time since the gun opened: they are taken as they are in this
        programme, which was timed at a density of paint (n,) [s/m].
        """
        path, _ = spray_path(programme.trajectory(), max_step_m=self.step_m)
        travel = programme.travel_at_m(path.stamp_ns)
        # The opening that each sub-step belongs to: the last that has begun.
        begun = np.searchsorted(programme.ends_m[:, 0], travel, side='right')
        sprayed, rows = self._integrator.sprayed(path)
        inside = np.clip(travel[rows], *programme.ends_m[np.maximum(begun - 1, 0)[rows]].T)
        # (M, n) weights of the nodes at the sub-steps.
        hats = BSpline.design_matrix(inside, np.pad(nodes.travel_m, 1, 'edge'), 1)
        shares = hats.multiply(1.0 / (hats @ density)[:, np.newaxis]).tocsc()
        films = np.empty((len(nodes), len(self._rows)))
        for node in range(len(nodes)):
            column = slice(shares.indptr[node], shares.indptr[node + 1])
            part = sprayed.select(shares.indices[column])
            self._integrator.reset()
            self._integrator.add_sprayed(part.with_(dwell_s=part.dwell_s * shares.data[column]))
            films[node] = self._integrator.raw_um
        return films * self._finished_over_arrived(path) / self._share

    def _finished_over_arrived(self, path: SprayPath) -> np.ndarray | float:
        """(V,) finished film over the film that arrived, from effects on the finished film."""
        if not any(effect.acts('on_film') for effect in self.model.effects):
            return 1.0
        surface = self._surface
        whole = FilmIntegrator(surface.points(), self.model, occluder=surface)
        raw = whole.raw_of(path)
        return np.divide(whole.film_um, raw, out=np.ones(len(raw)), where=raw > 0.0)[self._rows]

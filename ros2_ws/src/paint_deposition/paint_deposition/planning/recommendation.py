"""Which index lays an even film: a search over eq. (5) for the model's own collapse."""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import PaintError
from paint_deposition.model.eq3_collapse import half_width_m
from paint_deposition.model.eq4_eq5_uniformity import ParallelPasses
from paint_deposition.planning.placement import (
    SEARCHED,
    IndexCurve,
    choose_index,
    parallel_passes,
    passes_to_cover,
)
from paint_deposition.planning.requests import FASTEST_M_PER_S, SLOWEST_M_PER_S, IndexRequest

# Within this share of a speed film goes as 1 / speed, whatever an effect makes of the speed.
NEAR = 1e-4


@dataclass(frozen=True)
class Recommendation:
    """An index, and how far it can be trusted; lengths in m, thicknesses in um.

    Attributes:
        index_m, sigma_n: the recommended index and eq. (5) there.
        index_range_m: range searched.
        windows_m: index intervals in the range within the tolerance of the request.
        mean_um: mean film at index and speed.
        speed_m_per_s: of the passes.
        passes, cycle_time_s: for the width asked for, or None. The time runs from the first
            opening of the gun to its last closing, transfers between passes included.
        length_m: of a pass, that they were counted for.
        curve: sigma_n over the range, with all local minima inside it.
        standoff_m: TCP to plane. request: how the passes run.
        sb50_m: SB50 of one pass, its width at half its peak.
        index_drift_m: least and largest index that keep to the tolerance, or None.
        standoff_drift_m: least and largest change of standoff that do, negative is nearer; None
            with effects, which may depend on the standoff by themselves.
        notes: what the reader should know besides.
    """

    index_m: float
    sigma_n: float
    index_range_m: tuple[float, float]
    windows_m: tuple[tuple[float, float], ...]
    mean_um: float
    speed_m_per_s: float
    passes: int | None
    cycle_time_s: float | None
    length_m: float | None
    curve: IndexCurve
    standoff_m: float
    request: IndexRequest
    sb50_m: float
    index_drift_m: tuple[float, float] | None
    standoff_drift_m: tuple[float, float] | None
    notes: tuple[str, ...]

    @property
    def travel(self) -> str:
        """'alternating' or 'one_way'."""
        return 'one_way' if self.request.one_way else 'alternating'

    @property
    def sentence(self) -> str:
        """The recommendation in a sentence."""
        text = (
            f'index {self.index_m * 1e3:.0f} mm: sigma_n {self.sigma_n * 100:.2f} %, '
            f'mean film {self.mean_um:.1f} µm at {self.speed_m_per_s:.3g} m/s'
        )
        if self.passes:
            text += f', {self.passes} passes in {self.cycle_time_s:.1f} s'
        return text

    def __repr__(self) -> str:
        return f'Recommendation({self.sentence})'

    def to_dict(self) -> dict[str, Any]:
        """The content of ``recommendation.json``."""
        figures = {k: v for k, v in vars(self).items() if k not in ('curve', 'request')}
        assumed = ('target_um', 'tolerance', 'width_m', 'gun_turns', 'travel_rad', 'assumption')
        return {
            **figures,
            'travel': self.travel,
            **{name: getattr(self.request, name) for name in assumed},
            'minima': [
                {'index_m': index, 'sigma_n': sigma_n} for index, sigma_n in self.curve.minima
            ],
            'curve': {
                'index_m': self.curve.index_m.tolist(),
                'sigma_n': self.curve.sigma_n.tolist(),
            },
        }


def recommend(model: DepositionModel, request: IndexRequest) -> Recommendation:
    """Find the index that lays the most even film, or that in the widest range within tolerance.

    It is the deepest local minimum there, or the more even end of the range where there is none.
    Where the speed is chosen for a target, only an index is considered that needs none beyond the
    limits of the request.

    Raises:
        PaintError: there is no such index or speed; says why and what comes closest.
        ModelError: the model has several brushes.
    """
    model = model.single('an index')
    standoff = request.standoff_m or model.projection.nominal_standoff_m
    if not standoff > 0.0:
        raise PaintError(
            f'the model plane lies {standoff:g} m before the TCP; give standoff_m above 0'
        )
    request = request.model_copy(update={'standoff_m': standoff})
    speed = request.speed_m_per_s or 0.2
    # A speed that is only a guess is replaced at the end.
    guessed = request.speed_m_per_s is None and bool(model.effects)
    parallel = parallel_passes(model, request, speed, SEARCHED if guessed else 1.0)
    width = half_width_m(parallel.first)
    searched = request.index_range_m(width)
    if request.speed_m_per_s is None:
        searched = _within_speeds(parallel, speed, request, *searched)
    curve = IndexCurve.of(parallel, *searched)
    best = index_m, _ = choose_index(curve, request.tolerance)
    period = np.linspace(0.0, parallel.period_m(index_m), 65)
    # Film below this share of the mean, between passes, is a bare stripe.
    if parallel.thickness_um(index_m, period).min() < 0.01 * parallel.mean_um(index_m):
        raise PaintError(
            f'an index of {index_m:.3f} m leaves bare stripes: one pass is '
            f'{width:.3f} m wide at half its height; search about that index'
        )
    if request.speed_m_per_s is None:
        curve, best, speed = _at_target(model, request, curve, best, speed)
    index_m, sigma_n = best
    tolerance = request.tolerance
    windows = curve.windows_m(tolerance) if tolerance is not None else []
    index_drift = standoff_drift = None
    if windows:
        index_drift = next(w for w in windows if w[0] - NEAR <= index_m <= w[1] + NEAR)
        if not model.effects:
            # The bare projection widens a pass in proportion to its distance from the emission
            # point, which is as good as a narrower index.
            distance = standoff + model.projection.emission_offset_m
            nearer, further = (distance * (index_m / end - 1.0) for end in index_drift[::-1])
            standoff_drift = max(nearer, -standoff), further
    notes = _notes(model, request, curve, best, speed)
    if searched != request.index_range_m(width):
        notes.append(
            f'the index is searched from {searched[0]:.3g} to {searched[1]:.3g} m only: beyond, '
            'the target needs other speeds than are allowed'
        )
    passes = cycle_time = None
    length = request.width_m and (request.length_m or request.width_m)
    if request.width_m is not None and length is not None:
        passes = passes_to_cover(curve.parallel, index_m, request.width_m)
        between = math.hypot(length, index_m) if request.one_way else index_m
        cycle_time = (passes * length + (passes - 1) * between) / speed
    return Recommendation(
        index_m=index_m,
        sigma_n=sigma_n,
        index_range_m=(float(curve.index_m[0]), float(curve.index_m[-1])),
        windows_m=tuple(windows),
        mean_um=curve.parallel.mean_um(index_m),
        speed_m_per_s=speed,
        passes=passes,
        cycle_time_s=cycle_time,
        length_m=length,
        curve=curve,
        standoff_m=standoff,
        request=request,
        sb50_m=width,
        index_drift_m=index_drift,
        standoff_drift_m=standoff_drift,
        notes=tuple(notes),
    )


def _within_speeds(
    parallel: ParallelPasses, speed: float, request: IndexRequest, low_m: float, high_m: float
) -> tuple[float, float]:
    """The range of the index over which the target needs a speed within the limits.

    At a target the speed goes as 1 / index; that of the ``parallel`` passes is given.
    """
    least, most = request.speed_min_m_per_s, request.speed_max_m_per_s
    assert request.target_um is not None
    at_1_m = speed * parallel.mean_um(1.0) / request.target_um
    low, high = max(low_m, at_1_m / most), min(high_m, at_1_m / least)
    if not low < high:
        wanted, nearest = (at_1_m / low_m, least) if high < low_m else (at_1_m / high_m, most)
        remedy = 'allow other speeds (speed_min_m_per_s, speed_max_m_per_s), or another index'
        if (least, most) == (SLOWEST_M_PER_S, FASTEST_M_PER_S):  # nothing is slower or faster
            remedy = 'give another target or index'
        raise PaintError(
            f'target_um {request.target_um:g} at an index from {low_m:g} to {high_m:g} m needs '
            f'{wanted:.3g} m/s, where {least:g} to {most:g} m/s are allowed; the closest is '
            f'{request.target_um * wanted / nearest:.3g} µm at {nearest:g} m/s: {remedy}'
        )
    return low, high


def _at_target(
    model: DepositionModel, request: IndexRequest, curve: IndexCurve, best: tuple[float, float],
    speed: float,
) -> tuple[IndexCurve, tuple[float, float], float]:  # fmt: skip
    """Choose the speed: film goes as 1 / speed, unless an effect depends on the speed."""
    assert request.target_um is not None
    low, high = float(curve.index_m[0]), float(curve.index_m[-1])
    for _ in range(6):
        wanted = speed * curve.parallel.mean_um(best[0]) / request.target_um
        if not model.effects or abs(wanted - speed) <= NEAR * speed:
            parallel = curve.parallel
            first = parallel.first.scaled(speed / wanted)
            second = first if parallel.alike else parallel.second.scaled(speed / wanted)
            return replace(curve, parallel=ParallelPasses(first, second)), best, wanted
        speed = wanted
        curve = IndexCurve.of(parallel_passes(model, request, speed), low, high)
        best = choose_index(curve, request.tolerance)
    return curve, best, speed


def _notes(
    model: DepositionModel, request: IndexRequest, curve: IndexCurve, best: tuple[float, float],
    speed: float,
) -> list[str]:  # fmt: skip
    notes, (index_m, sigma_n) = [request.assumption], best
    if not request.one_way:
        otherwise = request.model_copy(update={'gun_turns': not request.gun_turns})
        there = parallel_passes(model, otherwise, speed, SEARCHED).sigma_n(index_m)
        if abs(there - sigma_n) > 1e-4:
            how = 'turned by 180 deg every way back'
            if request.gun_turns:
                how = 'keeping its orientation'
            notes.append(f'with the gun {how} sigma_n there would be {100 * there:.2f} %')
    end_m, end_sigma_n = curve.best_end
    if best not in curve.minima:
        side = 'smaller' if index_m < curve.index_m.mean() else 'greater'
        notes.append(f'there is no minimum of sigma_n here; it is more even at a {side} index')
    elif request.tolerance is None and end_sigma_n < sigma_n:
        notes.append(
            f'at the end of the range, {1e3 * end_m:.0f} mm, sigma_n is only '
            f'{100 * end_sigma_n:.2f} %, but no minimum'
        )
    mean = curve.parallel.mean_um(index_m)
    if request.target_um is not None and abs(mean / request.target_um - 1.0) > 1e-3:
        right = speed * mean / request.target_um
        notes.append(f'the target of {request.target_um:g} µm would need {right:.3g} m/s')
    if request.width_m is not None and request.length_m is None:
        notes.append('cycle time is for passes as long as the width')
    on_film = [e.id for e in model.effects if e.acts('on_film', 'on_gauge')]
    if on_film:
        notes.append(f'left out, for they act on the finished film: {", ".join(on_film)}')
    return notes

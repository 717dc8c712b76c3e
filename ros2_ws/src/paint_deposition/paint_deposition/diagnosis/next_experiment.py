"""What to measure and what to spray next, to discriminate between two explanations.

Their separation is what is left of the change that one makes to the readings after the pattern and
the other have been refitted (T-optimality: Atkinson and Fedorov, Biometrika 62, 1975). More
readings increase it where the two differ; another spray makes them differ.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from paint_deposition.diagnosis.sensitivities import neutral_shapes, sensitivity
from paint_deposition.diagnosis.verdict import Diagnosis
from paint_deposition.effects.base import Effect
from paint_deposition.fitting.forward import Forward
from paint_deposition.fitting.least_squares import Fit, derivatives
from paint_deposition.fitting.study import Study
from paint_deposition.motion.path import SprayPath
from paint_deposition.readings.campaign import Campaign, Experiment
from paint_deposition.readings.readings import Readings

CANDIDATES = 220
PROPOSED_POINTS = 8
# Gauges are not to be trusted next to a free edge [m], and readings are spread out [m].
EDGE_MARGIN_M = 0.012
SPACING_M = 0.05


@dataclass(frozen=True)
class Place:
    """A point to measure: position (3,) [m] and why."""

    position_m: np.ndarray
    experiment: str
    why: str

    def to_dict(self) -> dict[str, Any]:
        """An entry of ``next.measure`` in ``diagnosis.json``."""
        position = dict(zip(('x_m', 'y_m', 'z_m'), self.position_m.tolist(), strict=True))
        return {'experiment': self.experiment, **position, 'why': self.why}


@dataclass(frozen=True)
class Spray:
    """A proposed experiment: what, which two effects it separates, and how well.

    Attributes:
        what: in words; names the part where there are several.
        separates: two effect ids.
        separation: standard deviations between the two effects with it.
        now: the same without it.
    """

    what: str
    separates: tuple[str, str]
    separation: float
    now: float

    def to_dict(self) -> dict[str, Any]:
        """An entry of ``next.spray`` in ``diagnosis.json``."""
        return {
            'what': self.what,
            'separates': list(self.separates),
            'separation_sigma': self.separation,
            'separation_now_sigma': self.now,
        }


@dataclass(frozen=True)
class Rivals:
    """Two explanations of the same readings: the base fit, and the effect of each."""

    base: Fit
    first: Effect
    second: Effect


def propose_for(
    diagnosis: Diagnosis, library: Mapping[str, type[Effect]]
) -> tuple[list[Place], list[Spray]]:
    """Places and sprays that would settle a diagnosis between its two leading explanations.

    These are the two most probable members of the leading class, or the leading effects of
    the two most probable classes; without two of them nothing is proposed.
    """
    found = diagnosis.classes
    if not found:
        return [], []
    second = found[0].members[1] if len(found[0].members) > 1 else None
    if second is None and len(found) > 1 and not diagnosis.accepted:
        second = found[1].best
    if second is None or found[0].best not in library or second not in library:
        return [], []
    values = {name: interval.value for name, interval in found[0].parameters.items()}
    first = diagnosis.model.effect(found[0].best) or library[found[0].best](**values)
    rival = neutral_shapes(library[second])[0]
    return propose(diagnosis.study, Rivals(diagnosis.history[0].fit, first, rival))


def propose(study: Study, rivals: Rivals, seed: int = 0) -> tuple[list[Place], list[Spray]]:
    """Places to measure on the parts at hand, and sprays, best first."""
    sigma = study.noise.typical_um
    here = _derivatives(study.campaign, rivals, study.sigma_um)
    now = _separation([here])
    names = rivals.first.id, rivals.second.id
    sprays = []
    for experiment, (what, change) in product(study.campaign.experiments, MENU.items()):
        other = Campaign((replace(experiment, path=change(experiment.path, experiment)),))
        there = _derivatives(other, rivals, np.full(len(other), sigma))
        if len(study.campaign.experiments) > 1:
            what = f'{what}, on {experiment.name}'
        sprays.append(Spray(what, names, _separation([here, there]), now))
    places = _places(study, rivals, here, sigma, seed)
    return places, sorted(sprays, key=lambda spray: -spray.separation)[: len(MENU)]


@dataclass(frozen=True)
class _Derivatives:
    """Derivatives of the readings over the noise.

    By the pattern's parameters, by the first effect as it was found, and by the amplitudes of the
    second.
    """

    jacobian: np.ndarray
    first: np.ndarray
    second: np.ndarray

    def at(self, k: int) -> '_Derivatives':
        """Those of one reading."""
        return _Derivatives(self.jacobian[[k]], self.first[[k]], self.second[[k]])


def _derivatives(campaign: Campaign, rivals: Rivals, sigma_um: np.ndarray) -> _Derivatives:
    forward = Forward(campaign)
    base = rivals.base
    jacobian = derivatives(forward, base.parameters, base.vector, sigma_um)
    without = forward.predict_um(base.model)
    first = (forward.predict_um(base.model.with_effect(rivals.first)) - without) / sigma_um
    second = sensitivity(forward, base, rivals.second, sigma_um).columns
    return _Derivatives(jacobian, first, second)


def _separation(parts: list[_Derivatives]) -> float:
    """Standard deviations of the first effect's change that the second cannot imitate."""
    fitted = np.vstack([np.hstack([p.jacobian, p.second]) for p in parts])
    change = np.concatenate([p.first for p in parts])
    priors = np.eye(fitted.shape[1]) * 1e-3
    solved, *_ = np.linalg.lstsq(
        np.vstack([fitted, priors]), np.concatenate([change, np.zeros(len(priors))]), rcond=None
    )
    return float(np.linalg.norm(change - fitted @ solved))


def _places(
    study: Study, rivals: Rivals, here: _Derivatives, sigma_um: float, seed: int
) -> list[Place]:
    """Add one point after the other, on any part, each where it separates most."""
    parts_of = study.campaign.experiments
    count = CANDIDATES // len(parts_of)
    there = Campaign(tuple(_candidates(e, count, seed + k) for k, e in enumerate(parts_of)))
    part, positions_m = there.experiment_of, there.positions_m
    derivatives_there = _derivatives(there, rivals, np.full(len(part), sigma_um))
    reached = Forward(there).predict_um(rivals.base.model)
    usable = reached > 0.2 * np.mean(study.measured_um)
    places: list[Place] = []
    parts = [here]
    before = _separation(parts)
    for _ in range(PROPOSED_POINTS):
        best, gain = -1, before
        for k in np.flatnonzero(usable):
            value = _separation([*parts, derivatives_there.at(k)])
            if value > gain:
                best, gain = int(k), value
        if best < 0:
            break
        parts.append(derivatives_there.at(best))
        where = positions_m[best]
        why = (
            f'separates {rivals.first.id} from {rivals.second.id}: '
            f'{before:.1f} to {gain:.1f} standard deviations'
        )
        places.append(Place(where, parts_of[part[best]].name, why))
        near = np.linalg.norm(positions_m - where, axis=1) < SPACING_M
        usable &= ~(near & (part == part[best]))
        before = gain
    return places


def _candidates(experiment: Experiment, count: int, seed: int) -> Experiment:
    """The experiment with readings yet to be taken at random points, clear of free edges."""
    surface = experiment.surface
    random = np.random.default_rng(seed)
    chosen = random.permutation(len(surface.vertices_m))[: 4 * count]
    points = surface.points().select(chosen)
    inside = chosen[points.edge_distance_m > EDGE_MARGIN_M][:count]
    readings = Readings.of(
        surface.vertices_m[inside], np.zeros(len(inside)), normals=surface.normals[inside]
    )
    return Experiment.of(experiment.name, surface, experiment.path, readings)


def _gun_rolled(path: SprayPath, experiment: Experiment) -> SprayPath:
    rolled = path.rotation.copy()
    rolled[:, :, :2] *= -1.0
    return path.with_(rotation=rolled)


def _passes_reversed(path: SprayPath, experiment: Experiment) -> SprayPath:
    return path.with_(
        spray_pass=np.where(path.spray_pass < 0, -1, path.spray_pass.max() - path.spray_pass),
        velocity_m_per_s=-path.velocity_m_per_s,
        since_on_s=path.until_off_s,
        until_off_s=path.since_on_s,
        since_off_s=path.until_on_s,
        until_on_s=path.since_off_s,
        from_turn_m=path.to_turn_m,
        to_turn_m=path.from_turn_m,
    )


def _moved_off(distance_m: float) -> Callable[[SprayPath, Experiment], SprayPath]:
    def moved(path: SprayPath, experiment: Experiment) -> SprayPath:
        return path.with_(position_m=path.position_m - distance_m * path.rotation[:, :, 2])

    return moved


def _half_flow(path: SprayPath, experiment: Experiment) -> SprayPath:
    return path.with_flow_scaled(0.5)


MENU: dict[str, Callable[[SprayPath, Experiment], SprayPath]] = {
    'the same passes with the gun rolled 180 deg about its axis': _gun_rolled,
    'the same passes in reverse order and direction': _passes_reversed,
    'the same passes 60 mm further off': _moved_off(0.06),
    'the same passes 60 mm closer': _moved_off(-0.06),
    'the same passes at half the flow': _half_flow,
}

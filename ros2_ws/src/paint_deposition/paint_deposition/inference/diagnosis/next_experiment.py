"""What to measure and what to spray next, to separate the explanations that compete.

Their separation, see ``separation``, is computed for the readings at hand and for these together
with those of a further experiment. The experiment after which most probably one explanation is
left comes first; its cost decides between experiments that are about as good.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np

from paint_deposition.effects.base import Effect
from paint_deposition.inference.diagnosis.proposals import Place, Spray, chance_of_settling
from paint_deposition.inference.diagnosis.rivals import Rivals, rivals_of
from paint_deposition.inference.diagnosis.separation import Imitation, Predicted, imitate
from paint_deposition.inference.diagnosis.sprays import AS_BEFORE, MENU, Change, pairs
from paint_deposition.inference.diagnosis.stationary_spray import (
    KEY,
    StationarySpray,
    spots,
    suits,
)
from paint_deposition.inference.diagnosis.verdict import Diagnosis
from paint_deposition.inference.fitting.forward import Forward
from paint_deposition.inference.fitting.least_squares import on_one_thread
from paint_deposition.inference.fitting.study import Study
from paint_deposition.inference.readings.campaign import Campaign, Experiment
from paint_deposition.inference.readings.readings import PointMeans, Readings

CANDIDATES = 220
PROPOSED_POINTS = 8
# Gauges are not to be trusted next to a free edge [m], and readings are spread out [m].
EDGE_MARGIN_M = 0.012
SPACING_M = 0.05
# A point with less than this share of the mean film was hardly painted.
PAINTED = 0.2
# Sprays that are named, parts on which they are tried, single changes of which two at once are
# tried, and spots before which the gun stands still.
PROPOSED_SPRAYS, TRIED_PARTS, COMBINED, SPOTS = 15, 2, 4, 5
# What may be changed of a gun that stands still.
OF_STANDING = ('roll', 'standoff', 'part', 'voltage', 'draught')
# Chance of settling that one unit of cost is worth, as a share; that of spraying on one spot, and
# what a film that may sag costs more.
WORTH_OF_COST, COST_OF_STANDING, COST_OF_SAG = 0.05, 1.0, 1.0


@dataclass(frozen=True)
class _Pair:
    """Two explanations by number: the one shown, and the one that was refitted to imitate it."""

    shown: int
    imitator: int
    imitation: Imitation


@dataclass(frozen=True)
class ScoredExperiment:
    """A spray that was tried in the model."""

    experiment: Experiment
    change: Change
    spray: Spray
    worth: float
    spot: int | None = None


@on_one_thread
def with_proposals(diagnosis: Diagnosis, library: Mapping[str, type[Effect]]) -> Diagnosis:
    """A diagnosis with places and sprays that would settle between the competing explanations.

    Without two of them nothing is proposed.
    """
    rivals = rivals_of(diagnosis, library)
    proposals = ((), ()) if rivals is None else propose(rivals)
    return replace(diagnosis, library=library, proposals=proposals)


def propose(rivals: Rivals, seed: int = 0) -> tuple[list[Place], list[Spray]]:
    """Places to measure on the parts at hand, and sprays, best first."""
    return _places(rivals, seed), _sprays(rivals)


def compared(free: np.ndarray, predicted: Sequence[Predicted]) -> list[_Pair]:
    """Each explanation beside each other, the two that are least apart first.

    Args:
        free: (P, k) directions of unit variance in which the readings may deviate anyway.
        predicted: what each explanation predicts for these readings.
    """
    found = [
        _Pair(shown, imitator, imitate(free, predicted[shown], predicted[imitator]))
        for shown, imitator in permutations(range(len(predicted)), 2)
    ]
    return sorted(found, key=lambda pair: pair.imitation.separation)


def _sprays(rivals: Rivals) -> list[Spray]:
    free = np.hstack([rivals.free(rivals.fit.jacobian), rivals.study.nuisance])
    now = compared(free, rivals.here)[0].imitation.separation
    parts = _parts_that_show_most(rivals)
    made = _best([_tried(rivals, part, change, now) for part in parts for change in MENU])
    if made:
        best = made[0].experiment
        leading = [one.change for one in made if one.experiment is best][:COMBINED]
        made += _best([_tried(rivals, best, change, now) for change in pairs(leading)])
    families = {rival.effect.family for rival in rivals.found if rival.effect is not None}
    if suits(rivals.fit.model, families):
        still = _best([
            _tried(rivals, part, AS_BEFORE, now, spot)
            for part in parts for spot in spots(part, SPOTS)
        ])  # fmt: skip
        made += still
        if still:
            best, spot = still[0].experiment, still[0].spot
            changes = [change for change in MENU if change.kind in OF_STANDING]
            made += _best([_tried(rivals, best, change, now, spot) for change in changes])
    return [one.spray for one in _best(made)[:PROPOSED_SPRAYS]]


def _best(tried: Sequence[ScoredExperiment | None]) -> list[ScoredExperiment]:
    """Those that can be done, best first."""
    return sorted((one for one in tried if one is not None), key=lambda one: -one.worth)


def _parts_that_show_most(rivals: Rivals) -> list[Experiment]:
    """The experiments on which what competes shows most."""
    campaign = rivals.study.campaign
    shown = sum(predicted.change**2 for predicted in rivals.here)
    by_part = np.bincount(campaign.experiment_of, shown)
    return [campaign.experiments[k] for k in np.argsort(-by_part)[:TRIED_PARTS]]


def _tried(
    rivals: Rivals, experiment: Experiment, change: Change, now: float, spot: int | None = None
) -> ScoredExperiment | None:
    """How well the readings would separate with this spray, None where it cannot be done.

    Args:
        change: what is done otherwise.
        spot: measured point before which the gun stands still; None: it runs the passes.
    """
    study = rivals.study
    new = change.made(experiment)
    if new is None:
        return None
    stand = None
    if spot is not None:
        # The thickest film that may be sprayed on a spot: that wanted, else that measured.
        most_um = study.campaign.target_um or float(study.measured_um.max())
        stand = StationarySpray.before(new, spot, rivals.fit.model, most_um)
        if stand is None:
            return None
        new = stand.sprayed(new)
    new = replace(new, name=f'{experiment.name}, next')
    forward = Forward(Campaign((new,)), study.forward.effects)
    film_um = forward.predict_um(rivals.fit.model)
    if film_um.mean() < PAINTED * study.measured_um.mean():
        return None
    noise_um = study.noise.typical_um
    new = _with_readings(new, new.measured_points.positions_m, film_um, noise_um)
    together = Study.of(Campaign((*study.campaign.experiments, new)))
    if len(together) != len(study) + len(film_um):
        return None
    sigma_um = together.sigma_um[len(study) :]
    free = np.vstack([rivals.free(rivals.fit.jacobian), rivals.nuisance_at(forward, sigma_um)])
    free = np.hstack([free, together.nuisance])
    there = rivals.predictions_at(Campaign((new,)), forward, sigma_um)
    predicted = [here.with_more(more) for here, more in zip(rivals.here, there, strict=True)]
    apart = compared(free, predicted)
    spray = Spray(
        _in_words(study, experiment, change, stand), rivals.names, apart[0].imitation.separation,
        now, len(film_um), experiment.name, change.keys if stand is None else (KEY, *change.keys),
        _chance(rivals, apart), stand.peak_um if stand else float(film_um.max()),
        float(experiment.means.mean_um.max()), stand,
    )  # fmt: skip
    cost = change.cost + COST_OF_STANDING * (stand is not None)
    cost += COST_OF_SAG * bool(spray.film_words)
    return ScoredExperiment(
        experiment, change, spray, spray.chance * (1.0 - WORTH_OF_COST * cost), spot
    )


def _in_words(
    study: Study, experiment: Experiment, change: Change, stand: StationarySpray | None
) -> str:
    what = f'the same passes {change.words}'
    if stand is not None:
        # Its words give the distance already.
        otherwise = '' if change.kind == 'standoff' else change.words
        what = f'{stand.words}; {otherwise}'.removesuffix('; ')
    return f'{what}, on {experiment.name}' if len(study.campaign.experiments) > 1 else what


def _chance(rivals: Rivals, apart: Sequence[_Pair]) -> float:
    """Probability that the true effect is left alone, on average over which it is."""
    left = {k: 1.0 for k, rival in enumerate(rivals.found) if rival.effect is not None}
    for pair in apart:
        if pair.shown in left:
            separation = np.array(pair.imitation.separation)
            left[pair.shown] *= float(chance_of_settling(separation))
    return float(np.mean(list(left.values())))


def _with_readings(
    experiment: Experiment, positions_m: np.ndarray, film_um: np.ndarray, noise_um: float
) -> Experiment:
    """The experiment with predicted films (P,) [um] as its readings."""
    readings = Readings.of(positions_m, film_um, sigma_um=np.full(len(film_um), noise_um))
    return replace(experiment, readings=readings, means=PointMeans.of(readings), taken=readings,
                   used=np.ones(len(readings), dtype=bool))  # fmt: skip


def _places(rivals: Rivals, seed: int) -> list[Place]:
    """Add one point after the other, on any part, each where it separates the least apart most."""
    study = rivals.study
    parts = study.campaign.experiments
    both = [_with_candidates(rivals, e, seed + k) for k, e in enumerate(parts)]
    together = Study.of(Campaign(tuple(both)), study.forward.effects)
    part, positions_m = together.campaign.experiment_of, together.campaign.positions_m
    taken = np.concatenate([np.arange(len(b)) < len(e) for b, e in zip(both, parts, strict=True)])
    film_um, sigma_um = together.measured_um, together.sigma_um
    if len(taken) != len(film_um):
        return []
    free = rivals.nuisance_at(together.forward, sigma_um)
    free = np.hstack([free, together.nuisance])
    predicted = rivals.predictions_at(together.campaign, together.forward, sigma_um)
    usable = ~taken & (film_um > PAINTED * np.mean(study.measured_um))
    places: list[Place] = []
    pair = compared(free[taken], [p.select(taken) for p in predicted])[0]
    while usable.any() and len(places) < PROPOSED_POINTS:
        shown, imitator = pair.shown, pair.imitator
        gains = pair.imitation.gains(free, predicted[shown], predicted[imitator])
        best = int(np.argmax(np.where(usable, gains, -1.0)))
        before = pair.imitation.separation
        after = float(np.hypot(before, np.sqrt(gains[best])))
        names = rivals.found[shown].name, rivals.found[imitator].name
        why = (
            f'separates {names[0]} from {names[1]}: {before:.1f} to {after:.1f} standard '
            'deviations'
        )
        places.append(Place(positions_m[best], parts[part[best]].name, why, float(film_um[best])))
        near = np.linalg.norm(positions_m - positions_m[best], axis=1) < SPACING_M
        usable &= ~(near & (part == part[best]))
        taken[best] = True
        pair = compared(free[taken], [p.select(taken) for p in predicted])[0]
    return places


def _with_candidates(rivals: Rivals, experiment: Experiment, seed: int) -> Experiment:
    """The experiment with further readings at random points, clear of free edges."""
    study, surface = rivals.study, experiment.surface
    count = CANDIDATES // len(study.campaign.experiments)
    random = np.random.default_rng(seed)
    chosen = random.permutation(len(surface.vertices_m))[: 4 * count]
    points = surface.points().select(chosen)
    inside = chosen[points.edge_distance_m > EDGE_MARGIN_M][:count]
    here = experiment.measured_points
    positions = np.vstack([here.positions_m, surface.vertices_m[inside]])
    normals = np.vstack([here.normals, surface.normals[inside]])
    new = experiment.with_readings(
        Readings.of(positions, np.zeros(len(positions)), normals=normals)
    )
    film_um = Forward(Campaign((new,)), study.forward.effects).predict_um(rivals.fit.model)
    return _with_readings(new, positions, film_um, study.noise.typical_um)

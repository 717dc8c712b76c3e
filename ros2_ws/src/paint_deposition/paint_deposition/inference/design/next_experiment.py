"""What to measure and what to spray next, to separate the explanations that compete.

For every experiment it is known beforehand how much its readings will tell, see ``contenders``.
That after which most probably one explanation is left comes first; its cost decides between
experiments that are about as good.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import islice

import numpy as np

from paint_deposition.effects.base import Effect
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.inference.design.contenders import (
    Contender,
    Forecast,
    contenders_of,
    one_by_one,
)
from paint_deposition.inference.design.proposals import (
    KEY,
    Place,
    Spray,
    StationarySpray,
    spots,
    suits,
)
from paint_deposition.inference.design.sprays import AS_BEFORE, MENU, Change, pairs
from paint_deposition.inference.diagnosis.verdict import Diagnosis
from paint_deposition.inference.fitting.forward import Forward
from paint_deposition.inference.fitting.least_squares import on_one_thread
from paint_deposition.inference.fitting.study import Study
from paint_deposition.inference.readings.campaign import Campaign, Experiment
from paint_deposition.inference.readings.readings import Readings

# Gauges are not to be trusted next to a free edge [m], and readings are spread out [m].
EDGE_MARGIN_M = 0.012
SPACING_M = 0.05
# A point with less than this share of the mean film was hardly painted.
PAINTED = 0.2


@on_one_thread
def with_proposals(diagnosis: Diagnosis, library: Mapping[str, type[Effect]]) -> Diagnosis:
    """A diagnosis with places and sprays that would settle between the competing explanations.

    Without two of them nothing is proposed.
    """
    contenders = contenders_of(diagnosis, library)
    proposals = propose(diagnosis.study, contenders) if contenders else ((), ())
    return replace(diagnosis, library=library, proposals=proposals)


def propose(study: Study, contenders: Sequence[Contender]) -> tuple[list[Place], list[Spray]]:
    """Places to measure on the parts at hand, and sprays, best first."""
    return _places(study, contenders), _sprays(study, contenders)


def _sprays(study: Study, contenders: Sequence[Contender]) -> list[Spray]:
    # On the part on which the films of what competes differ most.
    films_um = np.array([contender.fit.predicted_um for contender in contenders])
    by_part = np.bincount(study.campaign.experiment_of, (films_um / study.sigma_um).var(axis=0))
    part = study.campaign.experiments[int(by_part.argmax())]
    made = _best([_tried(study, contenders, part, change) for change in MENU])
    # Of the best single changes two at once are tried.
    leading = [change for one in made[:4] for change in MENU if (change.key,) == one.changes]
    made += _best([_tried(study, contenders, part, change) for change in pairs(leading)])
    effects = (contender.fit.model.effect(contender.name) for contender in contenders)
    families = {effect.family for effect in effects if effect is not None}
    if suits(contenders[-1].fit.model, families):
        tried = ((k, _tried(study, contenders, part, AS_BEFORE, k)) for k in spots(part, 5))
        still = {spot: spray for spot, spray in tried if spray is not None}
        made += still.values()
        if still:
            # What may be changed of a gun that stands still.
            kinds = ('roll', 'standoff', 'part', 'voltage', 'draught')
            changes = [change for change in MENU if change.kind in kinds]
            spot = max(still, key=lambda spot: still[spot].worth)
            made += _best([_tried(study, contenders, part, change, spot) for change in changes])
    return _best(made)[:15]


def _best(tried: Sequence[Spray | None]) -> list[Spray]:
    """Experiments that can be done, best first."""
    return sorted((one for one in tried if one is not None), key=lambda one: -one.worth)


def _tried(
    study: Study,
    contenders: Sequence[Contender],
    experiment: Experiment,
    change: Change,
    spot: int | None = None,
) -> Spray | None:
    """How well the readings would separate with this spray, None where it cannot be done.

    Args:
        change: what is done otherwise.
        spot: measured point before which the gun stands still; None: it runs the passes.
    """
    model = contenders[-1].fit.model
    new = change.made(experiment)
    if new is None:
        return None
    stand = None
    if spot is not None:
        # The thickest film that may be sprayed on a spot: that wanted, else that measured.
        target_um, _ = study.campaign.target_of(experiment)
        most_um = target_um or float(study.measured_um.max())
        stand = StationarySpray.before(new, spot, model, most_um)
        if stand is None:
            return None
        new = stand.sprayed(new)
    new = replace(new, name=f'{experiment.name}, next')
    film_um = Forward(Campaign((new,)), study.forward.effects).predict_um(model)
    if film_um.mean() < PAINTED * study.measured_um.mean():
        return None
    noise_um = np.full(len(film_um), study.noise.typical_um)
    new = new.read_as(Readings.of(new.measured_points.positions_m, film_um, sigma_um=noise_um))
    together = _together(study, (*study.campaign.experiments, new))
    if len(together) != len(study) + len(film_um):
        return None
    forecast = Forecast.of(contenders, together, np.arange(len(together)), len(study))
    now, then = forecast.separations
    return Spray(
        _in_words(study, experiment, change, stand),
        tuple(contender.name for contender in contenders), then,
        now, len(film_um), experiment.name, (*([KEY] if stand else []), *change.key.split()),
        forecast.chance, stand.peak_um if stand else float(film_um.max()),
        float(experiment.readings.mean_um.max()), stand, change.cost,
    )  # fmt: skip


def _together(study: Study, experiments: Sequence[Experiment]) -> Study:
    """The study with the readings of these experiments, noise and texture as they are."""
    together = Study.of(Campaign(tuple(experiments)), study.forward.effects)
    return replace(together, estimated_texture=study.estimated_texture)


def _in_words(
    study: Study, experiment: Experiment, change: Change, stand: StationarySpray | None
) -> str:
    what = f'the same passes {change.words}'
    if stand is not None:
        # Its words give the distance already.
        otherwise = '' if change.kind == 'standoff' else change.words
        what = f'{stand.words}; {otherwise}'.removesuffix('; ')
    return f'{what}, on {experiment.name}' if len(study.campaign.experiments) > 1 else what


def _places(study: Study, contenders: Sequence[Contender]) -> list[Place]:
    """Add one point after the other, each where it tells the leading effect from its rival."""
    parts = study.campaign.experiments
    model = contenders[-1].fit.model
    both = [_with_candidates(study, k, model) for k in range(len(parts))]
    together = _together(study, both)
    part, positions_m = together.campaign.experiment_of, together.campaign.positions_m
    taken = np.concatenate([np.arange(len(b)) < len(e) for b, e in zip(both, parts, strict=True)])
    if len(taken) != len(together):
        return []
    rows = np.flatnonzero(~taken)
    order = np.concatenate([np.flatnonzero(taken), rows])
    forecast = Forecast.of(contenders, together, order, len(order) - len(rows))
    part, positions_m, film_um = part[rows], positions_m[rows], together.measured_um[rows]
    usable = film_um > PAINTED * np.mean(study.measured_um)
    places: list[Place] = []
    for best, pair, (before, after) in islice(one_by_one(forecast, usable), 8):
        names = contenders[pair[0]].name, contenders[pair[1]].name
        why = (
            f'separates {names[0]} from {names[1]}: {before:.1f} -> {after:.1f} standard '
            'deviations'
        )
        places.append(Place(positions_m[best], parts[part[best]].name, why, float(film_um[best])))
        near = np.linalg.norm(positions_m - positions_m[best], axis=1) < SPACING_M
        usable &= ~(near & (part == part[best]))
    return places


def _with_candidates(study: Study, number: int, model: DepositionModel) -> Experiment:
    """A part with further readings at random points, clear of free edges, as a model predicts."""
    experiment, own = study.campaign.experiments[number], study.campaign.experiment_of == number
    surface, here = experiment.surface, experiment.measured_points
    count = 220 // len(study.campaign.experiments)
    random = np.random.default_rng(number)
    chosen = random.permutation(len(surface.vertices_m))[: 4 * count]
    points = surface.points().select(chosen)
    inside = chosen[points.edge_distance_m > EDGE_MARGIN_M][:count]
    session = experiment.readings.session[experiment.readings.first]
    readings = Readings.of(
        np.vstack([here.positions_m, surface.vertices_m[inside]]),
        np.concatenate([study.measured_um[own], np.zeros(len(inside))]),
        normals=np.vstack([here.normals, surface.normals[inside]]),
        sigma_um=np.concatenate(
            [study.gauge_um[own], np.full(len(inside), study.noise.typical_um)]
        ),
        session=np.concatenate([session, np.resize(session, len(inside))]),
    )
    new = experiment.with_readings(readings)
    film_um = Forward(Campaign((new,)), study.forward.effects).predict_um(model)
    film_um[: len(here)] = readings.thickness_um[: len(here)]
    return new.read_as(replace(readings, thickness_um=film_um))

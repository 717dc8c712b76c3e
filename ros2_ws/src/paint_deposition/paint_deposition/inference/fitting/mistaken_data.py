"""Data that are simply wrong: of the other hand, of another spray, in another unit.

Each way in which readings may have been meant is fitted like the readings as given, and the two
likelihoods are compared, as they are for typing errors. Both allow for what the model may lack:
smooth fields of every size, see ``outliers``. The readings as given may also be displaced by any
effect of the library, as a draught is no mirrored part. What is symmetric cannot tell.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import numpy as np

from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import ReadingsError
from paint_deposition.inference.fitting.forward import LAWS
from paint_deposition.inference.fitting.least_squares import Fit
from paint_deposition.inference.fitting.outliers import FittedPoints
from paint_deposition.inference.fitting.parameters import FreeParameters
from paint_deposition.inference.fitting.study import Mistake, Study
from paint_deposition.inference.readings.campaign import Campaign, Experiment
from paint_deposition.inference.readings.places import MAX_DISTANCE_M, from_edges_m, on_face_m
from paint_deposition.inference.readings.plausibility import check_unit
from paint_deposition.kernel.blocks import box_centre_m
from paint_deposition.model.eq1_pattern import PlanarPattern
from paint_deposition.part.points import across_axis, downhill_axis

# Prior probability that a campaign has a mistake of a kind, shared by all hypotheses of the kind.
PRIOR_PROBABILITY = {'mirrored': 1e-3, 'exchanged': 1e-3, 'unit': 0.01, 'gun': 0.01}
# Logarithm of the odds from which on there is one.
LEAST_LOG_ODDS = 4.0
# Hypotheses are weighed if the logarithm of their likelihood without any field gains so much.
WORTH_WEIGHING = 6.0
# Readings over what was meant, in words, and what to do.
FACTORS = {
    10.0: ('ten times too large', 'divide them by 10'),
    0.1: ('ten times too small', 'multiply them by 10'),
    25.4: ('like µm that were taken for mils', 'say unit: {thickness: um} in the campaign'),
    1.0 / 25.4: ('like mils taken for µm', 'say unit: {thickness: mil} in the campaign'),
    1000.0: ('like µm that were taken for mm', 'say unit: {thickness: um} in the campaign'),
    1e-3: ('like mm taken for µm', 'say unit: {thickness: mm} in the campaign'),
}
# What mirrors across and down make of a part.
MIRRORED = {
    'mirrored left to right': (1, 0),
    'mirrored top to bottom': (0, 1),
    'turned by half a turn': (1, 1),
}
# Kinds of mistakes by which readings are taken for those of other places, and the share of what is
# off that parts with such readings bear.
PLACES, LEAST_BORNE = ('mirrored', 'exchanged'), 0.25


@dataclass(frozen=True)
class Meant:
    """A way in which the readings of a campaign may have been meant."""

    kind: str
    finding: str  # what is wrong with those given
    remedy: str
    campaign: Campaign
    log_scale: float = 0.0  # sum over the points of the logarithm of given over meant film
    of_this_gun: bool = True  # whether the given model is


@dataclass(frozen=True)
class Weighed:
    """Readings as given or as meant, with the model fitted to them."""

    study: Study
    fit: Fit
    start: DepositionModel  # of all fits
    of_this_gun: bool  # whether the start is more than a first guess
    log_scale: float = 0.0  # as ``Meant``

    def meant(self, way: Meant) -> 'Weighed':
        """The readings as meant, fitted from the model at hand."""
        fit, like = self.fit, self.study
        study = Study.of(way.campaign, like.forward.effects)
        study = replace(study, estimated_texture=like.estimated_texture)
        if like.facet_um is not None:
            study = study.with_facets(fit.model)
        known = fit.parameters.known if way.of_this_gun else None
        free = FreeParameters.of(fit.model, *fit.model.effects, known=known)
        # From wrong readings a fit may have gone far astray.
        fit = study.fit(free, nuisance=study.nuisance, others=[self.start])
        of_this_gun = self.of_this_gun and way.of_this_gun
        return Weighed(study, fit, self.start, of_this_gun, self.log_scale + way.log_scale)

    @property
    def displaced(self) -> 'Weighed':
        """The readings, fitted with all effects that displace the film."""
        fit, own = self.fit, self.fit.model.effects
        effects = (
            effect()
            for key, effect in EFFECTS.items()
            if effect.family in ('lateral shift', 'order', 'time')
            and not effect.acts(*LAWS)
            and not fit.model.effect(key)
        )
        free = FreeParameters.of(fit.model, *own, *effects, known=fit.parameters.known)
        return replace(self, fit=self.study.fit(free, nuisance=self.study.nuisance))

    @property
    def log_weight(self) -> float:
        """Logarithm of the likelihood, whatever smooth field the model lacks."""
        fit = self.fit
        # The model is linear around the fit, and its prior is not centred there.
        off = fit.residual + fit.jacobian @ (fit.vector - fit.parameters.prior.centre)
        misfit = replace(fitted_points(self.study, fit), residual_um=off * self.study.sigma_um)
        return misfit.log_likelihood - self.log_scale + self.log_size()

    @property
    def rough_log_weight(self) -> float:
        """Logarithm of the likelihood if the model lacks nothing, up to a constant."""
        spread = float(np.log(self.study.sigma_um).sum())
        return -0.5 * self.fit.objective - spread - self.log_scale + self.log_size()

    @cached_property
    def excess_of_parts(self) -> np.ndarray:
        """(E,) what is off beyond the noise on each part, each reading by 10 at most.

        In squares over the noise and per reading of the campaign: their sum is ``excess``.
        """
        found = self.study.residuals(self.fit.predicted_um)
        square = np.minimum((found.residual_um / found.sigma_um) ** 2, 100.0) - 1.0
        return np.bincount(self.study.campaign.experiment_of, square) / len(square)

    @property
    def excess(self) -> float:
        """Mean square over the noise of what is off beyond it, each reading by 10 at most."""
        return float(self.excess_of_parts.sum())

    def bears(self, some: Sequence[int]) -> bool:
        """Whether enough of what is off is on these parts for them to be the wrong ones."""
        return float(self.excess_of_parts[[*some]].sum()) > LEAST_BORNE * max(self.excess, 0.0)

    def log_size(self, factor: float = 1.0) -> float:
        """Logarithm of the prior density of a film and a K1 as large as these over a factor."""
        campaign = self.study.campaign
        targets_um = [campaign.target_of(part)[0] for part in campaign.experiments]
        target_um = float(np.mean(targets_um)) if all(targets_um) else 0.0
        # Film of the trade [um], or near its target: median, standard deviation of the logarithm.
        usual, spread = (target_um, 0.35) if target_um else (35.0, 0.7)
        film = abs(np.log(self.study.measured_um.mean() / factor / usual)) / spread
        # K1 of the trade [cm3/s]: 50 to 800 ml/min, 15 to 60 % of it solids, of which 60 to 90 %
        # arrive.
        usual, spread = 1.0, 0.65
        if self.of_this_gun:
            usual, spread = _k1(self.start), 0.4
        # Further off than so many standard deviations a fit has gone astray.
        k1 = min(abs(np.log(_k1(self.fit.model) / factor / usual)) / spread, 5.0)
        return -0.5 * (film**2 + k1**2) - float(np.log(spread))


def _k1(model: DepositionModel) -> float:
    """Geometric mean of the K1 of all brushes [cm3/s]."""
    return float(np.exp(np.mean([np.log(p.K1_cm3_per_s) for p in model.patterns])))


def fitted_points(study: Study, fit: Fit) -> FittedPoints:
    """The points of a study beside a fit; pattern and nuisance are free around it."""
    free = np.hstack([fit.jacobian @ fit.parameters.prior.factor, study.nuisance])
    return FittedPoints(
        fit.residual * study.sigma_um, fit.predicted_um, study.gauge_um,
        free * study.sigma_um[:, np.newaxis], study.campaign.experiment_of,
        study.campaign.positions_m, study.covariates(fit.model),
    )  # fmt: skip


def find_mistakes(study: Study, fit: Fit, start: DepositionModel) -> tuple[Mistake, ...]:
    """What is simply wrong with the data, the most certain first.

    Args:
        fit: of the start's parameters to the readings as given.
        start: the model as given, or that of the 50 mm bell.
    """
    is_given = any(pattern != PlanarPattern() for pattern in start.patterns)
    as_given = Weighed(study, fit, start, is_given)
    found: list[Mistake] = []
    while len(found) <= len(study.campaign.experiments):
        ways = list(_ways_meant(as_given))
        count = Counter(way.kind for way in ways)
        # Where the model is off anyway, a rough likelihood is worth so much less.
        least = WORTH_WEIGHING * max(1.0 + as_given.excess, 1.0)
        least += as_given.rough_log_weight
        # In the right place little is left of what was off: no effect is so by chance.
        worth = [
            (np.log(PRIOR_PROBABILITY[way.kind] / count[way.kind]) + meant.log_weight, way, meant)
            for way, meant in ((way, as_given.meant(way)) for way in ways)
            if meant.rough_log_weight > least
            and (way.kind not in PLACES or meant.excess < 0.25 * as_given.excess)
        ]
        if not worth:
            break
        best = max(log_weight for log_weight, *_ in worth)
        # Of those that are alike, as on a part that is symmetric one way, the simplest.
        _, way, meant = next(one for one in worth if one[0] > best - 2.0)
        if as_given.log_weight > best - LEAST_LOG_ODDS:
            break
        if way.kind in PLACES and as_given.displaced.log_weight > best - LEAST_LOG_ODDS:
            break
        found.append((_sentence(way, as_given, meant), way.of_this_gun))
        as_given = meant
    return tuple(found)


def _sentence(way: Meant, given: Weighed, meant: Weighed) -> str:
    if way.kind in PLACES:
        off = (one.study.residuals(one.fit.predicted_um).rmse_um for one in (given, meant))
        why = 'the fitted model is off by {:.3g} µm, corrected by {:.3g} µm'.format(*off)
    elif way.of_this_gun:
        sizes = (
            f'{one.study.measured_um.mean():.3g} µm and K1 = {_k1(one.fit.model):.3g} cm³/s'
            for one in (given, meant)
        )
        why = 'as given they mean a film of {}, corrected of {}'.format(*sizes)
    else:
        ratio = _k1(given.fit.model) / _k1(given.start)
        why = f'the K1 of the readings is {ratio:.2g} times its own'
    return f'{way.finding}: {why}; {way.remedy}'


def _ways_meant(given: Weighed) -> Iterator[Meant]:
    """All ways that the geometry of the parts and the size of the film allow."""
    campaign = given.study.campaign
    parts = campaign.experiments
    every = tuple(range(len(parts)))
    for some in dict.fromkeys([every, *((k,) for k in every)]):
        if given.bears(some):
            yield from _mirrored(campaign, some)
        yield from _in_another_unit(given, some)
    # The level of a part for which something was switched off is not known: it may be any.
    known = [k for k in every if not parts[k].switched_off]
    for pair in combinations(known, 2):
        if not given.bears(pair):
            continue
        one, other = (parts[k] for k in pair)
        with suppress(ReadingsError):
            changed = {
                one.name: one.with_readings(other.readings),
                other.name: other.with_readings(one.readings),
            }
            yield Meant(
                'exchanged',
                f'the readings of {one.name} and {other.name} look exchanged',
                f'pair them the other way round in the campaign ({other.readings.source} with '
                f'{one.name})',
                _with_parts(campaign, changed),
            )
    if given.of_this_gun:
        yield Meant(
            'gun',
            "the model looks like another gun's, or like one for another flow",
            'give the model of this gun, or calibrate it',
            campaign,
            of_this_gun=False,
        )


def _with_parts(campaign: Campaign, changed: Mapping[str, Experiment]) -> Campaign:
    parts = tuple(changed.get(part.name, part) for part in campaign.experiments)
    return replace(campaign, experiments=parts)


def _named(campaign: Campaign, some: Sequence[int]) -> str:
    every = len(some) == len(campaign.experiments)
    return 'the readings' if every else f'the readings of {campaign.experiments[some[0]].name}'


def _mirrored(campaign: Campaign, some: Sequence[int]) -> Iterator[Meant]:
    """The readings of some parts mirrored about the middle of each, if the part is there, too."""
    for finding, (across, down) in MIRRORED.items():
        changed: dict[str, Experiment] = {}
        for part in (campaign.experiments[k] for k in some):
            surface = part.surface
            axes = across * [across_axis(surface.outward, surface.down)]
            axes += down * [downhill_axis(surface.outward, surface.down)]
            mirror = np.eye(3) - 2.0 * sum(np.outer(axis, axis) for axis in axes)
            centre_m = box_centre_m(surface.vertices_m)
            places_m = centre_m + (part.readings.positions_m - centre_m) @ mirror
            # A part that is not symmetric has them elsewhere along the line of sight.
            off = surface.locate(places_m)[2] > MAX_DISTANCE_M
            before_m, hit = on_face_m(surface, from_edges_m(surface, places_m))
            places_m = np.where((off & hit)[:, np.newaxis], before_m, places_m)
            readings = replace(part.readings, positions_m=places_m, normals=None)
            with suppress(ReadingsError):
                changed[part.name] = part.with_readings(readings)
        if len(changed) == len(some):
            named = f'{_named(campaign, some)} look {finding}'
            x, y, z = centre_m + 0.0
            alone = len(some) == 1
            middle = f'the part at ({x:.3f}, {y:.3f}, {z:.3f}) m' if alone else 'each part'
            remedy = (
                'take positions and mesh of the same hand, left or right: these fit when mirrored '
                f'about the middle of {middle}'
            )
            yield Meant('mirrored', named, remedy, _with_parts(campaign, changed))


def _in_another_unit(given: Weighed, some: Sequence[int]) -> Iterator[Meant]:
    """The readings of some parts in other units, as far as they are odd as they are."""
    study, campaign = given.study, given.study.campaign
    own = np.isin(campaign.experiment_of, some)
    weights = np.bincount(campaign.experiment_of, study.measured_um)
    over = weights / np.bincount(campaign.experiment_of, given.fit.predicted_um)
    # One part is in another unit than the others only if the model is off on them by such factors.
    if not own.all() and np.ptp(np.log(over)) < np.log(2.5):
        return
    for factor, (words, remedy) in FACTORS.items():
        if own.all() and given.log_size(factor) - given.log_size() < WORTH_WEIGHING:
            continue
        changed: dict[str, Experiment] = {}
        for part in (campaign.experiments[k] for k in some):
            film = part.readings
            scaled = replace(film, thickness_um=film.thickness_um / factor,
                             sigma_um=film.sigma_um / factor)  # fmt: skip
            with suppress(ReadingsError):
                check_unit(scaled)
                changed[part.name] = part.with_readings(scaled)
        if len(changed) == len(some):
            log_scale = float(np.log(factor)) * np.count_nonzero(own)
            named = f'{_named(campaign, some)} look {words}'
            yield Meant('unit', named, remedy, _with_parts(campaign, changed), log_scale)

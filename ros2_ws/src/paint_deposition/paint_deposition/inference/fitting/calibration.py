"""The pattern from painted parts, section 4.1 of Conner et al. (IROS 2002).

On a panel the three Gaussians of eq. (3) are fitted first; the greater offset radius and the
greatest standard deviation start the fit of the 2D model, which goes through the same simulation
as every film, so that door and panel alike can be in a campaign.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import ReadingsError
from paint_deposition.film.spray_geometry import SprayGeometry
from paint_deposition.film.statistics import efficiency, impossible_brushes
from paint_deposition.inference.fitting.cleaning import clean_and_fit
from paint_deposition.inference.fitting.estimates import (
    DiscrepancyFigures,
    Estimate,
    correlations,
    estimates,
)
from paint_deposition.inference.fitting.least_squares import Fit, on_one_thread
from paint_deposition.inference.fitting.panel import (
    Panel,
    check_panel,
    fit_collapse,
    shifts,
    short_reaches,
)
from paint_deposition.inference.fitting.parameters import FreeParameters, Posterior
from paint_deposition.inference.fitting.posterior import (
    posterior_of,
    with_brushes_of,
    with_mean_level,
)
from paint_deposition.inference.fitting.study import Study
from paint_deposition.inference.readings.campaign import Campaign
from paint_deposition.inference.readings.plausibility import (
    FEWEST_POINTS,
    check_readings,
    check_units_against_fit,
    geometry_by_experiment,
)
from paint_deposition.inference.readings.readings import Residuals
from paint_deposition.model.eq3_collapse import ThreeGaussianCollapse

# Residuals beyond this many standard deviations are named in a warning.
OUTLIER_SIGMAS = 4.0
# Above this chi-square per degree of freedom the gauge's noise does not explain the residuals.
MOST_CHI_SQUARE = 2.0


@dataclass(frozen=True)
class Calibration:
    """A model fitted to a campaign, and how well it is known.

    Attributes:
        study: the campaign, ready for inference. fit: the fit of all parameters.
        parameters: of the pattern and of varied effects, with uncertainties.
        correlations: of pairs, strongest first.
        panels: of each experiment where its points lie and eq. (3) fitted to them, None where it
            is no flat panel.
        warnings: a sentence each.
        discrepancy: what no pattern explains; None until it is estimated.
        shifts: (n, k) of the fit's vector without the readings at the ends of panels that do not
            reach the pattern's edges; they widen the uncertainties.
    """

    study: Study
    fit: Fit
    parameters: tuple[Estimate, ...]
    correlations: dict[tuple[str, str], float]
    residuals: tuple[Residuals, ...]
    panels: tuple[tuple[Panel, ThreeGaussianCollapse] | None, ...]
    warnings: tuple[str, ...]
    shifts: np.ndarray
    discrepancy: DiscrepancyFigures | None = None

    def __repr__(self) -> str:
        known = sum(value.determined for value in self.parameters)
        return (
            f'Calibration({len(self.study)} points, {known} of {len(self.parameters)} parameters '
            f'determined, chi2 per degree of freedom {self.chi_square_per_freedom:.2f})'
        )

    def to_dict(self) -> dict[str, Any]:
        """The content of ``calibration.json``."""
        study, names = self.study, ('value', 'sigma', 'low', 'high', 'determined')
        return {
            'parameters': {
                value.name: {name: getattr(value, name) for name in names}
                for value in self.parameters
            },
            'correlations': [
                {'parameters': list(pair), 'value': value}
                for pair, value in [*self.correlations.items()][:10]
            ],
            'experiments': [
                {
                    'experiment': experiment.name,
                    'points': len(own),
                    'measured_mean_um': float(own.measured_um.mean()),
                    'predicted_mean_um': float(own.predicted_um.mean()),
                    'residual_sd_um': own.sd_um,
                    'rmse_um': own.rmse_um,
                }
                for experiment, own in zip(study.campaign.experiments, self.residuals, strict=True)
            ],
            'collapse': [
                fitted and fitted[0].figures(fitted[1], own.measured_um)
                for fitted, own in zip(self.panels, self.residuals, strict=True)
            ],
            'brushes': brush_figures(self.model, self.parameters),
            'points': len(study),
            'readings': len(study.campaign.readings),
            'chi_square_per_degree_of_freedom': self.chi_square_per_freedom,
            'converged': self.fit.converged,
            'noise': study.noise_figures,
            'left_out': [outlier.to_dict() for outlier in study.outliers],
            'geometry': {name: found.to_dict() for name, found in self.geometry.items()},
            'footprint': self.discrepancy and self.discrepancy.footprint,
            'warnings': list(self.warnings),
        }

    @cached_property
    def geometry(self) -> dict[str, SprayGeometry]:
        """How the gun ran over each part, by experiment."""
        return geometry_by_experiment(self.study.campaign, self.model)

    @property
    def model(self) -> DepositionModel:
        """The calibrated model."""
        return self.fit.model

    @property
    def posterior(self) -> Posterior:
        """What is known of the model's parameters: a prior for other jobs."""
        return posterior_of(self.fit, self.study.campaign, self.discrepancy, self.shifts)

    @property
    def chi_square_per_freedom(self) -> float:
        """About 1 where only the gauge's noise is left."""
        return self.fit.marginal.chi_square_per_freedom

    @property
    def is_incomplete(self) -> bool:
        """Whether more is left than noise: something is missing from the model."""
        return self.chi_square_per_freedom > MOST_CHI_SQUARE


@on_one_thread
def calibrate(
    campaign: Campaign,
    start: DepositionModel | None = None,
    seed: int = 0,
    progress: Callable[[str], None] = lambda line: None,
) -> Calibration:
    """Fit the pattern, and the amplitudes of the start's effects, to all readings.

    Args:
        start: fixes projection and effects and is a first guess of the pattern; default: a 50 mm
            bell, whose pattern is then guessed from the first panel.

    Raises:
        ReadingsError: the readings are not plausible, or determine nothing.
    """
    model = with_brushes_of(campaign, start or DepositionModel())
    study = Study.of(campaign, model.effects)
    if len(study) < FEWEST_POINTS:
        raise ReadingsError(
            f'readings at {len(study)} points; the pattern has 7 parameters, measure at least '
            f'{FEWEST_POINTS} points, better 30'
        )
    owner = study.campaign.experiment_of[study.campaign.readings.owner]
    for number, experiment in enumerate(study.campaign.experiments):
        check_readings(experiment.readings, study.noise.sigma_um[owner == number])
    progress('looking for outliers among the readings')
    study, _ = clean_and_fit(campaign, model, model.effects, seed=seed)
    progress('fitting the collapse of the panels')
    panels = tuple(_panel_fit(study, number) for number in range(len(campaign.experiments)))
    progress('fitting the pattern')

    found = [panel for panel in panels if panel]
    starts = [_guessed(model, found)] if found else []
    if start is not None or not found:
        starts.append(model)

    def best_fit(study: Study) -> Fit:
        fits = (
            study.fit(FreeParameters.of(one, *one.effects), 8, seed, study.nuisance)
            for one in starts
        )
        return min(fits, key=lambda fit: fit.objective)

    fit = best_fit(study)
    short = short_reaches(study.campaign, fit.model)
    moved = shifts(study, fit, short, best_fit)
    off = with_mean_level(fit, study.campaign, moved)
    values, pairs = estimates(fit, off), correlations(fit, off)
    widened = 'the intervals are widened by what the fit changes without the readings at the ends'
    warnings = [*_warnings(study, fit, values, pairs), *impossible_brushes(fit.model)]
    warnings += [f'{reach}; {widened}' for reach in short.values()]
    residuals = study.residuals_by_experiment(fit.predicted_um)
    return Calibration(study, fit, values, pairs, residuals, panels, tuple(warnings), moved)


def _panel_fit(study: Study, number: int) -> tuple[Panel, ThreeGaussianCollapse] | None:
    experiment = study.campaign.experiments[number]
    panel = Panel.of(experiment)
    if panel is None:
        return None
    rows = study.campaign.experiment_of == number
    measured, sigma = study.measured_um[rows], study.sigma_um[rows]
    check_panel(experiment.readings, panel, measured, sigma)
    collapse = fit_collapse(panel, measured, sigma)
    check_units_against_fit(experiment.readings, measured, panel.film_um(collapse))
    return panel, collapse


def _guessed(
    model: DepositionModel, panels: Sequence[tuple[Panel, ThreeGaussianCollapse]]
) -> DepositionModel:
    """First values of each pattern from the first panel of its brush, as in the paper.

    The greater offset radius is the ring's, the greatest standard deviation that of both
    Gaussians; lengths are taken back from the panel's distance to the model plane. K1 is put
    right by the fit.
    """
    patterns, projection = list(model.patterns), model.projection
    for panel, collapse in reversed(panels):
        shrink = projection.model_plane_m / (panel.distance_m + projection.emission_offset_m)
        sigma = float(np.clip(collapse.sigmas_m.max() * shrink, 0.01, 0.8))
        r = float(np.clip(max(collapse.r1_m, collapse.r2_m) * shrink, 0.0, 0.9))
        lengths = {'r_m': r, 'sigma1_m': sigma, 'sigma2_m': sigma}
        row = int(model.pattern_rows(np.array([panel.brush]))[0])
        patterns[row] = model.painting_with(panel.brush).planar.model_copy(update=lengths)
    return model.with_patterns(patterns)


def _warnings(
    study: Study, fit: Fit, values: tuple[Estimate, ...], pairs: dict[tuple[str, str], float]
) -> list[str]:
    warnings = list(study.left_out)
    warnings += [] if fit.converged else ['the fit did not converge: its values are not final']
    squares = fit.marginal.chi_square_per_freedom
    away = np.abs(study.residuals(fit.predicted_um).residual_um) / study.sigma_um
    far = np.flatnonzero(away > OUTLIER_SIGMAS)
    if squares > MOST_CHI_SQUARE:
        warnings.append(
            f'residuals are {np.sqrt(squares):.1f} times the noise of the gauge: something is '
            'missing from the model; find it with paint diagnose, and plan with its model'
        )
    elif len(far):
        campaign, worst = study.campaign, np.argmax(away)
        label = campaign.readings.point[campaign.readings.first[worst]]
        warnings.append(
            f'{len(far)} of {len(study)} points are off by more than {OUTLIER_SIGMAS:g} standard '
            f"deviations, most of all point '{label}': measure there again"
        )
    warnings += [
        f'{value.name} is not determined by these readings: {value.reason}'
        for value in values
        if not value.determined
    ]
    warnings += [
        f'{first} and {second} can hardly be separated (correlation {value:+.2f}): trust their '
        'combination, not each'
        for (first, second), value in pairs.items()
        if abs(value) > 0.95
    ]
    if study.noise.source == 'assumed':
        warnings.append(
            f'the noise of the gauge is assumed ({study.noise.typical_um:.2f} µm): repeat some '
            'readings to know it'
        )
    return warnings


def brush_figures(model: DepositionModel, parameters: Sequence[Estimate]) -> dict[str, Any] | None:
    """Set-points and transfer efficiency of each brush.

    None without brushes. The efficiency is that on a part which catches everything.
    """
    if not model.brushes:
        return None
    several = len(model.brushes) > 1
    relative = {value.name: value.sigma / value.value for value in parameters if value.value}
    by_number: dict[str, Any] = {}
    for brush in model.brushes:
        share = efficiency(brush)
        name = f'brush_{brush.number}.K1_cm3_per_s' if several else 'K1_cm3_per_s'
        known = not math.isnan(share)
        by_number[str(brush.number)] = {
            **brush.model_dump(exclude={'number', 'planar'}, exclude_none=True),
            'transfer_efficiency': share if known else None,
            'transfer_efficiency_sigma': share * relative[name] if known else None,
        }
    return {'by_number': by_number}

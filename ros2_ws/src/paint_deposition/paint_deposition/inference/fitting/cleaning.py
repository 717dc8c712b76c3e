"""The readings of a campaign that inference rests on: without outliers, with the film's texture.

Comparison, diagnosis and calibration all take their readings from here. Scans and other readings
by the thousand are condensed to the means of small cells. A few hundred show all that is wider
than a cell, and the film of a pass is. What is averaged is how far the readings are off a roughly
fitted model, so that the bend of the film within a cell does not count. Within a cell they scatter
by the gauge's noise and the film's finest texture: that is how well its mean is known. What is
coarser than a cell is not averaged out.
"""

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from paint_deposition.effects.base import Effect
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import ReadingsError
from paint_deposition.inference.fitting.forward import Forward
from paint_deposition.inference.fitting.least_squares import Fit, on_one_thread
from paint_deposition.inference.fitting.mistaken_data import find_mistakes, fitted_points
from paint_deposition.inference.fitting.outliers import (
    FEWEST_POINTS,
    FittedPoints,
    Outlier,
    find_outliers,
)
from paint_deposition.inference.fitting.parameters import FreeParameters, Posterior
from paint_deposition.inference.fitting.study import TEXTURE_SHARE, Study
from paint_deposition.inference.readings.campaign import Campaign, Experiment
from paint_deposition.inference.readings.readings import Readings

# Starts of the fit from which outliers are found.
STARTS = 3


@on_one_thread
def clean_and_fit(
    campaign: Campaign,
    start: DepositionModel,
    effects: tuple[Effect, ...] = (),
    starts: int = STARTS,
    seed: int = 0,
    known: Posterior | None = None,
    sound: Collection[str] = (),
) -> tuple[Study, Fit]:
    """A campaign prepared for inference without its outliers, and the pattern fitted to it.

    Readings by the thousand are condensed first, see ``condensing``.

    Args:
        start: first guess of the pattern; its effects are refitted, too.
        effects: those whose amplitudes may be varied later.
        sound: labels of points whose readings are no outliers.

    Raises:
        ReadingsError: readings in another unit, with the remedy.
    """
    if len(campaign) > 500:
        rough = _fitted(Study.of(thinned(campaign, seed), effects), start, starts, seed, known)
        campaign, start, starts = condensed(campaign, rough.model), rough.model, 1
    study = Study.of(campaign, effects)
    fit = _fitted(study, start, starts, seed, known)
    if not fit.predicted_um.any():
        return study, fit
    if len(study) >= FEWEST_POINTS:
        study, fit = _cleaned(study, fit, start, starts, seed, known, sound)
    return replace(study, mistakes=find_mistakes(study, fit, start)), fit


def _cleaned(
    study: Study, fit: Fit, start: DepositionModel, starts: int, seed: int,
    known: Posterior | None, sound: Collection[str],
) -> tuple[Study, Fit]:  # fmt: skip
    """The study without outliers, with the film's texture and what facets cost."""
    misfit = fitted_points(study, fit)
    if found := _outliers(study, fit, misfit, sound):
        kept = ~np.isin(np.arange(len(study)), list(found))
        study = replace(study.of_points(kept), outliers=tuple(found.values()))
        fit = _fitted(study, start, starts, seed, known)
        misfit = fitted_points(study, fit)
    # The texture is estimated where the gauge's noise is known. Only one finer than usual is
    # accepted: a coarser one looks like anything that is missing from the model and narrower than
    # the distance between readings.
    if study.noise.source != 'assumed':
        share = misfit.texture_share
        if share < TEXTURE_SHARE:
            study = replace(study, estimated_texture=share)
            fit = _fitted(study, fit.model, 1, seed, known)
    faceted = study.with_facets(fit.model)
    if faceted is not study:
        return faceted, _fitted(faceted, fit.model, 1, seed, known)
    return study, fit


def _fitted(
    study: Study, start: DepositionModel, starts: int, seed: int, known: Posterior | None
) -> Fit:
    parameters = FreeParameters.of(start, *start.effects, known=known)
    return study.fit(parameters, starts, seed, study.nuisance)


def _outliers(
    study: Study, fit: Fit, misfit: FittedPoints, sound: Collection[str]
) -> dict[int, Outlier]:
    readings = study.campaign.readings
    label = readings.point[readings.first]
    film, open_to_doubt = study.measured_um, readings.repeats == 1
    open_to_doubt &= ~np.isin(label, list(sound))
    return {
        row: Outlier(
            str(label[row]), float(film[row]), float(fit.predicted_um[row] + residual_um),
            sigma_um, *(() if other is None else (str(label[other]), float(film[other]))),
        )
        for row, (residual_um, sigma_um, other) in
        find_outliers(misfit, open_to_doubt).items()
    }  # fmt: skip


# Cells that readings by the thousand are condensed to.
CELLS = 300


def cells_by_part(points: Sequence[int]) -> list[int]:
    """How many cells each part gets of all, by its number of points: none more than another needs.

    A part with fewer points than an even share keeps them all; what it leaves goes to the others.
    """
    cells, left = [0] * len(points), CELLS
    in_order = sorted(range(len(points)), key=points.__getitem__)
    for done, part in enumerate(in_order):
        cells[part] = min(points[part], max(left // (len(points) - done), 1))
        left -= cells[part]
    return cells


def thinned(campaign: Campaign, seed: int) -> Campaign:
    """The campaign with as many points of each part as it may have cells."""
    random, parts = np.random.default_rng(seed), campaign.experiments
    kept = [
        np.isin(part.readings.owner, random.choice(len(part), cells, replace=False))
        for part, cells in zip(parts, cells_by_part([*map(len, parts)]), strict=True)
    ]
    return campaign.without(~np.concatenate(kept))


def condensed(campaign: Campaign, model: DepositionModel) -> Campaign:
    """The campaign with cells for points, in parts with more points than cells.

    Args:
        campaign: with many points.
        model: roughly fitted to it.

    Raises:
        ReadingsError: readings so far apart that they do not show how they scatter.
    """
    predicted_um = Forward(campaign, model.effects).predict_um(model)[campaign.readings.owner]
    off_um = campaign.readings.thickness_um - predicted_um
    owner = campaign.experiment_of[campaign.readings.owner]
    shares = cells_by_part([*map(len, campaign.experiments)])
    parts = []
    for k, (part, most) in enumerate(zip(campaign.experiments, shares, strict=True)):
        if most == len(part):
            parts.append(part)
            continue
        cells = _in_cells(part, off_um[owner == k], most)
        film_um = Forward(Campaign((cells,)), model.effects).predict_um(model)
        taken = replace(cells.readings, thickness_um=film_um + cells.readings.thickness_um)
        parts.append(cells.with_readings(taken))
    return replace(campaign, experiments=tuple(parts), scan=campaign)


def _in_cells(part: Experiment, off_um: np.ndarray, most: int) -> Experiment:
    """A part with so many cells at the most, and (N,) how far readings are off as the film."""
    readings, points = part.readings, part.measured_points
    kind = np.unique([readings.session, readings.group], axis=1, return_inverse=True)[1].ravel()
    place_m, normals = (v[part.readings.owner] for v in (points.positions_m, points.normals))
    cell = _cells(place_m, kind, most)
    count, first = np.bincount(cell), np.unique(cell, return_index=True)[1]

    def mean(values: np.ndarray) -> np.ndarray:
        return np.stack([np.bincount(cell, v) / count for v in values.T], axis=-1)

    # The scatter is estimated about planes through so many neighbours on average.
    near = _cells(place_m, kind, max(len(readings) // 12, 1))
    stated_um = np.nan_to_num(readings.sigma_um)
    noise_um = max(_scatter_um(place_m, off_um, near), float(np.sqrt(np.mean(stated_um**2))))
    if noise_um == 0.0:
        raise ReadingsError(
            f'{readings.source}: {len(readings)} readings lie too far apart to show the noise of '
            'the gauge; state it in a column sigma_um'
        )
    understood = (
        f'{readings.understood or readings.source}; {len(readings)} readings in {len(count)} '
        f'cells, each off its neighbours by {noise_um:.2f} µm'
    )
    names = np.array([f'cell {k + 1}' for k in range(len(count))])
    return part.with_readings(Readings(
        mean(place_m), np.bincount(cell, off_um) / count, names, readings.group[first],
        noise_um / np.sqrt(count), mean(normals), readings.source, readings.session[first],
        understood, layer=readings.layer[first],
    ))  # fmt: skip


def _cells(place_m: np.ndarray, kind: np.ndarray, most: int) -> np.ndarray:
    """(N,) cell of each reading: cubes, of one kind (N,) each, as small as their number allows."""

    def numbered(edge_m: float) -> np.ndarray:
        boxes = np.floor((place_m - place_m.min(axis=0)) / edge_m).astype(np.int64)
        keys = np.column_stack([boxes, kind])
        return np.unique(keys, axis=0, return_inverse=True)[1].ravel()

    small, large = 1e-5, 2.0 * float(np.ptp(place_m, axis=0).max()) + 1e-3
    for _ in range(30):
        edge_m = float(np.sqrt(small * large))
        small, large = (edge_m, large) if numbered(edge_m).max() >= most else (small, edge_m)
    return numbered(large)


def _scatter_um(place_m: np.ndarray, off_um: np.ndarray, near: np.ndarray) -> float:
    """Standard deviation about planes through neighbours (N,), pooled; 0 if none shows it."""
    squares, freedom = 0.0, 0
    order = np.argsort(near, kind='stable')
    for rows in np.split(order, np.cumsum(np.bincount(near))[:-1]):
        if len(rows) < 5:
            continue
        design = np.column_stack([np.ones(len(rows)), place_m[rows] - place_m[rows].mean(axis=0)])
        amounts, _, rank, _ = np.linalg.lstsq(design, off_um[rows], rcond=1e-6)
        left = off_um[rows] - design @ amounts
        squares, freedom = squares + float(left @ left), freedom + len(rows) - int(rank)
    return float(np.sqrt(squares / freedom)) if freedom else 0.0

"""Fitted models on disk: numbers that a person can read, and the same film."""

import re
from pathlib import Path

import numpy as np
import pytest

import paint_deposition as pd
from paint_deposition.effects.library.air_drift import AirDrift
from paint_deposition.film.integrator import FilmIntegrator
from paint_deposition.inference.diagnosis.refit import refit
from paint_deposition.model.eq2_projection import Projection
from paint_deposition.report.writers.inference import write_fitted
from small_campaign import small_campaign

pytestmark = pytest.mark.slow

BY_HAND = 0.3012345678901234


@pytest.fixture(scope='module')
def fitted(tmp_path_factory):
    campaign = small_campaign(tmp_path_factory.mktemp('campaign'))
    start = pd.DepositionModel(projection=Projection(model_plane_m=BY_HAND))
    return refit(campaign, start, AirDrift)


@pytest.fixture(scope='module')
def file(tmp_path_factory, fitted) -> Path:
    path = tmp_path_factory.mktemp('model') / 'model.yaml'
    write_fitted(path, fitted.study, fitted.history)
    return path


def test_fitted_numbers_have_few_digits_and_those_by_hand_all_of_theirs(file: Path):
    numbers = re.findall(r': (-?[\d.]+)(?:e[+-]?\d+)?\b', file.read_text())
    assert len(numbers) > 10
    long = [n for n in numbers if len(n.lstrip('-0.').replace('.', '')) > 8]
    assert long == [str(BY_HAND)]


def test_the_file_gives_the_fitted_film(file: Path, fitted):
    experiment = fitted.study.campaign.experiments[1]

    def film_um(model: pd.DepositionModel) -> np.ndarray:
        surface = experiment.surface
        integrator = FilmIntegrator(surface.points(), model, 'double', surface.occluder)
        integrator.add(experiment.path)
        return integrator.gauge_um

    expected = film_um(fitted.model)
    assert np.abs(film_um(pd.read_model(file)) - expected).max() < 1e-6 * expected.max()

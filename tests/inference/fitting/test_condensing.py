"""Scans are condensed to the means of small cells, and the user is told."""

import numpy as np
import pytest

from inference.fitting.panels import ORDERS, painted_by, passes
from paint_deposition.api.inference import compare
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.inference.fitting.condensing import CELLS, condensed
from paint_deposition.inference.fitting.forward import Forward
from paint_deposition.inference.readings.campaign import Campaign
from paint_deposition.report.words import count_words

MODEL, NOISE_UM, SCANNED = DepositionModel(), 0.4, 6000


@pytest.fixture(scope='module')
def scan() -> Campaign:
    """A panel read at random places, denser than any cell."""
    places = np.random.default_rng(5).uniform((-0.35, 0.05), (0.35, 1.95), (SCANNED, 2))
    points_m = np.column_stack([places[:, 0], np.zeros(SCANNED), places[:, 1]])
    motion = passes(ORDERS[0], samples=80)
    return Campaign((painted_by(MODEL, motion, points_m, noise_um=NOISE_UM, repeats=1),))


def test_the_mean_of_a_cell_is_the_film_at_its_middle_within_the_noise_of_a_mean(scan):
    # Off by a tenth of the film, as a rough fit may be.
    planar = MODEL.planar.model_copy(update={'K1_cm3_per_s': 1.1 * MODEL.planar.K1_cm3_per_s})
    rough = MODEL.model_copy(update={'planar': planar})
    cells = condensed(scan, rough)
    assert 0.8 * CELLS < len(cells) <= CELLS
    sigma_um = cells.readings.sigma_um
    each = SCANNED / len(cells)
    assert np.median(sigma_um) == pytest.approx(NOISE_UM / np.sqrt(each), rel=0.1)
    off_um = cells.means.mean_um - Forward(cells, ()).predict_um(MODEL)
    # Chi-square of that many cells: within five of its standard deviations.
    assert np.sum((off_um / sigma_um) ** 2) / len(cells) == pytest.approx(
        1.0, abs=5.0 * np.sqrt(2.0 / len(cells))
    )


def test_what_became_of_a_scan_is_said(scan):
    study = compare(scan, MODEL).study
    told = f'{SCANNED} readings were condensed to the means of {len(study)} cells'
    assert any(note.startswith(told) for note in study.notes)
    assert count_words(study) == f'{SCANNED} readings in {len(study)} cells on panel'

"""Scans are condensed to the means of small cells, and the user is told."""

from dataclasses import replace

import numpy as np
import pytest

from inference.fitting.panels import ORDERS, column, painted_by, passes
from paint_deposition.api.inference import compare
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.inference.fitting.cleaning import CELLS, cells_by_part, condensed
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


def test_a_few_readings_by_hand_beside_a_scan_are_kept_and_what_became_of_it_is_said(scan):
    motion = passes(ORDERS[1], samples=80)
    hand = replace(painted_by(MODEL, motion, column(), noise_um=NOISE_UM), name='by hand')
    study = compare(Campaign((*scan.experiments, hand)), MODEL).study
    assert np.array_equal(study.campaign.experiments[1].readings.thickness_um,
                          hand.readings.thickness_um)  # fmt: skip
    read = SCANNED + len(hand.readings)
    told = f'{read} readings were condensed to the means of {len(study)} cells'
    assert any(note.startswith(told) for note in study.notes)
    assert count_words(study) == f'{read} readings in {len(study)} cells on panel and by hand'


@pytest.mark.parametrize(
    ('points', 'cells'),
    [((6000,), [300]), ((6000, 40), [260, 40]), ((9000, 20, 500), [140, 20, 140]),
     ([60] * 12, [25] * 12), ([2] * 400, [1] * 400)],
)  # fmt: skip
def test_parts_share_the_cells_evenly(points, cells):
    assert cells_by_part(points) == cells

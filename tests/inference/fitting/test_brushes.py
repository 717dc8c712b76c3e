"""Several brushes in one campaign: each has its pattern, the phase of the asymmetry is shared."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import paint_deposition as pd
from brushes import two_brushes
from inference.fitting.panels import column, painted_by, passes
from paint_deposition.errors import ModelError, ReadingsError
from paint_deposition.files.model_file import ModelFile, read_model_file
from paint_deposition.inference.fitting.calibration import brush_figures
from paint_deposition.inference.fitting.parameters import FreeParameters, Posterior
from paint_deposition.inference.fitting.pattern_vector import PatternVector
from paint_deposition.inference.fitting.posterior import of_brushes, with_brushes_of
from paint_deposition.model.eq1_pattern import PATTERN, Brush, PlanarPattern

PHI_RAD = 0.1
FIRST = PlanarPattern(
    K1_cm3_per_s=1.6, K2=0.25, K3=0.25, phi_rad=PHI_RAD, r_m=0.2, sigma1_m=0.08, sigma2_m=0.14
)
SECOND = PlanarPattern(
    K1_cm3_per_s=0.9, K2=0.4, K3=0.15, phi_rad=PHI_RAD, r_m=0.12, sigma1_m=0.06, sigma2_m=0.09
)
SETTINGS = {
    1: {'flow_cm3_per_min': 300.0, 'solids': 0.45, 'bell_speed_rpm': 40e3},
    4: {'flow_cm3_per_min': 200.0, 'solids': 0.45, 'bell_speed_rpm': 25e3},
}
TRUTH = pd.DepositionModel(
    brushes=[Brush(number=n, planar=p, **SETTINGS[n]) for n, p in ((1, FIRST), (4, SECOND))]
)
VECTOR = PatternVector((1, 4))


def painted(name: str, heights_m, brushes, seed=0):
    """A panel with a pass of each of these brushes, measured as far as they reach."""
    motion = replace(passes(heights_m, samples=300), trigger_brush=np.repeat(brushes, 2))
    reached = column(min(heights_m) - 0.35, max(heights_m) + 0.35, 30)
    return painted_by(TRUTH, motion, reached, name=name, seed=seed)


@pytest.fixture(scope='module')
def campaign():
    return pd.Campaign((
        painted('one', (1.577, 1.0, 0.423), (1, 1, 1)),
        painted('four', (1.3, 1.0, 0.7), (4, 4, 4), seed=1),
        painted('both', (1.3, 0.8), (1, 4), seed=2),
    ))  # fmt: skip


def test_patterns_survive_the_way_there_and_back():
    vector = np.array(VECTOR.encode(TRUTH.patterns))
    assert len(vector) == len(VECTOR) == 13
    again = VECTOR.patterns(VECTOR.values(vector[np.newaxis])[0])
    for found, truth in zip(again, TRUTH.patterns, strict=True):
        assert found.model_dump() == pytest.approx(truth.model_dump(), rel=1e-12)
    assert VECTOR.names[7:9] == ('brush_4.K1_cm3_per_s', 'brush_4.K2')
    assert VECTOR.coordinates[9].name == 'brush_4.log_K3_ratio'


def slopes(function, vector: np.ndarray) -> np.ndarray:
    """(n, len(vector)) numerical derivatives of a function (n,)."""
    steps = 1e-6 * np.eye(len(vector))
    return np.array([(function(vector + s) - function(vector - s)) / 2e-6 for s in steps]).T


@settings(max_examples=30)
@given(st.lists(st.floats(-1.0, 1.0), min_size=13, max_size=13))
def test_the_jacobian_is_that_of_the_coordinates(shifts):
    """Also where the asymmetry is at its bound, K3 = 1."""
    vector = np.array(VECTOR.encode(TRUTH.patterns)) + 0.5 * np.array(shifts)

    def bounded(entries):
        found = VECTOR.of_patterns(entries[np.newaxis])[0]
        size = np.hypot(found[:, 2], found[:, 3])
        found[:, 2:4] /= np.maximum(size, 1.0)[:, np.newaxis]
        return found.ravel()

    size = np.hypot(*VECTOR.of_patterns(vector[np.newaxis])[0][:, 2:4].T)
    if np.any(np.abs(size - 1.0) < 1e-3) or np.any(size < 1e-3):
        return  # a kink, or no phase
    np.testing.assert_allclose(VECTOR.jacobian(vector), slopes(bounded, vector), atol=1e-6)


@pytest.fixture(scope='module')
def calibrated(campaign):
    """From a plain start: nothing says what the brushes are but the recordings."""
    return pd.calibrate(campaign)


@pytest.mark.slow
def test_panels_of_two_brushes_give_both_patterns_and_transfer_efficiencies_back(calibrated):
    assert calibrated.chi_square_per_freedom < 1.5
    by_name = {value.name: value for value in calibrated.parameters}
    shared = calibrated.model.brushes[0].planar.phi_rad
    for brush, truth in zip(calibrated.model.brushes, TRUTH.brushes, strict=True):
        assert brush.number == truth.number
        assert brush.planar.K1_cm3_per_s == pytest.approx(truth.planar.K1_cm3_per_s, rel=0.02)
        assert brush.planar.r_m == pytest.approx(truth.planar.r_m, abs=0.02)
        assert brush.planar.phi_rad == pytest.approx(shared, abs=1e-12)
        for name in ('K1_cm3_per_s', 'r_m', 'sigma1_m'):
            value = by_name[f'brush_{brush.number}.{name}']
            assert abs(value.value - getattr(truth.planar, name)) < 4.0 * value.sigma
    # Three parameters of eq. (3) start each brush from a panel of its own; one has no panel.
    assert [panel is None for panel in calibrated.panels] == [False, False, True]
    settled = [Brush(number=b.number, planar=b.planar, **SETTINGS[b.number])
               for b in calibrated.model.brushes]  # fmt: skip
    told = brush_figures(pd.DepositionModel(brushes=settled), calibrated.parameters)
    for brush in TRUTH.brushes:
        figures = told['by_number'][str(brush.number)]
        share = brush.planar.K1_cm3_per_s * 60.0 / (brush.flow_cm3_per_min * brush.solids)
        assert figures['transfer_efficiency'] == pytest.approx(share, rel=0.02)
        assert 0.0 < figures['transfer_efficiency_sigma'] < 0.02


@pytest.mark.slow
def test_the_written_model_has_all_brushes_that_were_given(calibrated, tmp_path):
    pd.write(calibrated, tmp_path / 'two', start=ModelFile(TRUTH))
    again = read_model_file(tmp_path / 'two/model.yaml')
    assert [b.number for b in again.model.brushes] == [1, 4]
    assert again.posterior is not None
    assert again.uncertainty['brush_4']['r_m'] > 0.0
    # A brush that was not painted with stays as it was given.
    third = Brush(number=7, planar=FIRST, flow_cm3_per_min=250.0, bell_speed_rpm=3e4, solids=0.45)
    start = ModelFile(pd.DepositionModel(brushes=[*TRUTH.brushes, third]))
    files = pd.write(calibrated, tmp_path / 'three', start=start)
    assert json.loads(files[1].read_text())['brushes']['by_number'].keys() == {'1', '4'}
    kept = read_model_file(files[0])
    assert kept.model.brushes[-1] == third
    assert kept.posterior is None


def test_the_start_of_a_campaign_has_its_brushes_and_what_recordings_tell(campaign):
    told = [{'bell_speed_rpm': 4e4, 'voltage_kv': -70.0}, {'bell_speed_rpm': 2e4}, {}]
    experiments = [replace(e, settings=s) for e, s in zip(campaign.experiments, told, strict=True)]
    start = with_brushes_of(pd.Campaign(tuple(experiments)), pd.DepositionModel())
    assert [(b.number, b.bell_speed_rpm, b.voltage_kv) for b in start.brushes] == [
        (1, 4e4, 70.0), (4, 2e4, None)
    ]  # fmt: skip
    assert start.patterns == (pd.DepositionModel().planar,) * 2
    # A campaign of one brush needs of the model that one only.
    of_four = pd.Campaign(campaign.experiments[1:2])
    assert with_brushes_of(of_four, TRUTH).patterns == (SECOND,)
    assert with_brushes_of(of_four, pd.DepositionModel()) == pd.DepositionModel()


def test_brushes_that_are_not_all_named_or_not_in_the_model_are_refused(campaign):
    one, *others = campaign.experiments
    path = one.path.with_(brush=np.zeros(len(one.path), np.int64))
    mixed = pd.Campaign((replace(one, name='silent', path=path), *others))
    with pytest.raises(ReadingsError, match="'silent' names no brush, others name 1, 4: give it"):
        with_brushes_of(mixed, pd.DepositionModel())
    for take in (pd.calibrate, pd.diagnose):
        with pytest.raises(ModelError, match='brush 4 is not in the model; its brushes: 1, 2'):
            take(campaign, two_brushes())
    with pytest.raises(ModelError, match='brushes 1, 4 are used and the model has the pattern of'):
        pd.compare(campaign, pd.DepositionModel())


THREE = PatternVector((1, 4, 7))


@settings(max_examples=30)
@given(
    st.lists(st.floats(-0.5, 0.5), min_size=19, max_size=19),
    st.sampled_from([(1,), (4,), (7,), (1, 7), (4, 7), (1, 4, 7)]),
)
def test_some_brushes_out_of_all_keep_their_patterns(shifts, numbers):
    kept = PatternVector(numbers)
    centre = np.array(THREE.encode([FIRST, SECOND, FIRST]))

    def patterns(vector: PatternVector, entries: np.ndarray) -> np.ndarray:
        return vector.of_patterns(entries[np.newaxis])[0]

    vector = centre + 0.3 * np.array(shifts)
    entries, slope = kept.subset(THREE, vector)
    rows = [THREE.brushes.index(number) for number in numbers]
    np.testing.assert_allclose(patterns(kept, entries), patterns(THREE, vector)[rows], rtol=1e-12)
    found = slopes(lambda at: kept.subset(THREE, at)[0], vector)
    np.testing.assert_allclose(slope, found, atol=1e-8)


def known_of(model: pd.DepositionModel, deviation: float = 0.02) -> Posterior:
    """A calibration of these brushes, each entry known by itself."""
    vector = PatternVector(tuple(brush.number for brush in model.brushes))
    names, mean = [c.name for c in vector.coordinates], np.array(vector.encode(model.patterns))
    return Posterior.of(names, mean, deviation**2 * np.eye(len(names)), readings=('a',))


def spread(known: Posterior, model: pd.DepositionModel, first: str, second: str) -> list[float]:
    """Prior deviations in a job of two coordinates, and of the difference of the two."""
    parameters = FreeParameters.of(model, known=known)
    factor = parameters.prior.factor
    i, j = (parameters.coordinates.index(name) for name in (first, second))
    covariance = factor @ factor.T
    apart = covariance[i, i] + covariance[j, j] - 2.0 * covariance[i, j]
    return np.sqrt([covariance[i, i], covariance[j, j], apart]).tolist()


def test_brushes_change_together_and_a_job_of_one_rests_on_the_calibration_of_all():
    """Level and widths go with the paint and the cup; the brushes' ratio hardly changes."""
    known = of_brushes(known_of(TRUTH), TRUTH, TRUTH)
    one, other, apart = spread(known, TRUTH, 'brush_1.log_K1', 'brush_4.log_K1')
    assert one == other == pytest.approx(np.hypot(0.1, 0.02))
    # The calibration's own uncertainty of each, and a tenth of the variance between jobs.
    assert apart == pytest.approx(np.sqrt(2.0 * (0.02**2 + 0.1 * 0.1**2)))
    # Without a calibration the level is open, and the ratio is known as well as jobs differ.
    known = of_brushes(None, TRUTH, TRUTH)
    one, other, apart = spread(known, TRUTH, 'brush_1.log_K1', 'brush_4.log_K1')
    assert one == other > 2.0
    assert apart == pytest.approx(np.sqrt(2.0 * (0.1**2 + 0.1 * 0.1**2)), rel=1e-6)
    assert of_brushes(None, pd.DepositionModel(), TRUTH) is None
    second = TRUTH.of_numbers({4})
    known = of_brushes(known_of(TRUTH), TRUTH, second)
    assert known.names == tuple(c.name for c in PATTERN)
    assert known.readings == ('a',)
    np.testing.assert_allclose(known.centre, PatternVector((4,)).encode([SECOND]), rtol=1e-12)
    # The size of its asymmetry is told beside the first's: both are uncertain.
    size = np.hypot(known.matrix[2, 2], known.matrix[3, 3])
    ratio = SECOND.K3 / FIRST.K3
    assert size > 0.02**2 * ratio**2
    assert of_brushes(None, TRUTH, second) is None

"""A learned law written as an effect: it loads, is absent at its defaults, and gives its film."""

import numpy as np
import pytest

import paint_deposition as pd
from paint_deposition.effects.catalogue import LEARNED, load_effect_file
from paint_deposition.effects.learned.curves import CURVES
from paint_deposition.film.integrator import FilmIntegrator
from paint_deposition.inference.diagnosis import closed_forms
from paint_deposition.inference.diagnosis.closed_forms import forms_of
from paint_deposition.kernel.laws import Ray
from paint_deposition.report.writers.inference import effect_entry, file_name, write_effect_file
from small_campaign import small_campaign

KNOTS, SD = 12, 0.02
RANGES = {
    'incidence_deg': (0.0, 70.0), 'standoff_ratio': (0.7, 1.6), 'time_s': (0.0, 40.0),
    'spray_pass': (0.0, 7.0), 'stroke_end_m': (0.0, 0.5), 'since_trigger_s': (0.0, 1.0),
    'speed_m_per_s': (0.1, 0.5), 'curvature_per_m': (-4.0, 4.0), 'edge_distance_m': (0.0, 0.25),
    'film_um': (0.0, 60.0), 'across_m': (-0.5, 0.5),
}  # fmt: skip
SHAPES = {
    'rising': lambda u: 0.9 + 0.3 * u,
    'levelling off': lambda u: 1.2 - 0.4 * np.exp(-u / 0.25),
    'stepping': lambda u: 0.8 + 0.4 / (1.0 + np.exp((0.5 - u) / 0.08)),
    'falling as a power': lambda u: (1.0 + u) ** -0.7,
}
# Laws over the ray that are compiled: the second takes the exponential and the logarithm.
IN_KERNEL = {('incidence_deg', 'rising'), ('standoff_ratio', 'falling as a power')}


def learned(covariate: str, shape: str = 'rising', kind: str = 'factor'):
    low, high = RANGES.get(covariate, (0.0, 1.0))
    law = LEARNED[covariate](low=low, high=high, learned=(0.0,) * KNOTS)
    u = (law.knots - law.knots[0]) / np.ptp(law.knots)
    h = SHAPES[shape](u) - 1.0
    scale = 10.0 if kind == 'addition' else 1.0
    return type(law)(
        low=low, high=high, kind=kind, learned=tuple(scale * h), sd=(scale * SD,) * KNOTS
    )


@pytest.fixture(scope='module')
def door(tmp_path_factory):
    folder = tmp_path_factory.mktemp('campaign')
    return small_campaign(folder, experiments=('door',)).experiments[0]


def film_um(experiment, model: pd.DepositionModel) -> np.ndarray:
    """What the gauge shows at the readings."""
    painted = FilmIntegrator(experiment.measured_points, model, 'double', parallel=False)
    painted.add(experiment.path)
    return painted.gauge_um


def factor_at(effect, x: np.ndarray) -> np.ndarray:
    """What a law over the ray makes of the flux where incidence or distance are these."""
    cosine, ratio = (x, x) if effect.family == 'standoff' else (np.cos(np.radians(x)), 1.0 + 0 * x)
    rays = zip(ratio, cosine, strict=True)
    return np.array(
        [effect.flux_factor(Ray(0.1, 0.2, *ray, 0.3), *effect.values()) for ray in rays]
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ('covariate', 'shape', 'kind'),
    [
        *((covariate, 'rising', 'factor') for covariate in CURVES),
        *(('standoff_ratio', shape, 'factor') for shape in SHAPES if shape != 'rising'),
        ('edge_distance_m', 'levelling off', 'addition'),
    ],
)
def test_the_file_loads_and_gives_the_film_of_the_law_within_its_band(
    covariate, shape, kind, door, tmp_path, monkeypatch
):
    """Laws over the ray as functions, each form; the first of some through a kernel as well."""
    if LEARNED[covariate].flux_factor is None:
        # Every form is written over the ray; what differs over other covariates is their value.
        few = {name: closed_forms.FORMS[name] for name in ('constant', 'linear', 'saturating')}
        monkeypatch.setattr(closed_forms, 'FORMS', few)
    law = learned(covariate, shape, kind)
    forms = forms_of(law)
    assert forms
    plain = film_um(door, pd.DepositionModel())
    for number, form in enumerate(forms):
        file = write_effect_file(tmp_path / f'my_law_{number}.py', law, form)
        effect = load_effect_file(file)
        assert effect().is_neutral
        assert film_um(door, pd.DepositionModel(effects=(effect(),))) == pytest.approx(plain)
        entry = effect_entry(form, file.name)
        (tmp_path / 'model.yaml').write_text(f'effects: [{{{entry}}}]\n')
        assert entry in file.read_text().replace('"', '')
        model = pd.read_model(tmp_path / 'model.yaml')
        if law.flux_factor is not None:
            x = np.linspace(law.low, law.high, 200)
            assert np.abs(factor_at(*model.effects, x) - law.factor(x)).max() < 2.0 * SD
        if law.flux_factor is None or (number == 0 and (covariate, shape) in IN_KERNEL):
            wanted = film_um(door, pd.DepositionModel(effects=(law,)))
            band = 2.0 * SD * (10.0 if kind == 'addition' else plain)
            # Rays beyond the range of the readings are few: there the law itself fades to neutral.
            assert np.mean(np.abs(film_um(door, model) - wanted) < band + 0.01) > 0.95


def test_the_name_of_an_effect_of_the_library_is_not_taken(tmp_path):
    law = learned('time_s')
    file = write_effect_file(tmp_path / 'air_drift.py', law, forms_of(law)[0])
    assert load_effect_file(file).id == 'learned_air_drift'


def test_names_of_experiments_become_names_of_files():
    names = {'door': 'door', 'Tür 2/left': 'Tür_2_left', '../..': 'experiment'}
    assert {name: file_name(name) for name in names} == names

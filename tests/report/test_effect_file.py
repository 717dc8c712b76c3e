"""What is written: a learned law as an effect, fitted models, films."""

import json
import math
import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import paint_deposition as pd
import scenes
from paint_deposition.effects import closed_forms
from paint_deposition.effects.catalogue import LEARNED
from paint_deposition.effects.closed_forms import forms_of
from paint_deposition.effects.learned_curves import CURVES
from paint_deposition.effects.library.air_drift import AirDrift
from paint_deposition.files.effect_file import load_effect_file
from paint_deposition.film.statistics import film_statistics
from paint_deposition.inference.diagnosis.refit import refit
from paint_deposition.inference.fitting.estimates import estimates
from paint_deposition.kernel.eq2_flux import Ray
from paint_deposition.model.eq2_projection import Projection
from paint_deposition.report import write_inference
from paint_deposition.report.write import write_film
from paint_deposition.report.write_inference import effect_entry, write_effect_file
from paint_deposition.report.write_plans import gauge_turns
from small_campaign import small_campaign
from surfaces import sheet

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
    values = {'learned': tuple(scale * h), 'sd': (scale * SD,) * KNOTS}
    return type(law)(low=low, high=high, kind=kind, **values)


@pytest.fixture(scope='module')
def door(tmp_path_factory):
    folder = tmp_path_factory.mktemp('campaign')
    return small_campaign(folder, experiments=('door',)).experiments[0]


def film_um(experiment, model: pd.DepositionModel) -> np.ndarray:
    """What the gauge shows at the readings."""
    return scenes.painted(experiment.measured_points, experiment.path, model, 'double').gauge_um


def factor_at(effect, x: np.ndarray) -> np.ndarray:
    """What a law over the ray makes of the flux where incidence or distance are these."""
    cosine, ratio = (x, x) if effect.family == 'standoff' else (np.cos(np.radians(x)), 1.0 + 0 * x)
    rays = (Ray(0.1, 0.2, *ray, 0.3) for ray in zip(ratio, cosine, strict=True))
    return np.array([effect.flux_factor(ray, *effect.values()) for ray in rays])


@pytest.mark.slow
@pytest.mark.parametrize(
    ('covariate', 'shape', 'kind'),
    [
        *((covariate, 'rising', 'factor') for covariate in CURVES),
        *(('standoff_ratio', shape, 'factor') for shape in SHAPES if shape != 'rising'),
        ('edge_distance_m', 'levelling off', 'addition'),
    ],
)
def test_the_file_gives_the_film_of_the_law(covariate, shape, kind, door, tmp_path, monkeypatch):
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


def test_names_of_effects_of_the_library_are_not_taken_and_those_of_parts_are_files(tmp_path):
    law = learned('time_s')
    file = write_effect_file(tmp_path / 'air_drift.py', law, forms_of(law)[0])
    assert load_effect_file(file).id == 'learned_air_drift'
    names = {'door': 'door', 'Tür 2/left': 'Tür_2_left', '../..': 'experiment'}
    assert {name: write_inference.file_name(name) for name in names} == names


def test_figures_of_any_kind_are_written_and_an_older_film_stays_unless_told(tmp_path):
    """Mesh and table are held against each other where `paint simulate` is tried out."""
    surface = sheet(lambda x, z: 0.0 * x)
    film = 50.0 * (surface.vertices_m[:, 0] + 0.5) / 3.0
    stats = film_statistics(film, surface.vertex_areas_m2, 20.0)
    details = {'poses': np.int64(7), 'rate': math.inf}
    *_, figures = write_film(tmp_path / 'new', surface, film, stats, details=details)
    content = json.loads(figures.read_text())
    assert (content['mean_um'], content['poses'], content['rate']) == (stats.mean_um, 7, None)
    csv = write_film(tmp_path, surface, film, stats)[1]
    with pytest.raises(pd.PaintError, match=r'film\.ply is there already'):
        write_film(tmp_path, surface, 2 * film, stats)
    assert np.genfromtxt(csv, delimiter=',', skip_header=1)[:, 3].max() == pytest.approx(50 / 3)
    write_film(tmp_path, surface, 2 * film, stats, overwrite=True)
    assert np.genfromtxt(csv, delimiter=',', skip_header=1)[:, 3].max() == pytest.approx(100 / 3)


BY_HAND = 0.3012345678901234


@pytest.mark.slow
def test_fitted_numbers_have_few_digits_and_give_the_fitted_film(tmp_path):
    start = pd.DepositionModel(projection=Projection(model_plane_m=BY_HAND))
    fitted = refit(small_campaign(tmp_path), start, AirDrift)
    file, known = tmp_path / 'model.yaml', (fitted.posterior, estimates(fitted.history[-1].fit))
    write_inference.write_fitted(file, fitted.study, fitted.history, *known)
    numbers = re.findall(r': (-?[\d.]+)(?:e[+-]?\d+)?\b', file.read_text())
    assert len(numbers) > 10
    long = [n for n in numbers if len(n.lstrip('-0.').replace('.', '')) > 8]
    assert long == [str(BY_HAND)]
    door = fitted.study.campaign.experiments[1]
    expected, found = (
        scenes.painted(door.surface.points(), door.path, model, 'double', door.surface).gauge_um
        for model in (fitted.model, pd.read_model(file))
    )
    assert np.abs(found - expected).max() < 1e-6 * expected.max()


def test_the_gauge_stands_level_also_on_faces_square_to_the_front():
    normals = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.6, -0.8, 0.0]])
    turns = gauge_turns(normals, outward=normals[0], down=np.array([0.0, 0.0, -1.0]))
    axes = Rotation.from_quat(turns).as_matrix()
    np.testing.assert_allclose(axes[:, :, 2], -normals, atol=1e-12)
    np.testing.assert_allclose(axes[:, 2, 0], 0.0, atol=1e-12)
    np.testing.assert_allclose(axes[[0, 3], :, 0], [[1.0, 0.0, 0.0], [0.8, 0.6, 0.0]], atol=1e-12)

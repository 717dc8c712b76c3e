"""The film kept apart: its terms add up to the film, and to its derivatives by the pattern."""

import math

import numpy as np
import pytest

from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.film.integrator import FilmIntegrator
from paint_deposition.film.layout import term_weights
from paint_deposition.model.eq1_pattern import PlanarPattern
from paint_deposition.motion.path_builder import spray_path
from scenes import lying_plane, weaving

PATTERNS = {
    'default': PlanarPattern(),
    'ring only': PlanarPattern(K2=0.0, K3=0.9),
    'centre only': PlanarPattern(K2=1.0),
    'spot': PlanarPattern(r_m=0.0, K2=0.5, sigma1_m=0.03, sigma2_m=0.02),
    'thin ring': PlanarPattern(r_m=0.3, sigma1_m=0.02, K3=0.5, phi_rad=-2.0),
}
EFFECTS_OF = {
    'no effect': (),
    'laws of rays': ('pattern_spread', 'incidence_attraction', 'standoff_efficiency'),
    'effects on the path': ('air_drift', 'tcp_tilt', 'flow_drift'),
}
# Of the film's peak: what lies beyond the reach of one or the other.
CUT = 3e-6


def model_of(planar: PlanarPattern, effects: tuple[str, ...]) -> DepositionModel:
    return DepositionModel(
        planar=planar, effects=tuple(EFFECTS[name].typical() for name in effects)
    )


def film_um(model: DepositionModel) -> np.ndarray:
    integrator = FilmIntegrator(lying_plane(count=13), model, 'double')
    integrator.add(PATH)
    return integrator.raw_um


def terms_um(model: DepositionModel) -> np.ndarray:
    integrator = FilmIntegrator(lying_plane(count=13), model, 'double')
    return integrator.terms(integrator.steps(PATH))


PATH = spray_path(weaving(np.arange(0.0, 2.0, 0.05)))[0]


def moved(p: PlanarPattern, parameter: int, step: float) -> PlanarPattern:
    """The pattern with one of the parameters of ``term_weights`` moved."""
    lopsided = [p.K3 * math.cos(p.phi_rad), p.K3 * math.sin(p.phi_rad)]
    if parameter in (2, 3):
        lopsided[parameter - 2] += step
    factors = {
        0: ('K1_cm3_per_s', p.K1_cm3_per_s * math.exp(step)),
        1: ('K2', p.K2 + step),
        4: ('r_m', p.r_m + step),
        5: ('sigma1_m', p.sigma1_m * math.exp(step)),
        6: ('sigma2_m', p.sigma2_m * math.exp(step)),
    }
    change = dict([factors[parameter]]) if parameter in factors else {}
    asymmetry = {'K3': math.hypot(*lopsided), 'phi_rad': math.atan2(*lopsided[::-1])}
    return p.model_copy(update={**asymmetry, **change})


@pytest.mark.parametrize('effects', EFFECTS_OF.values(), ids=EFFECTS_OF)
@pytest.mark.parametrize('planar', PATTERNS.values(), ids=PATTERNS)
def test_the_terms_add_up_to_the_film(planar, effects):
    model = model_of(planar, effects)
    film = film_um(model)
    weights, _ = term_weights(planar)
    assert film.max() > 1.0
    assert weights @ terms_um(model) == pytest.approx(film, rel=0, abs=CUT * film.max())


@pytest.mark.parametrize('effects', EFFECTS_OF.values(), ids=EFFECTS_OF)
@pytest.mark.parametrize('planar', PATTERNS.values(), ids=PATTERNS)
def test_the_terms_add_up_to_the_films_derivatives(planar, effects):
    model = model_of(planar, effects)
    _, weights = term_weights(planar)
    found = weights @ terms_um(model)
    peak = film_um(model).max()
    for parameter, derivative in enumerate(found):
        if parameter == 1 and planar.K2 in (0.0, 1.0):
            continue  # see the test below
        ends = [
            film_um(model.model_copy(update={'planar': moved(planar, parameter, step)}))
            for step in (-1e-4, 1e-4)
        ]
        slope = (ends[1] - ends[0]) / 2e-4
        scale = max(np.abs(slope).max(), peak)
        assert derivative == pytest.approx(slope, rel=0, abs=1e-4 * scale), parameter

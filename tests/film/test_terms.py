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
CASES = [*((planar, ()) for planar in PATTERNS.values()), (PlanarPattern(), ('pattern_spread',))]
# Of the film's peak: what lies beyond the reach of one or the other.
CUT = 3e-6


def model_of(planar: PlanarPattern, effects: tuple[str, ...]) -> DepositionModel:
    return DepositionModel(
        planar=planar, effects=tuple(EFFECTS[name].typical() for name in effects)
    )


def film_um(model: DepositionModel) -> np.ndarray:
    integrator = FilmIntegrator(lying_plane(count=13), model, 'double', parallel=False)
    integrator.add(PATH)
    return integrator.raw_um


def terms_um(model: DepositionModel) -> np.ndarray:
    integrator = FilmIntegrator(lying_plane(count=13), model, 'double', parallel=False)
    return integrator.terms(integrator.steps(PATH))


PATH = spray_path(weaving(np.arange(0.0, 2.0, 0.05)))[0]


def moved(p: PlanarPattern, parameter: int, step: float) -> PlanarPattern:
    """The pattern with one of the parameters of ``term_weights`` moved."""
    lopsided = [p.K3 * math.cos(p.phi_rad), p.K3 * math.sin(p.phi_rad)]
    if parameter in (2, 3):
        lopsided[parameter - 2] += step
    factors = {
        0: ('K1_cm3_per_s', p.K1_cm3_per_s * math.exp(step)), 1: ('K2', p.K2 + step),
        4: ('r_m', p.r_m + step), 5: ('sigma1_m', p.sigma1_m * math.exp(step)),
        6: ('sigma2_m', p.sigma2_m * math.exp(step)),
    }  # fmt: skip
    change = dict([factors[parameter]]) if parameter in factors else {}
    asymmetry = {'K3': math.hypot(*lopsided), 'phi_rad': math.atan2(*lopsided[::-1])}
    return p.model_copy(update={**asymmetry, **change})


@pytest.mark.parametrize(('planar', 'effects'), CASES, ids=[*PATTERNS, 'pattern spread'])
def test_the_terms_add_up_to_the_film_and_to_its_derivatives(planar, effects):
    model = model_of(planar, effects)
    of_film, weights = term_weights(planar)
    terms, film = terms_um(model), film_um(model)
    peak = film.max()
    assert peak > 1.0
    assert of_film @ terms == pytest.approx(film, rel=0, abs=CUT * peak)
    found = weights @ terms
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

"""A learned law is shown beside the law of the library that is nearest."""

import numpy as np
import pytest

from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.effects.learned.catalogue import LEARNED
from paint_deposition.report.page.learned import nearest_law

KNOTS = 24


def like(covariate: str, low: float, high: float, curve, kind: str = 'factor'):
    """A learned law with the values of a function at its knots."""
    law = LEARNED[covariate](low=low, high=high, learned=(0.0,) * KNOTS)
    many = np.linspace(low, high, 100_001)
    at_knots = np.interp(law.knots, law.axis(many), curve(many))
    return law.model_copy(update={'learned': tuple(at_knots), 'kind': kind})


def squeezed(distance_m: np.ndarray) -> np.ndarray:
    return 0.4 * np.exp(-((distance_m / 0.03) ** 2))


def turned_away(angle_deg: np.ndarray) -> np.ndarray:
    return 0.5 - 0.5 * np.cos(np.radians(angle_deg))


@pytest.mark.parametrize(
    ('law', 'expected'),
    [
        (like('edge_distance_m', 0.0, 0.25, squeezed), 'edge_build'),
        (like('incidence_deg', 0.0, 60.0, turned_away), 'incidence_attraction'),
        (like('standoff_ratio', 0.8, 1.3, lambda r: 0.5 * (1.0 - r)), 'standoff_efficiency'),
        (
            like('height_fraction', 0.0, 1.0, lambda h: 2.0 * (1.0 - h) ** 1.3, 'addition'),
            'fog_gradient',
        ),
        (
            like('curvature_per_m', -4.0, 4.0, lambda k: -0.2 * np.maximum(k, 0.0)),
            'faraday_shielding',
        ),
    ],
    ids=lambda value: value if isinstance(value, str) else '',
)
def test_the_nearest_law_is_found_up_to_a_constant(law, expected):
    values = np.linspace(law.low, law.high, 101)
    effect, curve = nearest_law(law, EFFECTS, values)
    assert effect.id == expected
    learned = law.curve(values) + (1.0 if law.kind == 'factor' else 0.0)
    assert np.std(curve - learned) < 0.4 * np.std(learned)
    moved = law.model_copy(update={'learned': tuple(np.array(law.learned) + 0.1)})
    assert nearest_law(moved, EFFECTS, values)[0].id == expected


def test_a_curve_that_no_effect_has_stands_alone():
    waves = like('edge_distance_m', 0.0, 0.25, lambda d: 0.2 * np.sin(60.0 * d))
    assert nearest_law(waves, EFFECTS, np.linspace(0.0, 0.25, 101)) is None


@pytest.mark.parametrize('covariate', ['time_s', 'speed_m_per_s', 'stroke_end_m'])
def test_laws_over_the_path_stand_alone(covariate):
    law = like(covariate, 0.0, 1.0, lambda value: 0.2 * value)
    assert nearest_law(law, EFFECTS, np.linspace(0.0, 1.0, 101)) is None

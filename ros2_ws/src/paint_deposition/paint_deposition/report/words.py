"""What the report calls things, in words of the paint shop."""

import re
from collections.abc import Mapping
from typing import Any

from paint_deposition.effects.base import Effect
from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.fitting.study import Study
from paint_deposition.results.fitted_model import PATTERN, REFIT

COVARIATES: Mapping[str, tuple[str, str]] = {
    'incidence_deg': ('Incidence angle', 'deg'),
    'standoff_ratio': ('Distance over Omega', '1'),
    'curvature_per_m': ('Curvature, + concave', '1/m'),
    'edge_closeness': ('Closeness to an edge', '1'),
    'sky_view_factor': ('Openness to the booth', '1'),
    'height_fraction': ('Height on the part', '1'),
    'across_m': ('Position across', 'm'),
    'spray_pass': ('Pass that painted it', '1'),
    'time_s': ('Time it was painted', 's'),
    'speed_m_per_s': ('Speed of the gun', 'm/s'),
    'stroke_end_m': ('Distance from a turn', 'm'),
    'since_trigger_s': ('Time since trigger', 's'),
    'tool_x_m': ('Place in the pattern, x', 'm'),
    'tool_y_m': ('Place in the pattern, y', 'm'),
    'film_um': ('Film predicted', 'µm'),
}
UNITS = {'um': 'µm', '1': '', 'cm3/s': 'cm³/s', '1/m': '1/m'}
SYMBOLS = {
    'K1_cm3_per_s': ('K1', 'deposited solids rate', 'cm³/s'),
    'K2': ('K2', 'weight of the centred Gaussian', ''),
    'K3': ('K3', 'asymmetry of the ring', ''),
    'phi_rad': ('φ', 'phase of the asymmetry', 'rad'),
    'r_m': ('r', 'radius of the ring', 'm'),
    'sigma1_m': ('σ1', 'width of the ring', 'm'),
    'sigma2_m': ('σ2', 'width of the centred Gaussian', 'm'),
}


def covariate_label(name: str) -> str:
    """'incidence_deg' as 'Incidence angle [deg]'."""
    words, unit = COVARIATES.get(name, (name.replace('_', ' '), '1'))
    return words if unit == '1' else f'{words} [{unit}]'


def effect_name(effect_id: str) -> str:
    """'air_drift' as 'air drift'; names are kept for file and command line."""
    name = effect_id.replace('tcp_', 'TCP ').replace('faraday', 'Faraday')
    return name.replace('_', ' ')


def step_words(step: Mapping[str, Any]) -> str:
    """What one step of a model's history added."""
    added = str(step.get('added', PATTERN))
    known = {PATTERN: 'pattern of eq. (1) alone', REFIT: 'model as given, fitted anew'}
    return known.get(added) or f'+ {effect_name(added)}'


def effect_class_of(effect_id: str, *models) -> type[Effect] | None:
    """From the catalogue, or a user's own from the models in which it is."""
    if effect_id in EFFECTS:
        return EFFECTS[effect_id]
    owners = (model.effect(effect_id) for model in models)
    return next((type(effect) for effect in owners if effect is not None), None)


def effect_meaning(effect: type[Effect] | None) -> str:
    """The first line of what an effect says of itself."""
    lines = (effect.__doc__ or '').strip().splitlines() if effect else []
    return lines[0].strip() if lines else ''


def number(value: float, digits: int = 3) -> str:
    """Three significant digits, without an exponent for usual sizes."""
    if value == 0.0:
        return '0'
    text = f'{value:.{digits}g}'
    if 'e' in text and 1e-4 <= abs(value) < 1e6:
        text = f'{value:.6f}'.rstrip('0').rstrip('.') if abs(value) < 1 else f'{value:.0f}'
    return text.replace('-', '−')


def micrometres(value: float, signed: bool = False) -> str:
    """'2.31 µm'; with a sign if asked."""
    text = f'{value:+.2f}' if signed and abs(value) >= 0.005 else f'{value:.2f}'
    text = '0' if float(text) == 0.0 else text
    return f'{text.replace("-", "−")} µm'


def in_unit(value: float, unit: str) -> tuple[str, str]:
    """A parameter as number and unit; small lengths and times in mm and ms."""
    if unit == 'm' and abs(value) < 1.0:
        return number(1e3 * value), 'mm'
    if unit == 's' and abs(value) < 1.0:
        return number(1e3 * value), 'ms'
    return number(value), UNITS.get(unit, unit)


def p_words(p_value: float) -> str:
    """'p < 0.001' or 'p = 0.02'."""
    return 'p < 0.001' if p_value < 1e-3 else f'p = {p_value:.2g}'


def in_print(text: str) -> str:
    """Plain text with its units as they are printed."""
    return re.sub(r'(\d)-(\d)', r'\1–\2', text.replace(' um', ' µm'))


def percent(probability: float) -> str:
    """Never 100 %: no diagnosis is certain."""
    if probability > 0.99:
        return '> 99 %'
    return '< 1 %' if probability < 0.01 else f'{100 * probability:.0f} %'


def percent_words(probability: float) -> str:
    """The same for a sentence."""
    return percent(probability).replace('>', 'more than').replace('<', 'less than')


def count_words(study: Study) -> str:
    """How much was measured, on what."""
    experiments = study.campaign.experiments
    names = ' and '.join(e.name for e in experiments) if len(experiments) < 4 else (
        f'{len(experiments)} experiments'
    )  # fmt: skip
    readings, points = study.campaign.reading_count, len(study)
    text = f'{readings} readings'
    if points != readings:
        text += f' at {points} points'
    return f'{text} on {names}'


def joined(words: list[str], last: str = 'and') -> str:
    """'a, b and c'."""
    if len(words) < 2:
        return ''.join(words)
    return f'{", ".join(words[:-1])} {last} {words[-1]}'

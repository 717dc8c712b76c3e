"""What the report calls things, in words of the paint shop."""

import re
from collections.abc import Mapping, Sequence

import numpy as np

from paint_deposition.effects.base import Effect
from paint_deposition.effects.catalogue import LEARNED
from paint_deposition.effects.closed_forms import forms_of
from paint_deposition.effects.learned_curves import LearnedCurve, counted_from_1
from paint_deposition.effects.learned_laws import (
    LEAST_FACTOR,
    LearnedFootprint,
    LearnedLaw,
    LearnedMap,
)
from paint_deposition.inference.design.proposals import Spray
from paint_deposition.inference.diagnosis.explanations import FOOTPRINT, UNKNOWN
from paint_deposition.inference.diagnosis.verdict import EffectClass, percent
from paint_deposition.inference.fitting.study import Study

COVARIATES: Mapping[str, tuple[str, str]] = {
    'incidence_deg': ('Incidence angle', 'deg'),
    'standoff_ratio': ('Distance as a multiple of Omega', '1'),
    'curvature_per_m': ('Curvature, + concave', '1/m'),
    'edge_distance_m': ('Distance to the nearest edge', 'm'),
    'sky_view_factor': ('Sky view factor', '1'),
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
FORMS_SHOWN = 3
SUPERSCRIPTS = str.maketrans('-+0123456789', '⁻⁺⁰¹²³⁴⁵⁶⁷⁸⁹')


def covariate_label(name: str) -> str:
    """'incidence_deg' as 'Incidence angle [deg]'."""
    words, unit = COVARIATES.get(name, (name.replace('_', ' '), '1'))
    return words if unit == '1' else f'{words} [{unit}]'


def effect_name(effect_id: str) -> str:
    """'air_drift' as 'air drift'; names are kept for file and command line.

    A learned law is named by its covariate, several joined by 'and' one after the other.
    """
    if ' and ' in effect_id:
        return joined([effect_name(one) for one in effect_id.split(' and ')])
    family, _, covariate = effect_id.partition(':')
    if family == 'learned' and covariate in LEARNED:
        return f'learned law over {LEARNED[covariate].over}'
    name = effect_id.replace('tcp_', 'TCP ').replace('faraday', 'Faraday')
    return name.replace('_', ' ')


def competing_explanations(spray: Spray) -> str:
    """The explanations that a spray is to separate."""
    shapeless = {UNKNOWN: 'a cause outside the library', FOOTPRINT: 'another shape of the pattern'}
    return joined([shapeless.get(name) or effect_name(name) for name in spray.separates])


def separation_words(spray: Spray) -> str:
    """What a spray does for the leading effect: its distance from the next, and the chance."""
    words = (
        f'it tells {competing_explanations(spray)} apart: {spray.separation:.1f} standard '
        f'deviations between the two most probable, now {spray.now:.1f}'
    )
    if spray.chance == spray.chance:
        words += f'; with a probability of {percent(spray.chance)} only one effect remains'
        words += ': it hardly helps' if spray.chance < 0.05 else ''
    return '; '.join(filter(None, [words, spray.film_words]))


def is_learned(effect_id: str) -> bool:
    """Whether an id is that of a learned law, which names no cause."""
    return effect_id.startswith('learned:')


def effect_meaning(effect: type[Effect] | None) -> str:
    """A sentence on an effect: the first line of its docstring, or what else it says of itself."""
    if effect is None:
        return ''
    if effect.__doc__:
        return effect.__doc__.strip().splitlines()[0]
    described = [info['description'].split(' [')[0] for info in effect.parameters().values()]
    return capital(next(filter(None, [effect.signature, *described]), '').rstrip('.') + '.')


def learned_rows(law: Effect | None) -> list[dict[str, str]]:
    """A learned law's values and its range: words, value, unit; nothing for other effects."""
    if not isinstance(law, LearnedLaw):
        return []
    curve = np.array(law.learned)
    if isinstance(law, LearnedFootprint):
        along = np.linspace(-law.reach_m, law.reach_m, 101)
        curve = law.h(*np.meshgrid(along, along))
    if law.kind == 'factor':
        curve = np.maximum(1.0 + curve, LEAST_FACTOR)
    least, most = number(float(curve.min())), number(float(curve.max()))
    shown = ('addition', 'µm') if law.kind == 'addition' else ('factor', '')
    rows = [(shown[0], f'{least} to {most}', shown[1])]
    if isinstance(law, LearnedCurve):
        low, high = (number(counted_from_1(law.covariate, end)) for end in (law.low, law.high))
        rows.append(('over', f'{low} to {high}', unit_words(law.unit)))
    elif isinstance(law, LearnedMap):
        for grid in law.maps:
            sides = 1e3 * np.subtract(grid.high_m, grid.low_m)
            rows.append(('over', ' × '.join(f'{side:.0f}' for side in sides), 'mm of a part'))
    elif isinstance(law, LearnedFootprint):
        rows.append(('out to', number(1e3 * law.reach_m), 'mm from the axis on the model plane'))
    return [dict(zip(('words', 'value', 'unit'), row, strict=True)) for row in rows]


def form_words(law: LearnedCurve) -> str:
    """The closed forms that fit a curve, with their values and probabilities, as sentences."""
    forms = [
        f'{form.formula} with '
        + joined([f'{name} {number(found.value)}' for name, found in form.parameters.items()])
        + f' ({percent(form.probability)})'
        for form in forms_of(law)
    ]
    if not forms:
        return 'No closed form of few parameters fits within its band.'
    more = f'; {len(forms) - FORMS_SHOWN} more fit' if len(forms) > FORMS_SHOWN else ''
    return f'Closed forms within its band: {"; ".join(forms[:FORMS_SHOWN])}{more}.'


def probability_words(found: EffectClass) -> str:
    """The probability of a group; a learned law that was kept for what it predicts has none."""
    if is_learned(found.best) and found.probability == 1.0:
        return 'kept'
    return percent(found.probability)


def parameter_words(name: str, unit: str) -> str:
    """'shift_down_m' as 'shift down': its unit stands behind the value."""
    units = {'per', *re.findall(r'[a-z]+\d*', unit)}
    words = name.split('_')
    while len(words) > 1 and words[-1] in units:
        words.pop()
    return ' '.join(words)


def number(value: float, digits: int = 3) -> str:
    """Three significant digits, without an exponent for usual sizes."""
    if value == 0.0:
        return '0'
    text = f'{value:.{digits}g}'
    if 'e' in text and 1e-4 <= abs(value) < 1e6:
        return f'{value:.0f}'.replace('-', '−')
    mantissa, _, exponent = text.partition('e')
    power = f' × 10{str(int(exponent)).translate(SUPERSCRIPTS)}' if exponent else ''
    return mantissa.replace('-', '−') + power


def capital(text: str) -> str:
    """With a capital letter at the beginning."""
    return text[:1].upper() + text[1:]


def fixed(value: float, digits: int = 2, signed: bool = False) -> str:
    """With so many decimals; with a sign if wanted, but none where all decimals are zeros."""
    text = f'{value:{"+" if signed else ""}.{digits}f}'
    return text.replace('-', '−') if float(text) else text.lstrip('+-')


def in_unit(unit: str, *values: float) -> tuple[str, ...]:
    """Unit and values as they are printed; small m and s as mm and ms, rad as °."""
    if unit == 'rad':
        return '°', *(number(float(np.degrees(value))) for value in values)
    if unit in ('m', 's') and abs(values[0]) < 1.0:
        return f'm{unit}', *(number(1e3 * value) for value in values)
    return unit_words(unit), *(number(value) for value in values)


def unit_words(unit: str) -> str:
    """A unit as it is printed: 'um' as 'µm', '1/pass' as 'per pass', '' for a mere number."""
    words = re.sub(r'\bum\b', 'µm', unit).replace('2', '²').replace('3', '³')
    inverse = re.fullmatch(r'1/\(?(.+?)\)?', words)
    return f'per {inverse[1]}' if inverse else words.removeprefix('1')


def p_words(p_value: float) -> str:
    """'p < 0.001' or 'p = 0.02'."""
    return 'p < 0.001' if p_value < 1e-3 else f'p = {p_value:.2g}'


def count_words(study: Study) -> str:
    """How much was measured, on what."""
    experiments = study.campaign.experiments
    names = ' and '.join(e.name for e in experiments) if len(experiments) < 4 else (
        f'{len(experiments)} experiments'
    )  # fmt: skip
    readings, points = len(study.campaign.readings), len(study)
    text = f'{readings} readings'
    if scan := study.campaign.scan:
        text = f'{len(scan.readings)} readings in {points} cells'
    elif points != readings:
        text += f' at {points} points'
    return f'{text} on {names}'


def joined(words: Sequence[str], last: str = 'and') -> str:
    """'a, b and c'."""
    if len(words) < 2:
        return ''.join(words)
    return f'{", ".join(words[:-1])} {last} {words[-1]}'

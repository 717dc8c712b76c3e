"""A closed form of a learned law as an effect file, ready to edit, in the form of the sample."""

import re
from pathlib import Path

from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.effects.learned.curves import LearnedCurve
from paint_deposition.effects.learned.law import LEAST_FACTOR
from paint_deposition.files.atomic import filled, write_text
from paint_deposition.inference.diagnosis.closed_forms import (
    ClosedForm,
    Parameter,
    at_knots,
    variable,
)

# What a law is over, in the words of an effect's code, and the family of such effects.
VARIABLES = {
    'incidence_deg': ('ray.cos_incidence', 'incidence'),
    'standoff_ratio': ('ray.standoff_ratio', 'standoff'),
    'time_s': ('path.time_s', 'time'),
    'spray_pass': ('np.where(np.isnan(path.time_s), np.nan, path.passes_before + 1.0)', 'order'),
    'stroke_end_m': ('np.minimum(path.from_turn_m, path.to_turn_m)', 'boundary'),
    'since_trigger_s': ('path.since_on_s', 'boundary'),
    'speed_m_per_s': ('path.speed_m_per_s', 'time'),
    'curvature_per_m': ('points.curvature_per_m', 'curvature'),
    'edge_distance_m': ('points.edge_distance_m', 'boundary'),
    'sky_view_factor': ('points.sky_view_factor', 'visibility'),
    'height_fraction': ('points.height_fraction', 'order'),
    'across_m': ('places_m(points)[:, 0]', 'lateral shift'),
    'film_um': ('film_um', 'level'),
}
# An amplitude may become so many times as far from neutral, a shape so many times as long.
ROOM = 10.0
TEMPLATE = Path(__file__).parent / 'templates' / 'effect.py.j2'


def effect_entry(form: ClosedForm, file: str | Path) -> str:
    """What stands in a model file for the effect of a form: its file and its values."""
    return f'file: {file}, ' + ', '.join(f'{n}: {p.value:.6g}' for n, p in form.parameters.items())


def write_effect_file(path: Path, law: LearnedCurve, form: ClosedForm) -> Path:
    """Write a form of a learned law as an effect; absent at its defaults.

    Args:
        path: the file, named for the effect.
        law: what was learned.
        form: one of those that fit it.
    """
    value, family = VARIABLES[law.covariate]
    effect_id = re.sub(r'\W+', '_', path.stem.lower()).strip('_') or 'learned'
    if effect_id in EFFECTS or not effect_id[0].isalpha():
        effect_id = f'learned_{effect_id}'
    acts_on = 'path' if type(law).on_path is not LearnedCurve.on_path else 'film'
    (name, unit), knots = variable(type(law)), at_knots(law)
    text = filled(
        TEMPLATE, law=law, form=form, id=effect_id, family=family, value=value, file=path.name,
        entry=effect_entry(form, path.name).partition(', ')[2],
        acts_on='ray' if law.flux_factor is not None else acts_on,
        functions=', '.join(one for one in ('exp', 'log') if f'{one}(' in form.code),
        variable=name if unit == '1' else f'{name} [{unit}]', lowest=LEAST_FACTOR,
        low=f'{float(knots.min()):.6}', high=f'{float(knots.max()):.6}', bounds=_bounds,
        literal=repr,
    )  # fmt: skip
    write_text(path, text)
    return path


def _bounds(found: Parameter) -> str:
    """Default and bounds of a parameter of the effect, wide about what was learned."""
    value, neutral = float(f'{found.value:.6g}'), float(f'{found.neutral:.6g}')
    if found.role == 'shape':
        role, low, high = "role='shape'", value / ROOM, value * ROOM
    else:
        away = ROOM * max(abs(value - neutral), 0.1 if neutral else 1e-3)
        role, low, high = f'typical={value}', neutral - away, neutral + away
        low = max(low, 0.0) if found.role == 'level' else low
    return f'{neutral}, low={low:.4g}, high={high:.4g}, {role}'

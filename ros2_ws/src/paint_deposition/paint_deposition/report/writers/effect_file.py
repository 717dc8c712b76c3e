"""A closed form of a learned law as an effect file, ready to edit, in the form of the sample."""

import re
from pathlib import Path

from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.effects.learned.curves import LearnedCurve
from paint_deposition.effects.learned.law import LEAST_FACTOR
from paint_deposition.files.atomic import write_text
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
FILE = '''"""A law over {over}, as learned from readings.

In model.yaml, in place of learned:{covariate}:
``effects: [{{file: {file}, {entry}}}]``
"""

{imports}


class {name}(Effect):
    """{formula}.

    x is {variable}{unit}, from {low} to {high} in the readings; beyond, the law
    stays what it is at the end.
    """

    id = '{id}'
    family = '{family}'
    signature = {signature}{more}

{parameters}

{method}
'''
ON_RAY = """    @staticmethod
    def flux_factor(ray: Ray, {arguments}) -> float:
        x = min(max({value}, {low}), {high})
        return max({least}, {code})"""
ON_PATH = """    def on_path(self, path: SprayPath, context: PathContext) -> SprayPath:
        {names} = self.values()
        x = np.clip({value}, {low}, {high})
        factor = np.maximum({least}, {code})
        return path.with_flow_scaled(np.where(np.isnan(x), 1.0, factor))"""
ON_FILM = """    def on_film(self, film_um: np.ndarray, points: SurfacePoints) -> np.ndarray:
        {names} = self.values()
        x = np.clip({value}, {low}, {high})
        return film_um * np.maximum({least}, {code})"""
ADDED_TO_FILM = """    def on_film(self, film_um: np.ndarray, points: SurfacePoints) -> np.ndarray:
        {names} = self.values()
        x = np.clip({value}, {low}, {high})
        added_um = {code}
        return np.where(film_um > 0.0, np.maximum(film_um + added_um, 0.0), film_um)"""


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
    (name, unit), knots = variable(type(law)), at_knots(law)
    filled = {
        'value': value, 'least': LEAST_FACTOR, 'code': form.code,
        'low': f'{float(knots.min()):.6}', 'high': f'{float(knots.max()):.6}',
        'names': ', '.join(form.parameters),
        'arguments': ', '.join(f'{one}: float' for one in form.parameters),
    }  # fmt: skip
    hook = _hook(law)
    text = FILE.format(
        formula=form.formula, covariate=law.covariate,
        file=path.name, entry=effect_entry(form, path.name).partition(', ')[2],
        imports=_imports(hook.format(**filled)), id=effect_id, family=family, over=law.over,
        signature=repr(f'the film depends on {law.over}'),
        name=''.join(word.capitalize() for word in effect_id.split('_')), variable=name,
        unit='' if unit == '1' else f' [{unit}]', low=filled['low'], high=filled['high'],
        more='\n    needs_whole_strokes = True' if law.needs_whole_strokes else '',
        parameters='\n'.join(_declared(*one) for one in form.parameters.items()),
        method=hook.format(**filled),
    )  # fmt: skip
    write_text(path, text)
    return path


def _hook(law: LearnedCurve) -> str:
    """Where the law acts, as the method of an effect."""
    if law.flux_factor is not None:
        return ON_RAY
    if type(law).on_path is not LearnedCurve.on_path:
        return ON_PATH
    return ADDED_TO_FILM if law.kind == 'addition' else ON_FILM


def _imports(method: str) -> str:
    """The imports that a method needs."""
    on_ray, on_path = 'flux_factor' in method, 'on_path' in method
    functions = ', '.join(one for one in ('exp', 'log') if f'{one}(' in method)
    base = 'Effect, Ray' if on_ray else 'Effect, PathContext' if on_path else 'Effect'
    lines = [f'from paint_deposition.effects.base import {base}, parameter']
    if 'places_m' in method:
        lines.append('from paint_deposition.effects.learned.place import places_m')
    if on_ray:
        lines += [f'from paint_deposition.kernel.fast_math import {functions}'] * bool(functions)
        return '\n'.join(lines)
    kind = ('motion.path', 'SprayPath') if on_path else ('part.points', 'SurfacePoints')
    lines.append(f'from paint_deposition.{kind[0]} import {kind[1]}')
    numeric = ['import numpy as np', *[f'from numpy import {functions}'] * bool(functions), '']
    return '\n'.join([*numeric, *lines])


def _declared(name: str, found: Parameter) -> str:
    """A parameter of the effect, its bounds wide about what was learned."""
    value, neutral = float(f'{found.value:.6g}'), float(f'{found.neutral:.6g}')
    if found.role == 'shape':
        role, low, high = ", role='shape'", value / ROOM, value * ROOM
    else:
        away = ROOM * max(abs(value - neutral), 0.1 if neutral else 1e-3)
        role, low, high = f', typical={value}', neutral - away, neutral + away
        low = max(low, 0.0) if found.role == 'level' else low
    return (
        f'    {name}: float = parameter(\n'
        f'        {neutral}, low={low:.4g}, high={high:.4g}{role}, unit={found.unit!r},\n'
        f'        description={found.words!r},\n'
        f'    )  # fmt: skip'
    )

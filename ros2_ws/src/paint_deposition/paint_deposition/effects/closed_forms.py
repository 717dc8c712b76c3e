"""The closed forms that a learned curve could be: those that fit within its band, by evidence.

Every form is fitted to the curve's values at its knots, weighted by their standard deviations, and
weighed by the Bayesian information criterion (Schwarz, Ann. Stat. 6:461, 1978). Neighbouring knots
are off alike, so they count for as many as their deviations from the best form say.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from itertools import product
from typing import Any

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import chi2

from paint_deposition.effects.base import Effect
from paint_deposition.effects.learned_curves import LearnedCurve, counted_from_1

# So many knots count at least, where they are off alike: one more than a form's parameters.
LEAST_KNOTS = 5


@dataclass(frozen=True)
class Parameter:
    """A parameter of a form."""

    power: int  # of the variable's unit
    words: str
    role: str = 'amplitude'  # 'amplitude', 0 where the form is flat, 'level' or 'shape'
    # Of the fit, in units of the range of the variable.
    starts: tuple[float, ...] = (0.0,)
    bounds: tuple[float, float] = (-20.0, 20.0)
    # As fitted, with its 95 % interval, in its unit.
    value: float = np.nan
    low: float = np.nan
    high: float = np.nan
    unit: str = ''

    @property
    def neutral(self) -> float:
        """The value at which it changes nothing; for a shape, its default."""
        if self.role == 'shape':
            return self.value
        return 1.0 if self.role == 'level' else 0.0


@dataclass(frozen=True)
class ClosedForm:
    """A law in two to four parameters, the level among them."""

    name: str  # of the form, as 'power'
    formula: str  # over the variable's name, for people
    code: str  # over x, in Python, with exp and log
    parameters: dict[str, Parameter]  # by name; positions and scales are those of the variable
    # Among the forms tried, with the constant and those beyond the band: the listed ones may sum
    # to less than one.
    probability: float

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """The factor, or the addition [um], at values of the variable."""
        law = _compiled(self.code, tuple(self.parameters))
        return law(x, *(found.value for found in self.parameters.values()))

    def to_dict(self) -> dict[str, Any]:
        """An entry of ``forms`` in ``diagnosis.json``."""
        shown = {
            name: {'value': found.value, 'low': found.low, 'high': found.high}
            for name, found in self.parameters.items()
        }
        return {'formula': self.formula, 'parameters': shown, 'probability': self.probability}


_CHANGE = Parameter(0, 'change in all', starts=(-0.3, 0.3))
# Forms by name: how they change the level, and their parameters. Those that are multiplied have
# the level as a factor; the others are added to it, to 1 times it where the law is a factor.
MULTIPLIED = {
    'power': (
        'exp({exponent} * log(x / {x0}))',
        {'exponent': Parameter(0, 'exponent of the power', bounds=(-8.0, 8.0))},
    ),
    'exponential': (
        'exp({rate} * (x - {x0}))',
        {'rate': Parameter(-1, 'rate of the exponential')},
    ),
}
ADDED = {
    'linear': ('{slope} * (x - {x0})', {'slope': Parameter(-1, 'slope')}),
    'quadratic': (
        '({slope} + {bend} * (x - {x0})) * (x - {x0})',
        {'slope': Parameter(-1, 'slope'), 'bend': Parameter(-2, 'half the second derivative')},
    ),
    'inverse': (
        '{share} * ({x0} / x - 1.0)',
        {'share': Parameter(0, 'share that goes as the inverse', starts=(0.5,))},
    ),
    'saturating': (
        '{change} * (1.0 - exp(({start} - x) / {scale}))',
        {'change': _CHANGE,
         'scale': Parameter(1, 'range within which it saturates', 'shape',
                            (0.1, 0.4), (0.02, 3.0))},
    ),
    'logistic': (
        '{change} / (1.0 + exp(({start} + {middle} - x) / {width}))',
        {'change': _CHANGE,
         'middle': Parameter(1, 'middle of the change, from where it starts', 'shape',
                             (0.25, 0.5, 0.75), (0.01, 1.0)),
         'width': Parameter(1, 'width of the change', 'shape', (0.06, 0.2), (0.02, 1.0))},
    ),
}  # fmt: skip
FORMS: dict[str, tuple[str, dict[str, Parameter]]] = {'constant': ('', {})} | MULTIPLIED | ADDED
# What a form need not say where it is about 0 or 1.
IDLE = {'(x - 0.0)': 'x', '(0.0 - x)': '-x', '(0.0 + ': '(', '(x / 1.0)': '(x)'}


def variable(law: type[LearnedCurve]) -> tuple[str, str]:
    """Name and unit of what the forms of a law are over: of incidence, its cosine."""
    if law.covariate == 'incidence_deg':
        return 'cos_incidence', '1'
    return law.covariate, law.unit


def variable_at(law: LearnedCurve, value: np.ndarray) -> np.ndarray:
    """The variable at values of a law's covariate (...); passes count from 1."""
    if law.covariate == 'incidence_deg':
        return np.cos(np.radians(value))
    return counted_from_1(law.covariate, value)


def at_knots(law: LearnedCurve) -> np.ndarray:
    """(K,) values of the variable at the knots of a law."""
    many = np.linspace(law.low, law.high, 100_001)
    return variable_at(law, np.interp(law.knots, law.axis(many), many))


@cache
def forms_of(law: Effect | None) -> tuple[ClosedForm, ...]:
    """The closed forms that fit a learned curve; none for any other effect."""
    if not isinstance(law, LearnedCurve) or not law.sd:
        return ()
    name, unit = variable(type(law))
    value, addition = np.array(law.learned), law.kind == 'addition'
    value = value if addition else 1.0 + value
    return fitting_forms(at_knots(law), value, np.array(law.sd), name, unit, addition)


def fitting_forms(
    x: np.ndarray,
    value: np.ndarray,
    sd: np.ndarray,
    name: str = 'x',
    unit: str = '1',
    addition: bool = False,
) -> tuple[ClosedForm, ...]:
    """The closed forms that fit a curve within its band, the most probable first.

    Args:
        x: (K,) knots. value: (K,) factors, or additions [um]. sd: (K,) their standard deviations.
        name, unit: of x.
        addition: whether the values are added to the film.

    Returns:
        None where nothing of few parameters fits, or where a constant or nothing does as well.
    """
    if len(x) < LEAST_KNOTS or not value.any():
        return ()
    sd = np.maximum(sd, 1e-9)
    fits = [fit for form in FORMS for fit in _fitted(form, x, value, sd, unit, addition)]
    deviation = min((fit.fun for _, _, fit in fits), key=lambda z: float(z @ z))
    # So many independent values stand behind deviations that are alike in neighbours.
    square = float(deviation @ deviation)
    alike = float(deviation[1:] @ deviation[:-1]) / square if square > 0.0 else 0.0
    knots = float(np.clip(len(x) * (1.0 - alike) / (1.0 + alike), LEAST_KNOTS, len(x)))
    weight = knots / len(x)
    misfit = np.array([weight * float(fit.fun @ fit.fun) for _, _, fit in fits])
    count = np.array([len(fit.x) for _, _, fit in fits])
    criterion = misfit + count * np.log(knots)
    evidence = np.exp(-0.5 * (criterion - criterion.min()))
    probability = evidence / evidence.sum()
    # A form whose deviations are as improbable as this does not fit, and a faint one is not
    # listed.
    sound = chi2.sf(misfit, np.maximum(knots - count, 1.0)) > 0.001
    sound &= (probability > 0.01) & (criterion < criterion[0])
    return tuple(
        _described(fits[k], float(probability[k]), weight, name, unit, addition)
        for k in np.argsort(-probability)
        if sound[k]
    )


def _fitted(
    form: str, x: np.ndarray, value: np.ndarray, sd: np.ndarray, unit: str, addition: bool
) -> Iterator[tuple[str, str, Any]]:
    """Name, code and the best fit of a form; none where it cannot be, or ends at a bound."""
    span = float(np.ptp(x))
    # A power of a value so small beside the largest has no form that readings could tell.
    if form in ('power', 'inverse') and x.min() < 0.02 * x.max():
        return
    code, shapes = _code(form, x, unit, addition), FORMS[form][1].values()
    law = _compiled(code, _names(form, unit, addition))
    size = float(np.abs(value).max()) if addition and form in ADDED else 1.0
    scale = np.array([
        span**shape.power * (size if shape.role == 'amplitude' else 1.0) for shape in shapes
    ])  # fmt: skip
    level = float(np.average(value, weights=sd**-2))
    widest = 20.0 * float(np.abs(value).max())
    bounds = np.array([(-widest, widest), *(shape.bounds for shape in shapes)]).T
    bounds[:, 1:] *= scale
    starts = product([level], *(shape.starts for shape in shapes))
    fits = [
        least_squares(
            lambda given: (law(x, *given) - value) / sd,
            np.array(start) * np.array([1.0, *scale]), bounds=bounds, x_scale='jac',
        )
        for start in starts
    ]  # fmt: skip
    best = min(fits, key=lambda fit: fit.cost)
    if best.success and not best.active_mask.any():
        yield form, code, best


def _described(
    fitted: tuple[str, str, Any], probability: float, weight: float,
    name: str, unit: str, addition: bool,
) -> ClosedForm:  # fmt: skip
    form, code, fit = fitted
    # The 95 % interval.
    half = 1.96 * np.sqrt(np.diag(np.linalg.pinv(fit.jac.T @ fit.jac)) / weight)
    level = Parameter(0, 'level of the law; the pattern can take it up')
    parameters = {}
    for key, shape, value, away in zip(
        _names(form, unit, addition), [level, *FORMS[form][1].values()], fit.x, half, strict=True
    ):
        role = 'level' if shape is level and not addition else shape.role
        in_um = addition and shape.role == 'amplitude' and (form in ADDED or shape is level)
        of_unit = _unit(unit, shape.power, in_um)[1]
        low = value - away if role != 'shape' else max(value - away, 0.0)
        parameters[key] = replace(
            shape, role=role, value=float(value), low=float(low), high=float(value + away),
            unit=of_unit,
        )  # fmt: skip
    formula = re.sub(r'exp\((\w+) \* log\((.+?)\)\)', r'(\2)^\1', code).replace('(x)', 'x')
    formula = re.sub(r'\bx\b', name, re.sub(r'\b(\d+)\.0\b', r'\1', formula))
    kind = 'addition [um]' if addition else 'factor'
    return ClosedForm(form, f'{kind} = {formula}', code, parameters, probability)


def _code(form: str, x: np.ndarray, unit: str, addition: bool) -> str:
    """A form as Python over x and its parameters, about a round value within the range of x."""
    low, high = float(x.min()), float(x.max())
    natural = unit == '1' and low <= 1.0 <= 1.1 * high
    centre = 1.0 if natural else float(f'{0.5 * (low + high):.2g}')
    names = _names(form, unit, addition)
    text = FORMS[form][0].format(
        x0=centre, start=float(f'{low:.4g}'), **dict(zip(FORMS[form][1], names[1:], strict=True))
    )
    if form in MULTIPLIED:
        text = f'{names[0]} * {text}'
    elif form in ADDED:
        text = f'{names[0]} + {text}' if addition else f'{names[0]} * (1.0 + {text})'
    for idle, plain in IDLE.items():
        text = text.replace(idle, plain)
    text = text.replace('- -', '+ ')
    return text or f'{names[0]} + 0.0 * x'


def _names(form: str, unit: str, addition: bool) -> tuple[str, ...]:
    """Names of the level and of the parameters of a form, each with its unit."""
    own = (
        key + _unit(unit, shape.power, addition and form in ADDED and shape.role == 'amplitude')[0]
        for key, shape in FORMS[form][1].items()
    )
    return ('level_um' if addition else 'level', *own)


def _unit(unit: str, power: int, in_um: bool) -> tuple[str, str]:
    """('_per_s2', '1/s2') for the unit s to the power -2; micrometres times it if wanted."""
    over, _, under = unit.partition('/')
    exponents = {'um': int(in_um)}
    for one, sign in ((over, 1), (under, -1)):
        if one not in ('', '1'):
            exponents[one] = exponents.get(one, 0) + sign * power
    above = [f'{one}{n if n > 1 else ""}' for one, n in exponents.items() if n > 0]
    below = [f'{one}{-n if n < -1 else ""}' for one, n in exponents.items() if n < 0]
    name = ''.join(f'_{one}' for one in above) + ''.join(f'_per_{one}' for one in below)
    return name, '/'.join([' '.join(above) or '1', *below])


@cache
def _compiled(code: str, names: tuple[str, ...]) -> Any:
    """The function of x and these parameters: what is fitted is what is written."""
    return eval(f'lambda x, {", ".join(names)}: {code}', {'exp': np.exp, 'log': np.log})

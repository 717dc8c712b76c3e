"""What a hidden effect can change, and the register of all of them.

Amplitudes are in the units of the effect's usual parameter, drawn as typical x U(0.7, 2).
An effect may have several laws: classes with one `id` and each its own `form`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from inspect import getattr_static

import numpy as np

from .doors import Part
from .flight import Air, Landings, Slices
from .jobs import Motion
from .parcels import Parcels, Pattern

DOWN = np.array([0.0, 0.0, -1.0])
KAPPA_REF_PER_M = 1.0 / 0.250


@dataclass(frozen=True)
class Scene:
    """One experiment as a truth sees it."""

    part: Part
    pattern: Pattern
    nominal: Motion  # as logged


def between(**limits: tuple) -> dict[str, tuple]:
    """Ranges of parameters, by name."""
    return limits


@dataclass(frozen=True)
class Truth:
    """The neutral truth: nothing is hidden."""

    amplitude: float = 0.0
    drawn: dict = field(default_factory=dict)  # further parameters, by name

    id = 'clean'
    form = ''  # '' for the effect's first law, a word for each other one
    family = 'none'
    typical = 0.0
    most = np.inf  # largest amplitude that a shop would still paint with
    unit = ''
    sign = 'positive'  # 'positive', 'negative' or 'either'
    ranges = between()  # of further parameters: low, high and, of several, how many
    gun = None  # where the gun must open, so that the effect can occur at all

    @classmethod
    def draw(cls, rng: np.random.Generator, amplitude: float | None = None, scale=1.0) -> Truth:
        """A truth of physics-typical size, or of the given amplitude."""
        signed = cls.of_size(scale * rng.uniform(0.7, 2.0), rng)
        return cls(signed if amplitude is None else amplitude, cls.details(rng))

    @classmethod
    def of_size(cls, size: float, rng: np.random.Generator) -> float:
        """The amplitude of so many typical sizes, at the most `most`, with a physical sign."""
        signs = {'positive': 1.0, 'negative': -1.0, 'either': rng.choice([-1.0, 1.0])}
        return signs[cls.sign] * min(cls.typical * size, cls.most)

    @classmethod
    def name(cls) -> str:
        """'edge_build', or 'edge_build~ramp' for another form of its law."""
        return f'{cls.id}~{cls.form}' if cls.form else cls.id

    @classmethod
    def details(cls, rng: np.random.Generator) -> dict:
        return {name: rng.uniform(*limits) for name, limits in cls.ranges.items()}

    def on_part(self, part: Part) -> Part:
        return part

    def on_plume(self, parcels: Parcels, pattern: Pattern) -> Parcels:
        return parcels

    def on_motion(self, motion: Motion, scene: Scene) -> Motion:
        return motion

    def on_flow(self, flow: Callable, scene: Scene) -> Callable:
        """flow(times) -> cm^3/s."""
        return flow

    def on_air(self, air: Air, slices: Slices, parcels: Parcels) -> Air:
        return air

    def on_landing(self, landings: Landings, scene: Scene) -> np.ndarray | float:
        """Share of each landing that stays (may exceed 1: paint that would have been lost)."""
        return 1.0

    def on_film(self, film_um: np.ndarray, x, z, scene: Scene, film_at: Callable) -> np.ndarray:
        """film_at(x, z) -> film of the parcels at any points of the part."""
        return film_um

    def on_gauge(self, film_um: np.ndarray, x, z, scene: Scene) -> np.ndarray:
        return film_um

    def as_dict(self) -> dict:
        kind = {'id': self.id, 'form': self.form, 'family': self.family}
        amount = {'amplitude': float(self.amplitude), 'unit': self.unit}
        return kind | amount | plain(self.drawn)


def variant(base: type[Truth], form: str, why: str, **members: object) -> type[Truth]:
    """Another form of an effect's law: `members` in the place of the base's, `why` in words."""
    for name, one in members.items():
        if isinstance(getattr_static(base, name), staticmethod):
            members[name] = staticmethod(one)
    own = {'form': form, '__doc__': why} | members
    kind = type(f'{base.__name__.strip("_")}_{form}', (base,), own)
    _VARIANTS.append(kind)
    return kind


# A class remembers its subclasses weakly.
_VARIANTS: list[type[Truth]] = []


def library() -> dict[str, type[Truth]]:
    """All truths by name: ids of the effects, 'id~form', 'unknown:...' and 'footprint:...'."""
    from . import strange, truths_film, truths_gun, truths_landing  # noqa: F401

    found, left = {}, [Truth]
    while left:
        one = left.pop(0)
        left += one.__subclasses__()
        if one is not Truth and not one.__name__.startswith('_'):
            found[one.name()] = one
    return found


def choose(
    spec: str | list[str] | None, rng: np.random.Generator,
    amplitude: float | dict | None = None, scale: float = 1.0,
) -> list[Truth]:  # fmt: skip
    """Truths named by `spec`: None, 'air_drift', 'air_drift+sag~yield', a list."""
    if spec is None or spec == 'clean':
        return []
    known = library()
    names = spec.split('+') if isinstance(spec, str) else list(spec)
    truths = []
    for name in names:
        wanted = amplitude.get(name) if isinstance(amplitude, dict) else amplitude
        truths.append(known[name].draw(rng, wanted, scale))
    return truths


def with_drift(air: Air, drift_m: np.ndarray, growth: float | None = None) -> Air:
    growth = air.growth if growth is None else growth
    return replace(air, drift_m=air.drift_m + drift_m, growth=growth)


def plain(value: object) -> object:
    """NumPy values as what JSON knows."""
    if isinstance(value, dict):
        return {k: plain(v) for k, v in value.items()}
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value

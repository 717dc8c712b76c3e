"""The base of effects: one physical cause, its parameters, and where in the model it acts."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from paint_deposition.kernel.eq2_flux import Ray as Ray
from paint_deposition.model.eq2_projection import Projection
from paint_deposition.motion.path import SprayPath as SprayPath
from paint_deposition.part.points import SurfacePoints as SurfacePoints
from paint_deposition.part.points import across_axis, downhill_axis

# Curvature at which the effects of curvature have their full amplitude: a radius of 250 mm.
REFERENCE_CURVATURE_PER_M = 1.0 / 0.250


@dataclass(frozen=True)
class PathContext:
    """What an effect on the path may need besides the path, as in ``SurfacePoints``: (3,) each."""

    projection: Projection
    down: np.ndarray
    outward: np.ndarray
    centre_m: np.ndarray

    @property
    def across(self) -> np.ndarray:
        """See ``across_axis``."""
        return across_axis(self.outward, self.down)

    @property
    def downhill(self) -> np.ndarray:
        """See ``downhill_axis``."""
        return downhill_axis(self.outward, self.down)


def parameter(
    neutral: float,
    *,
    low: float,
    high: float,
    unit: str,
    description: str,
    typical: float | None = None,
    role: str = 'amplitude',
) -> Any:
    """Declare a parameter of an effect.

    Args:
        neutral: value at which the effect is absent; for a shape, its default.
        low, high: bounds; where physics knows one sign only, the neutral value is one of them.
        unit: also part of the field's name where it is not 1.
        description: what it is, with its symbol, and what a positive value means.
        typical: size of an amplitude that occurs in practice, the scale of its prior.
        role: 'amplitude' (neutral means absent) or 'shape' (length or time scale).
    """
    if typical is None:
        if role == 'amplitude':
            raise TypeError('an amplitude needs its typical size: parameter(..., typical=...)')
        typical = neutral
    return Field(
        neutral,
        ge=low,
        le=high,
        description=f'{description} [{unit}]',
        json_schema_extra={
            'neutral': neutral, 'low': low, 'high': high, 'typical': typical,
            'unit': unit, 'role': role,
        },
    )  # fmt: skip


class Effect(BaseModel):
    """Base of all effects: subclass it, name it, and define one of the places where it acts.

    A subclass declares its parameters with ``parameter`` and overrides what it needs:

    * ``on_path``: the motion is not what was recorded, or the flow not what was commanded.
    * ``flux_factor``: a static function (ray, *parameters) -> factor on the flux along one ray,
      compiled into the kernel; parameters in the order declared. Plain arithmetic, ``min`` and
      ``max``, and ``kernel.fast_math``: a branch or a function of ``math`` costs the loop its
      speed.
    * ``pattern_scale``: the same, returning the factor s by which the pattern shrinks seen from
      the emission point: q becomes s q and the flux s^2, so that no volume is lost. It goes with
      ``widening``, beyond which the spray is cut off.
    * ``on_film``: the film changes after it has arrived.
    * ``on_gauge``: the gauge reads something else than the film.

    An effect made without arguments is absent.
    """

    model_config = ConfigDict(frozen=True, extra='forbid', allow_inf_nan=False)

    id: ClassVar[str]
    family: ClassVar[str]
    file: ClassVar[Path | None] = None  # a user's own effect
    file_content: ClassVar[bytes] = b''
    signature: ClassVar[str] = ''
    rivals: ClassVar[tuple[str, ...]] = ()
    source: ClassVar[str] = ''
    # Covariates over which the law may be off in a way of its own.
    covariates: ClassVar[tuple[str, ...]] = ()
    # What a law of any form over them would be: a 'factor' on what arrives or an 'addition' to the
    # film; '' where a curve over a covariate is not that effect.
    free_law: ClassVar[str] = ''
    # Whether the law is exact, as that of a wrong offset: then it cannot be off.
    exact: ClassVar[bool] = False
    # What the cell must switch off for the effect to vanish: 'voltage', 'draught', or '' where
    # nothing does.
    needs: ClassVar[str] = ''
    needs_whole_strokes: ClassVar[bool] = False
    needs_slope: ClassVar[bool] = False
    flux_factor: ClassVar[Callable[..., float] | None] = None
    pattern_scale: ClassVar[Callable[..., float] | None] = None

    def on_path(self, path: SprayPath, context: PathContext) -> SprayPath:
        """Return the path that really was sprayed."""
        return path

    def on_film(self, film_um: np.ndarray, points: SurfacePoints) -> np.ndarray:
        """Return the film (V,) [um] that is there in the end."""
        return film_um

    def on_gauge(self, film_um: np.ndarray, points: SurfacePoints) -> np.ndarray:
        """Return what the gauge shows (V,) [um] on that film."""
        return film_um

    def widening(self) -> float:
        """How many times wider than the model's pattern the spray can get, at least 1."""
        return 1.0

    def shadow(self) -> float:
        """Share of the flux that is stopped where the line of sight is blocked, 0 to 1."""
        return 0.0

    @property
    def is_neutral(self) -> bool:
        """Whether all amplitudes are at the value at which the effect is absent."""
        return all(getattr(self, name) == value for name, value in self._neutral().items())

    @classmethod
    def acts(cls, *places: str) -> bool:
        """Whether it defines one of these places where effects act."""
        return any(getattr(cls, place) is not getattr(Effect, place) for place in places)

    def is_off(self, switched_off: frozenset[str]) -> bool:
        """Whether the cell has switched off what the effect needs."""
        return self.needs in switched_off

    @property
    def absent(self) -> 'Effect':
        """The effect with all its amplitudes neutral."""
        return self.model_copy(update=self._neutral())

    @classmethod
    def typical(cls) -> 'Effect':
        """The effect at the size in which it occurs in practice."""
        return cls(**{name: described['typical'] for name, described in cls.parameters().items()})

    @classmethod
    def parameters(cls) -> dict[str, dict[str, Any]]:
        """Unit, bounds, neutral and typical value and role of each parameter by name."""
        return {
            name: {**info.json_schema_extra, 'description': info.description}
            for name, info in cls.model_fields.items()
            if isinstance(info.json_schema_extra, dict)
        }

    @classmethod
    def amplitudes(cls) -> tuple[str, ...]:
        """Names of the parameters that make the effect absent at their neutral value."""
        return tuple(n for n, p in cls.parameters().items() if p['role'] == 'amplitude')

    @classmethod
    @cache
    def _neutral(cls) -> dict[str, float]:
        described = cls.parameters()
        return {name: described[name]['neutral'] for name in cls.amplitudes()}

    @classmethod
    def amplitude_bounds(cls) -> tuple[np.ndarray, np.ndarray]:
        """(n,) bounds of the amplitudes, from neutral, in their typical sizes."""
        described = [cls.parameters()[name] for name in cls.amplitudes()]
        low, high = (
            np.array([(info[end] - info['neutral']) / info['typical'] for info in described])
            for end in ('low', 'high')
        )
        return low, high

    def with_amplitudes(self, amounts: np.ndarray) -> 'Effect':
        """The effect with amplitudes (n,) from neutral in their typical sizes, within bounds."""
        values = {}
        for name, amount in zip(self.amplitudes(), amounts, strict=True):
            info = self.parameters()[name]
            value = info['neutral'] + info['typical'] * amount
            values[name] = float(np.clip(value, info['low'], info['high']))
        return self.model_copy(update=values)

    @classmethod
    def coordinates(cls) -> dict[str, str]:
        """Each parameter's name where its uncertainty is about normal: shapes as logarithms."""
        return {
            name: name if info['role'] == 'amplitude' else f'log_{name}'
            for name, info in cls.parameters().items()
        }

    def values(self) -> tuple[float, ...]:
        """Parameter values in the order declared."""
        return tuple(float(getattr(self, name)) for name in self.parameters())

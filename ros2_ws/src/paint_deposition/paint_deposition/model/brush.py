"""Brushes: the settings of the atomizer that a paint programme chooses by number."""

from collections.abc import Iterable

from pydantic import BaseModel, ConfigDict, Field

from paint_deposition.model.eq1_pattern import PlanarPattern

# Messages carry the number in 32 bits.
MOST = 2**31 - 1


class SetPoints(BaseModel):
    """What the cell sets for a brush; None is not known."""

    model_config = ConfigDict(frozen=True, extra='forbid', allow_inf_nan=False)

    flow_cm3_per_min: float | None = Field(
        None, gt=0.0, le=10_000.0, description='wet paint at relative flow 1 [cm3/min]'
    )
    shaping_air_l_per_min: float | None = Field(
        None, gt=0.0, le=10_000.0, description='shaping air at standard conditions [l/min]'
    )
    bell_speed_rpm: float | None = Field(
        None, gt=0.0, le=200_000.0, description='speed of the bell cup [rev/min]'
    )
    voltage_kv: float | None = Field(
        None, gt=0.0, le=200.0, description='high voltage, its magnitude [kV]'
    )
    solids: float | None = Field(
        None, gt=0.0, le=1.0, description='share of solids in the volume of the wet paint [1]'
    )
    density_g_per_cm3: float | None = Field(
        None, gt=0.0, le=20.0, description='of the wet paint [g/cm3]'
    )


class Brush(SetPoints):
    """The pattern of eq. (1) at one setting of the atomizer.

    Attributes:
        number: by which programmes choose it, 1 to MOST.
        planar: its pattern.
    """

    number: int = Field(ge=1, le=MOST)
    planar: PlanarPattern

    @property
    def set_points(self) -> SetPoints:
        """What the cell sets for it."""
        return SetPoints(**{name: getattr(self, name) for name in SetPoints.model_fields})


def listed(numbers: Iterable[int]) -> str:
    """Numbers of brushes in words."""
    return ', '.join(map(str, sorted(numbers)))

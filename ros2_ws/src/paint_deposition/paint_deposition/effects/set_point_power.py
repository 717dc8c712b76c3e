"""How an effect's amplitudes change with a set-point of the atomizer."""

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from paint_deposition.errors import ModelError
from paint_deposition.model.brush import SetPoints


class SetPointPower(BaseModel):
    """A power law: the amplitudes as given hold at one value of the set-point."""

    model_config = ConfigDict(frozen=True, extra='forbid', allow_inf_nan=False)

    setting: Literal['flow_cm3_per_min', 'shaping_air_l_per_min', 'bell_speed_rpm', 'voltage_kv']
    at: float = Field(gt=0.0, description='value of the set-point at which the amplitudes hold')
    exponent: float = Field(ge=-5.0, le=5.0, description='power of the set-point over that value')

    def factor(self, set_points: SetPoints, whose: str) -> float:
        """By how much the amplitudes grow at other set-points.

        Raises:
            ModelError: the set-point is not known there; ``whose`` names effect and brush.
        """
        value = getattr(set_points, self.setting)
        if value is None:
            raise ModelError(f'{whose} does not tell its {self.setting}; give it to the brush')
        return (value / self.at) ** self.exponent

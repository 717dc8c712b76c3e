"""Sweep files: what is fixed and what varies."""

from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import AfterValidator, BaseModel, Field, ValidationError, model_validator

from paint_deposition.errors import BatchError
from paint_deposition.files.motion_source import MotionSource, Number, Text
from paint_deposition.files.strict_yaml import read_yaml
from paint_deposition.request import validate

MOST_CASES = 1_000_000
LIST_WORDS = 'a list of at least one value, or {first: A, last: B, steps: N}'
DISTRIBUTION_WORDS = '{normal: [mean, standard deviation]} or {uniform: [lowest, highest]}'
Model = TypeVar('Model', bound=BaseModel)


class Steps(BaseModel, extra='forbid'):
    """Evenly spaced values, both ends included."""

    first: Number
    last: Number
    steps: int = Field(ge=2, le=MOST_CASES)

    def values(self) -> list[float]:
        """All of them, rounded to 12 digits."""
        span = self.last - self.first
        return [float(f'{self.first + span * k / (self.steps - 1):.12g}')
                for k in range(self.steps)]  # fmt: skip


class Distribution(BaseModel, extra='forbid'):
    """A distribution: normal or uniform."""

    normal: tuple[Number, Number] | None = None
    uniform: tuple[Number, Number] | None = None

    @model_validator(mode='after')
    def _is_one_distribution(self) -> 'Distribution':
        if (self.normal is None) == (self.uniform is None):
            raise ValueError('give one of normal, uniform')
        if self.normal and not self.normal[1] > 0.0:
            raise ValueError('the standard deviation must be above 0')
        if self.uniform and not self.uniform[1] > self.uniform[0]:
            raise ValueError('the second number must be the greater')
        return self


def _grid(given: dict[str, Any]) -> dict[str, list[Any]]:
    values = dict(given)
    for name, listed in given.items():
        if isinstance(listed, dict):
            values[name] = _validated(Steps, name, listed, LIST_WORDS).values()
        elif not isinstance(listed, list) or not listed:
            raise ValueError(f'{name} is {listed!r}; expected {LIST_WORDS}')
    return values


def _distributions(given: dict[str, Any]) -> dict[str, Distribution]:
    return {
        name: _validated(Distribution, name, values, DISTRIBUTION_WORDS)
        for name, values in given.items()
    }


def _validated(model: type[Model], name: str, given: Any, expected: str) -> Model:
    try:
        return model.model_validate(given)
    except ValidationError:
        raise ValueError(f'{name} is {given!r}; expected {expected}') from None


class Sample(BaseModel, extra='forbid'):
    """Variations drawn at random."""

    count: int = Field(ge=1, le=MOST_CASES, description='how many draws, at least 1')
    seed: int = Field(0, description='a whole number, the seed of the draws')
    posterior: bool = Field(
        False, description="whether the model's parameters are drawn from its posterior"
    )
    vary: Annotated[dict[str, Any], AfterValidator(_distributions)] = Field(
        {}, description='a distribution for each name'
    )


class Passes(BaseModel, extra='forbid'):
    """How passes are planned where no recording is given: fields of ``PlanRequest``."""

    direction: Literal['horizontal', 'vertical'] = Field(
        'horizontal', description="'horizontal' or 'vertical'"
    )
    speed_m_per_s: Number | None = Field(None, gt=0.0, description='speed of the passes [m/s]')
    target_um: Number | None = Field(None, gt=0.0, description='mean film wanted [um]')
    index_m: Number | None = Field(None, gt=0.0, description='distance between passes [m]')
    standoff_m: Number | None = Field(None, gt=0.0, description='TCP to surface [m]')
    one_way: bool = Field(False, description='whether all passes run one way')


class SweepFile(MotionSource, extra='forbid'):
    """A sweep as it is written; paths are relative to the file."""

    mesh: Text | None = Field(None, description='the name of a mesh file')
    trajectory: Text | None = Field(None, description='the name of a recording, module or table')
    model: Text | None = Field(None, description='the name of a model file')
    readings: Text | None = Field(
        None, description='the name of a file of points at which the gauge is predicted'
    )
    mesh_scale: Number = Field(1.0, gt=0.0, description='metres per unit of the mesh')
    body: Text | None = Field(None, description='the name of the one body to take of the mesh')
    max_edge_length_m: Number = Field(0.02, gt=0.0, description='longest edge of the mesh [m]')
    target_um: Number = Field(0.0, ge=0.0, le=1e4, description='film wanted [um]')
    tolerance_um: Number = Field(0.0, ge=0.0, le=1e4, description='what it may differ [um]')
    passes: Passes = Field(Passes(), description='keys that say how passes are planned')
    grid: Annotated[dict[str, Any], AfterValidator(_grid)] = Field(
        {}, description='values by name'
    )
    cases: list[dict[str, Any]] = Field(
        [], description='a list of cases, each with what it varies and its value'
    )
    sample: Sample | None = Field(None, description='the keys count, seed, posterior, vary')


def read_sweep(path: str | Path) -> SweepFile:
    """Read a sweep file; its paths stay as written.

    Raises:
        BatchError: naming the file, the key at fault and the remedy.
    """
    path = Path(path)
    content = read_yaml(path, 'sweep', BatchError)
    if not isinstance(content, dict):
        raise BatchError(f'{path}: is not a sweep; expected the keys mesh, trajectory and grid')
    file = validate(SweepFile, f'{path}: sweep', content, BatchError)
    if not (file.grid or file.cases or file.sample):
        raise BatchError(f'{path}: nothing varies; give one of grid, cases, sample')
    return file

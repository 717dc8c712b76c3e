"""Sweep files: what is fixed and what varies."""

import sys
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, Field

from paint_deposition.errors import BatchError
from paint_deposition.files.motion_files import MotionSource
from paint_deposition.files.strict_yaml import read_yaml
from paint_deposition.request import Number, Text, validate

MOST_CASES = 1_000_000
LIST_WORDS = 'a list of at least one value, or {first: A, last: B, steps: N}'
DISTRIBUTION_WORDS = '{normal: [mean, standard deviation]} or {uniform: [lowest, highest]}'


def is_number(value: Any) -> bool:
    """Whether a value is a finite number."""
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return number and abs(value) <= sys.float_info.max


def _grid(given: dict[str, Any]) -> dict[str, list[Any]]:
    """The values of each name: as listed, or evenly spaced, both ends included."""
    values = dict(given)
    for name, listed in given.items():
        if isinstance(listed, dict) and {*listed} == {'first', 'last', 'steps'}:
            first, last, steps = listed['first'], listed['last'], listed['steps']
            whole = isinstance(steps, int) and 2 <= steps <= MOST_CASES
            if whole and all(map(is_number, (first, last))):
                span, ends = last - first, steps - 1
                values[name] = [float(f'{first + span * k / ends:.12g}') for k in range(steps)]
                continue
        if not isinstance(listed, list) or not listed:
            raise ValueError(f'{name} is {listed!r}; expected {LIST_WORDS}')
    return values


def _distributions(given: dict[str, Any]) -> dict[str, tuple[str, float, float]]:
    """Of each name whether it is normal or uniform, and its two numbers."""
    found = {}
    for name, said in given.items():
        ((kind, numbers), *more) = said.items() if isinstance(said, dict) and said else [('', [])]
        two = isinstance(numbers, list) and len(numbers) == 2 and all(map(is_number, numbers))
        if more or not two or kind not in ('normal', 'uniform'):
            raise ValueError(f'{name} is {said!r}; expected {DISTRIBUTION_WORDS}')
        low, high = map(float, numbers)
        # A standard deviation is above 0, the greatest above the lowest.
        if not high > (0.0 if kind == 'normal' else low):
            raise ValueError(f'{name} is {said!r}; expected {DISTRIBUTION_WORDS}')
        found[name] = kind, low, high
    return found


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

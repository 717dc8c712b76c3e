"""Sweep files: what is fixed and what varies, by the grid, the cases and the draws of a sweep."""

import math
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BaseModel, Field
from scipy.spatial.transform import Rotation

from paint_deposition.effects.base import Effect
from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import BatchError, did_you_mean, quoted
from paint_deposition.files.atomic import read_yaml
from paint_deposition.model.eq1_pattern import PlanarPattern
from paint_deposition.model.eq2_projection import Projection
from paint_deposition.motion.trajectory import Trajectory
from paint_deposition.request import (
    POSE_FORMAT,
    MotionOptions,
    Number,
    OnePart,
    Text,
    is_pose,
    validate,
)

INPUTS = ('mesh', 'trajectory', 'model')
# Of passes that are planned, and of a recording as it was.
PASS_KEYS = ('index_m', 'standoff_m', 'speed_m_per_s')
MOTION_KEYS = ('speed_factor', 'standoff_change_m', 'flow_factor')
SECTIONS: dict[str, type[BaseModel]] = {'planar': PlanarPattern, 'projection': Projection}
# Which draw from the posterior a case has.
DRAW = 'draw'

Values = dict[str, Any]
MOST_CASES = 1_000_000
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
            raise ValueError(
                f'{name} is {quoted(listed)}; expected a list of at least one value, or '
                '{first: A, last: B, steps: N}'
            )
    return values


def _distributions(given: dict[str, Any]) -> dict[str, tuple[str, float, float]]:
    """Of each name whether it is normal or uniform, and its two numbers."""
    found = {}
    for name, said in given.items():
        ((kind, numbers), *more) = said.items() if isinstance(said, dict) and said else [('', [])]
        two = isinstance(numbers, list) and len(numbers) == 2 and all(map(is_number, numbers))
        if more or not two or kind not in ('normal', 'uniform'):
            raise ValueError(f'{name} is {quoted(said)}; expected {DISTRIBUTION_WORDS}')
        low, high = map(float, numbers)
        # A standard deviation is above 0, the greatest above the lowest.
        if not high > (0.0 if kind == 'normal' else low):
            raise ValueError(f'{name} is {quoted(said)}; expected {DISTRIBUTION_WORDS}')
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


class SweepFile(MotionOptions, OnePart, extra='forbid'):
    """A sweep as it is written; paths are relative to the file."""

    mesh: Text | None = Field(None, description='the name of a mesh file')
    trajectory: Text | None = Field(None, description='the name of a recording, module or table')
    model: Text | None = Field(None, description='the name of a model file')
    readings: Text | None = Field(
        None, description='the name of a file of points at which the gauge is predicted'
    )
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


def effects_of(models: Iterable[DepositionModel]) -> dict[str, type[Effect]]:
    """Effects by id: those of the library, and users' own that the models have."""
    own = {e.id: type(e) for model in models for e in model.effects if e.file is not None}
    return {**EFFECTS, **own}


def variations(file: SweepFile, models: Sequence[DepositionModel] = ()) -> list[Values]:
    """The values of each case, in the order grid, cases, draws, the last one running fastest.

    Args:
        file: the sweep.
        models: that it names; the parameters of their effects may vary.

    Raises:
        BatchError: an unknown name, a name in two blocks, or too many cases.
    """
    drawn = list(file.sample.vary) if file.sample else []
    names = [list(file.grid), sorted({n for case in file.cases for n in case}), drawn]
    seen: set[str] = set()
    effects = effects_of(models).values()
    known = [
        *INPUTS, 'part_pose', 'effects', *PASS_KEYS, *MOTION_KEYS,
        *(f'{section}.{n}' for section, cls in SECTIONS.items() for n in cls.model_fields),
        *(f'{effect.id}.{n}' for effect in effects for n in effect.parameters()),
    ]  # fmt: skip
    for name in (name for block in names for name in block):
        _require_known(name, known)
        if name in seen:
            raise BatchError(f'{name} varies twice, in two of grid, cases, sample; keep one')
        seen.add(name)
    draws = file.sample.count if file.sample else 1
    count = math.prod(map(len, file.grid.values())) * max(len(file.cases), 1) * draws
    if count > MOST_CASES:
        raise BatchError(f'{count} cases are more than {MOST_CASES}; vary less at once')
    grid = [dict(zip(file.grid, values, strict=True)) for values in product(*file.grid.values())]
    drawn_values: list[Values] = [{}] * draws
    if file.sample:
        rng = np.random.default_rng(file.sample.seed)
        columns = {
            name: getattr(rng, kind)(low, high, draws).tolist()
            for name, (kind, low, high) in file.sample.vary.items()
        }
        columns |= {DRAW: list(range(draws))} if file.sample.posterior else {}
        drawn_values = [{name: c[k] for name, c in columns.items()} for k in range(draws)]
    blocks = product(grid, file.cases or [{}], drawn_values)
    found = [{**of_grid, **case, **draw} for of_grid, case, draw in blocks]
    for values in found:
        for name, value in values.items():
            _require_kind(name, value)
    return found


def _require_known(name: str, known: Sequence[str]) -> None:
    if name not in known:
        near = [other for other in known if other.split('.')[-1] == name]
        owner, dot, _ = name.partition('.')
        if dot and not any(other.startswith(f'{owner}.') for other in known):
            owners = dict.fromkeys(other.partition('.')[0] for other in known if '.' in other)
            raise BatchError(
                f'{name} cannot vary: no effect {owner!r} is in the library or in a model of the '
                f'sweep; {did_you_mean(owner, owners)}'
            )
        remedy = f'did you mean {near[0]!r}?' if near else did_you_mean(name, known)
        raise BatchError(f'nothing called {name!r} can vary; {remedy}')


def _require_kind(name: str, value: Any) -> None:
    """Refuse a value of another kind than its name has."""
    many = value if isinstance(value, list) else []
    if name in INPUTS:
        holds, expected = isinstance(value, str), 'the name of a file'
    elif name == 'part_pose':
        holds, expected = all(map(is_number, many)) and is_pose(many), POSE_FORMAT
    elif name == 'effects':
        holds = isinstance(value, list) and all(isinstance(one, str) for one in value)
        expected = 'a list of effects of the model, [] for none'
    elif name in (*PASS_KEYS, 'speed_factor', 'flow_factor'):
        holds = is_number(value) and value > 0.0
        expected = f'a number{" above 0" if is_number(value) else ""}'
    else:
        holds, expected = is_number(value), 'a number'
    if not holds:
        raise BatchError(f'{name} is {quoted(value)}; expected {expected}')


def varied_model(
    model: DepositionModel, values: Values, effects: Mapping[str, type[Effect]] = EFFECTS
) -> DepositionModel:
    """The model with the values of a case; an effect that it lacks is added.

    Args:
        model: as in its file.
        values: of the case.
        effects: that may be added, by id.

    Raises:
        BatchError: a value that the parameter cannot have, or an effect that the model has not.
    """
    if 'effects' in values:
        has, wanted = [effect.id for effect in model.effects], values['effects']
        for effect_id in wanted:
            if effect_id not in has:
                raise BatchError(f'the model has no effect {effect_id!r}; it has: {has or "none"}')
        kept = tuple(effect for effect in model.effects if effect.id in wanted)
        model = model.model_copy(update={'effects': kept})
    for name, value in values.items():
        owner, dot, field = name.partition('.')
        if not dot:
            continue
        if owner == 'planar' and model.brushes:
            raise BatchError(
                f'{name} varies, but the model has a pattern for each brush; give a model of one'
            )
        if owner in SECTIONS:
            section = _changed(getattr(model, owner), field, value, name)
            model = model.model_copy(update={owner: section})
        else:
            effect = model.effect(owner) or effects[owner]()
            model = model.with_effect(_changed(effect, field, value, name))
    return model


def _changed(section: Any, field: str, value: float, name: str) -> Any:
    """A copy with one value, checked as a model file's is."""
    values = section.model_dump() | {field: float(value)}
    return validate(type(section), name.partition('.')[0], values, BatchError)


def varied_motion(
    trajectory: Trajectory,
    speed_factor: float = 1.0,
    standoff_change_m: float = 0.0,
    flow_factor: float = 1.0,
) -> Trajectory:
    """The motion of a case: changed, or as it is where nothing is asked for.

    Args:
        trajectory: as recorded.
        speed_factor: all times from the first pose on are divided by it, those of the trigger too.
        standoff_change_m: the TCP moves back along the tool's axis by it; negative is nearer [m].
        flow_factor: on the flow of the trigger. Without a trigger the gun sprays all the time.
    """
    if speed_factor != 1.0 and len(trajectory):
        first = trajectory.stamps_ns[0]
        stamps, triggers = (
            first + np.round((stamps - first) / speed_factor).astype(np.int64)
            for stamps in (trajectory.stamps_ns, trajectory.trigger_stamps_ns)
        )
        trajectory = replace(trajectory, stamps_ns=stamps, trigger_stamps_ns=triggers)
    if standoff_change_m != 0.0:
        tool_z = Rotation.from_quat(trajectory.quaternions_xyzw).apply([0.0, 0.0, 1.0])
        moved = trajectory.positions_m - standoff_change_m * tool_z
        trajectory = replace(trajectory, positions_m=moved)
    if flow_factor != 1.0:
        stamps, flow = trajectory.trigger_stamps_ns, trajectory.trigger_flow
        if not len(stamps):
            stamps, flow = trajectory.stamps_ns[:1], np.ones(1)
        trajectory = replace(trajectory, trigger_stamps_ns=stamps, trigger_flow=flow_factor * flow)
    return trajectory

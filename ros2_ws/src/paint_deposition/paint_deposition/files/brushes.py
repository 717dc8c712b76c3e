"""The brushes of a model file: patterns and set-points by number."""

from collections.abc import Mapping
from typing import Any

from paint_deposition.errors import ModelError, did_you_mean
from paint_deposition.files.refusals import checked
from paint_deposition.model.brush import MOST, Brush, SetPoints
from paint_deposition.model.pattern import PlanarPattern

PLANAR = 'planar'
KEYS = (PLANAR, *SetPoints.model_fields)


def read_brushes(section: Mapping[Any, Any]) -> list[Brush]:
    """The brushes of a section, in its order.

    Raises:
        ModelError: one line that names the brush, the key, its value and the remedy.
    """
    if not section:
        raise ModelError('brushes is empty; give a brush by its number, or planar')
    for number in section:
        if isinstance(number, bool) or not isinstance(number, int) or not 1 <= number <= MOST:
            raise ModelError(f'brushes: {number!r} is no number of a brush; give 1, 2 and so on')
    return [_brush(number, entry) for number, entry in section.items()]


def _brush(number: int, entry: Any) -> Brush:
    where = f'brushes, {number}'
    if not isinstance(entry, dict):
        raise ModelError(f'{where} is {entry!r}; expected a mapping (key: value)')
    for key in entry:
        if key not in KEYS:
            raise ModelError(f'{where}: unknown key {key!r}; {did_you_mean(key, KEYS)}')
    settings = {key: value for key, value in entry.items() if key != PLANAR}
    set_points = checked(SetPoints, where, settings, ModelError)
    if not isinstance(entry.get(PLANAR), dict):
        raise ModelError(f'{where}: planar is {entry.get(PLANAR)!r}; expected a mapping')
    planar = checked(PlanarPattern, f'{where}: planar', entry[PLANAR], ModelError)
    return Brush(number=number, planar=planar, **set_points.model_dump())

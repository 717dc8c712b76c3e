"""The brushes of a model file: patterns and set-points by number."""

from collections.abc import Mapping
from typing import Any

from paint_deposition.errors import ModelError, did_you_mean
from paint_deposition.files.refusals import checked
from paint_deposition.model.brush import MOST, Brush, BrushLaw, SetPoints
from paint_deposition.model.eq1_pattern import PlanarPattern

PLANAR = 'planar'
KEYS = (PLANAR, *SetPoints.model_fields)


def read_brushes(section: Mapping[Any, Any]) -> list[Brush]:
    """The brushes of a section; those without a pattern are interpolated between the others.

    Raises:
        ModelError: one line that names the brush, the key, its value and the remedy.
    """
    if not section:
        raise ModelError('brushes is empty; give a brush by its number, or planar')
    for number in section:
        if isinstance(number, bool) or not isinstance(number, int) or not 1 <= number <= MOST:
            raise ModelError(f'brushes: {number!r} is no number of a brush; give 1, 2 and so on')
    read = {number: _read(number, entry) for number, entry in section.items()}
    calibrated = [_brush(n, planar, at) for n, (planar, at) in read.items() if planar]
    law = BrushLaw(tuple(calibrated))
    between = [
        _brush(n, law.pattern(f'brushes, {n}', at), at, interpolated=True)
        for n, (planar, at) in read.items()
        if planar is None
    ]
    return [*calibrated, *between]


def _brush(number: int, planar: PlanarPattern, at: SetPoints, interpolated: bool = False) -> Brush:
    return Brush(number=number, planar=planar, interpolated=interpolated, **at.model_dump())


def _read(number: int, entry: Any) -> tuple[PlanarPattern | None, SetPoints]:
    """Pattern, None where it is to be interpolated, and set-points of an entry."""
    where = f'brushes, {number}'
    if not isinstance(entry, dict):
        raise ModelError(f'{where} is {entry!r}; expected a mapping (key: value)')
    for key in entry:
        if key not in KEYS:
            raise ModelError(f'{where}: unknown key {key!r}; {did_you_mean(key, KEYS)}')
    settings = {key: value for key, value in entry.items() if key != PLANAR}
    set_points = checked(SetPoints, where, settings, ModelError)
    if PLANAR not in entry:
        return None, set_points
    if not isinstance(entry[PLANAR], dict):
        raise ModelError(f'{where}: planar is {entry[PLANAR]!r}; expected a mapping')
    return checked(PlanarPattern, f'{where}: planar', entry[PLANAR], ModelError), set_points

"""The coats of a campaign's experiment: which guns laid each, and what its readings are of."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from paint_deposition.errors import ReadingsError
from paint_deposition.film.common_film import TOTAL, Coats, WetFilms
from paint_deposition.inference.readings.readings import Readings
from paint_deposition.model.eq1_pattern import MOST, listed
from paint_deposition.motion.path import SprayPath
from paint_deposition.motion.trajectory import ONLY_BRUSH
from paint_deposition.request import MotionOptions, Name, Number, Text, validate


class _Gun(MotionOptions):
    """One of several guns; what it does not say holds for it as for the coat or experiment."""

    trajectory: Text | None = Field(None, description='the name of a recording, module or table')
    brush: Annotated[int, Field(strict=True, ge=1, le=MOST)] | None = Field(
        None, description='the number of the brush, where the recording names none'
    )


class PaintJob(_Gun):
    """What is painted in one go: an experiment, or one of its coats.

    What a coat does not say holds for it as for the experiment.
    """

    name: Name = ''
    guns: list[Any] = Field(
        [], description='a list of guns that painted together, each with its motion'
    )
    solids: Number | None = Field(
        None, gt=0.0, le=1.0, description='share of solids in the volume of the wet paint [1]'
    )
    wet_on_wet: bool = Field(
        False, description='true or false, whether the coat before it was still wet'
    )


# A gun as a campaign names it: the file of its motion, what to read of that, and its brush, where
# the file names none.
GunMotion = tuple[str, MotionOptions, int | None]


def with_brush(path: SprayPath, brush: int | None) -> SprayPath:
    """The path with the brush of a campaign, or ReadingsError if its recording names another."""
    if brush is None:
        return path
    others = set(path.brush[path.flow > 0.0].tolist()) - {ONLY_BRUSH, brush}
    if others:
        raise ReadingsError(
            f'brush is {brush}, and the recording names {listed(others)}; leave it out'
        )
    return path.with_(brush=np.full(len(path), brush))


def laid_coats(
    folder: Path, entry: PaintJob, written: Sequence[Any]
) -> tuple[Coats, list[GunMotion], list[float | None]]:
    """The coats that an experiment lists, else the one that it is, and their guns in order.

    Then the share of solids in the paint of each coat, None where it is not said.

    Raises:
        ReadingsError: naming the coat or the gun and the key at fault.
    """
    coats = [
        validate(PaintJob, f'coat {number}', one, ReadingsError)
        for number, one in enumerate(written, start=1)
    ]
    called = [coat.name for coat in coats]
    if twice := [name for name in called if called.count(name) > 1]:
        raise ReadingsError(f"two coats are called '{twice[0]}'; rename one, or list guns")
    guns: list[GunMotion] = []
    names: list[str] = []
    jobs: Sequence[PaintJob] = coats or [entry]
    for coat in jobs:
        given = coat.guns or ([] if coat.trajectory else entry.guns) or [{}]
        for number, one in enumerate(given, start=1):
            gun = validate(_Gun, f'gun {number}', one, ReadingsError)
            whose = f"coat '{coat.name}'" if coats else 'it'
            whose = whose if given == [{}] else f'gun {number}'
            guns.append(_motion(folder, (gun, coat, entry), whose))
        names += [coat.name] * len(given) * bool(coats)
    says = {coat.name: coat if 'wet_on_wet' in coat.model_fields_set else entry for coat in coats}
    on_wet = {name for name, job in says.items() if job.wet_on_wet}
    solids = [entry.solids if coat.solids is None else coat.solids for coat in jobs]
    return Coats.of_guns(names, len(guns), on_wet), guns, solids


def laid_path(coats: Coats, layer: str, paths: Sequence[SprayPath]) -> tuple[SprayPath, WetFilms]:
    """The path of the guns that laid a layer, and the wet films that it is the sum of.

    ``paths`` are those of all guns in the order of painting.
    """
    films = coats.films_of(layer)
    chosen = sorted({k for _, rows in films for k in range(len(paths))[rows]})
    ends = np.cumsum([0, *(len(paths[k]) for k in chosen)]).tolist()
    start = {k: ends[place] for place, k in enumerate(chosen)}
    stop = {k: ends[place + 1] for place, k in enumerate(chosen)}
    steps = tuple((sign, slice(start[rows.start], stop[rows.stop - 1])) for sign, rows in films)
    return SprayPath.of_guns([paths[k] for k in chosen]), steps


def solids_of(layer: str, coats: Coats, solids: Sequence[float | None]) -> float:
    """The share of solids in the paint of a layer, whose coats have these where they are known.

    Raises:
        ReadingsError: the solids of the coats are not known or differ.
    """
    its = layer.split('+') if layer != TOTAL else coats.names
    shares = {solids[coats.names.index(coat)] for coat in its}
    share = shares.pop()
    if share is None or shares:
        of = 'the paint' if coats.names == ('',) else f"layer '{layer}'"
        what = 'differ' if shares else 'are not said'
        raise ReadingsError(
            f'the readings are wet, and the solids of {of} {what}; give each coat its solids, '
            '0.45 say, and name the one that was read in the column layer'
        )
    return share


def dried(readings: Readings, share: float) -> Readings:
    """Readings of a wet film as the dry film that a share of solids leaves.

    Where all are teeth of a comb, the film is as likely anywhere between the tooth that is read
    and the next.
    """
    wet_um, sigma_um, words = readings.thickness_um, readings.sigma_um, ''
    teeth = np.unique(wet_um)
    # The teeth stand in steps of 5 um or more; two may do so by chance.
    is_comb = len(teeth) >= 3 and not np.any(teeth % 5.0)
    if is_comb and np.isnan(sigma_um).all():
        step_um = float(np.diff(teeth).min())
        wet_um, sigma_um = wet_um + 0.5 * step_um, np.full(len(wet_um), step_um / 12**0.5)
        words = f'; a comb in steps of {step_um:g} µm, half of which is added'
    return replace(
        readings, thickness_um=share * wet_um, sigma_um=share * sigma_um,
        understood=f'{readings.understood}{words}; wet film, times {share:g} solids',
    )  # fmt: skip


def _motion(folder: Path, levels: Sequence[_Gun], whose: str) -> GunMotion:
    """The motion of a gun from what it says itself, its coat, and its experiment."""
    said: dict[str, Any] = {}
    for one in reversed(levels):
        given = {key: getattr(one, key) for key in one.model_fields_set}
        said |= {key: value for key, value in given.items() if value is not None}
    file = said.get('trajectory')
    if file is None:
        raise ReadingsError(
            f"{whose} has no 'trajectory'; give the name of a recording, RAPID module or table"
        )
    source = MotionOptions(
        **{key: v for key, v in said.items() if key in MotionOptions.model_fields}
    )
    if source.urdf:
        source = source.model_copy(update={'urdf': str(folder / source.urdf)})
    return str(folder / file), source, said.get('brush')

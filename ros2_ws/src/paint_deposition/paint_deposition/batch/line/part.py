"""One run of a line, as a worker computes it: its film, and what its readings say."""

import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from datetime import datetime, timezone
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from paint_deposition.api.simulation import look_at
from paint_deposition.batch.line.pooling import amplitudes
from paint_deposition.batch.line.runs import LineFile, Run
from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import ManyError, PaintError
from paint_deposition.files.gauge_readings import read_readings
from paint_deposition.files.meshes import read_mesh
from paint_deposition.files.motion_files import read_motion
from paint_deposition.film.integrator import FilmIntegrator
from paint_deposition.film.statistics import film_statistics
from paint_deposition.inference.diagnosis.explanations import sensitivity_um
from paint_deposition.inference.fitting.least_squares import derivatives
from paint_deposition.inference.fitting.parameters import FreeParameters
from paint_deposition.inference.fitting.study import Study
from paint_deposition.inference.readings.campaign import Campaign, Experiment
from paint_deposition.motion.path import SprayPath
from paint_deposition.part.surface import Surface

# Stamps before this are no dates: clocks of simulations and controllers begin at 0.
EARLIEST_S = 946684800.0
DATE = re.compile(r'(\d{4})-?(\d{2})-?(\d{2})(?:[T_-]?(\d{2})[-:h]?(\d{2})(?:[-:m]?(\d{2}))?)?')
FIGURES = ('mean_um', 'std_dev_um', 'coverage', 'painted_volume_cm3', 'emitted_volume_cm3')
Columns = dict[str, list[Any]]


def computed(case: Mapping[str, Any]) -> Columns:
    """Rows of a run: one for each measured point, or a single one.

    Args:
        case: ``run``, ``file`` (the line's), ``folder`` and ``model``.

    A run that cannot be used says why in the column ``error``, a part whose readings cannot be
    used says so in ``remark``.
    """
    run: Run = case['run']
    try:
        if run.problem:
            raise ManyError(run.problem)
        rows = _rows(run, case['file'], Path(case['folder']), case['model'])
    except PaintError as error:
        rows = [{'part': run.name, 'error': str(error)}]
    return {name: [row[name] for row in rows] for name in rows[0]}


def _rows(run: Run, file: LineFile, folder: Path, model: DepositionModel) -> list[dict[str, Any]]:
    down = None if file.down is None else tuple(file.down)
    surface = _read_surface(
        folder / file.mesh, file.mesh_scale, file.max_edge_length_m, down, file.body
    )
    motion = read_motion(run.path, file)
    seen = look_at(surface, motion, model, max_pose_gap_s=file.max_pose_gap_s)
    stamp_s = 1e-9 * float(motion.stamps_ns[0])
    named_s = _date(run.name)
    time_s = stamp_s if stamp_s > EARLIEST_S else named_s
    if time_s is None:
        raise ManyError(
            f'{run.path}: the time of painting is unknown; put the date into its name, '
            'such as 2026-11-12_0730, or record with the time of day'
        )
    unused = run.remark
    rows: list[dict[str, Any]] = []
    if run.readings is not None:
        points = folder / file.points if file.points else None
        try:
            readings = read_readings(run.readings, points, surface=seen.surface)
            experiment = Experiment.of(run.name, seen.surface, seen.path, readings)
            rows = list(_measured(experiment, model))
        except PaintError as error:
            unused = str(error).removeprefix(f'{folder}/')
    remarks = [line.removeprefix(f'{run.path}: ') for line in seen.trajectory.warnings]
    remarks += [*seen.geometry.warnings, *([f'simulated only: {unused}'] if unused else [])]
    known = {'part': run.name, 'time_s': time_s, 'named_s': named_s, 'remark': '; '.join(remarks)}
    known |= _film(seen.surface, seen.path, model)
    return [known | row for row in rows or [{}]]


def _date(name: str) -> float | None:
    """Seconds since 1970 of the first date in the name of a run, None for none."""
    if found := DATE.search(name):
        with suppress(ValueError):
            year, month, day, hour, minute, second = (int(part or 0) for part in found.groups())
            there = datetime(year, month, day, hour, minute, second, tzinfo=timezone.utc)
            return there.timestamp()
    return None


@lru_cache(maxsize=4)
def _read_surface(
    path: Path, scale: float, edge_m: float, down: tuple[float, ...] | None, body: str | None
) -> Surface:
    return read_mesh(path, scale, edge_m, None if down is None else np.array(down), body)


def _film(surface: Surface, path: SprayPath, model: DepositionModel) -> dict[str, float | None]:
    painted = FilmIntegrator(surface.points(), model, occluder=surface.occluder)
    painted.add(path)
    figures = film_statistics(
        painted.film_um, surface.vertex_areas_m2, painted.emitted_cm3
    ).to_dict()
    return {f'film_{name}': figures[name] for name in FIGURES}


def _measured(experiment: Experiment, model: DepositionModel) -> Iterator[dict[str, Any]]:
    """A row for each point, with the derivatives that pooling needs."""
    study = Study.of(Campaign((experiment,)), tuple(effect() for effect in EFFECTS.values()))
    parameters = FreeParameters.of(model)
    by_pattern = derivatives(
        study.forward, parameters, parameters.encode(model), np.ones(len(study))
    )
    predicted_um = study.forward.predict_um(model)
    effects = {e.id: model.effect(e.id) or e() for e in EFFECTS.values()}
    by_effect = np.column_stack([
        sensitivity_um(study.forward, model, effects[effect], name, predicted_um)
        for effect, name in amplitudes()
    ])  # fmt: skip
    campaign = study.campaign
    for row in range(len(study)):
        first = campaign.means.first[row]
        x, y, z = campaign.positions_m[row].tolist()
        yield {
            'point': str(campaign.experiments[0].readings.point[first]),
            'x_m': x, 'y_m': y, 'z_m': z,
            'repeats': int(campaign.means.repeats[row]),
            'measured_um': float(study.measured_um[row]),
            'sigma_um': float(study.sigma_um[row]),
            'predicted_um': float(predicted_um[row]),
            'by_pattern': by_pattern[row].tolist(),
            'by_effect': by_effect[row].tolist(),
        }  # fmt: skip

"""One case of a sweep, as a worker computes it: by the functions that the commands go through."""

import hashlib
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from paint_deposition.api.planning import plan
from paint_deposition.api.simulation import simulate
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import PaintError
from paint_deposition.inference.readings.readings import Readings
from paint_deposition.motion.trajectory import Trajectory
from paint_deposition.part.surface import Surface

# Columns that hold a list in each row: the film at every vertex, the gauge at every reading.
PREDICTED = 'predicted_um'
WARNINGS = 'warnings'
Columns = dict[str, list[Any]]


def computed(
    parameters: Mapping[str, Any],
    surface: Surface,
    trajectory: Trajectory | None,
    readings: Readings | None,
) -> Columns:
    """The figures of a case, one row; a case without a film says why in the column ``error``.

    Args:
        parameters: ``model``, ``motion``, ``passes``, ``target_um``, ``tolerance_um``.
        surface: the part. trajectory: the motion; None: passes are planned.
        readings: places at which the gauge is predicted, or None.
    """
    model: DepositionModel = parameters['model']
    figures: dict[str, Any] = {}
    try:
        if trajectory is None:
            planned = plan(surface, model, **parameters['passes'])
            trajectory = planned.trajectory
            figures |= {'passes': len(planned.passes), 'cycle_time_s': planned.cycle_time_s}
        film = simulate(
            surface, varied_motion(trajectory, **parameters['motion']), model, readings=readings,
            target_um=parameters['target_um'], tolerance_um=parameters['tolerance_um'],
        )  # fmt: skip
    except PaintError as error:
        return {'error': [str(error)]}
    statistics = film.statistics
    figures |= {
        **statistics.to_dict(),
        'sigma_n': statistics.std_dev_um / statistics.mean_um if statistics.mean_um else None,
        'spraying_time_s': film.path.spraying_time_s,
        'film_sha256': hashlib.sha256(film.film_um.tobytes()).hexdigest(),
        WARNINGS: '; '.join(film.warnings),
    }
    if film.predicted_um is not None:
        figures[PREDICTED] = film.predicted_um.tolist()
    return {name: [value] for name, value in figures.items()}


def varied_motion(
    trajectory: Trajectory,
    speed_factor: float = 1.0,
    standoff_change_m: float = 0.0,
    flow_factor: float = 1.0,
) -> Trajectory:
    """The same motion, changed; as it is where nothing is asked for.

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

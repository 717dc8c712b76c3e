"""Readings without noise on the sample door and on a panel, and fits that know the model."""

from dataclasses import replace

import numpy as np

from booth import MODEL, door, painted, panel, path_of, serpentine
from paint_deposition.inference.fitting.least_squares import Fit
from paint_deposition.inference.fitting.parameters import FreeParameters
from paint_deposition.inference.fitting.study import Study
from paint_deposition.inference.readings.campaign import Campaign, Experiment
from paint_deposition.inference.readings.readings import Readings
from paint_deposition.part.surface import Surface

# Two passes of few sub-steps, over the door's arch and edges and over the panel.
PASSES_M = {'door': (0.75, 0.45), 'panel': (0.05, -0.1)}
LEAST_UM = 1.0

# A door of the virtual paint shop, and one with a shielded valley.
DOOR = {
    'experiments': ('door',), 'readings': 60, 'repeats': 20, 'style': 'random',
    'parcels': 2_000_000, 'amplitude': None,
}  # fmt: skip
SHIELDED = DOOR | {'seed': 3, 'truth': 'faraday_shielding', 'amplitude': 0.35}


def measured(surface: Surface, name: str, count: int = 24, **options) -> Experiment:
    """An experiment with readings at places that got some paint."""
    path = path_of(serpentine(PASSES_M[name], opens_at_m=0.3, period_s=0.1))
    film_um = painted(surface, path).raw_um
    at = np.random.default_rng(1).choice(np.flatnonzero(film_um > LEAST_UM), count, replace=False)
    readings = Readings.of(surface.vertices_m[at], film_um[at], normals=surface.normals[at])
    return Experiment.of(name, surface, path, readings, **options)


def study_of(*experiments: Experiment) -> Study:
    return Study.of(Campaign(experiments))


def on_door(**options) -> Experiment:
    return measured(door(), 'door', **options)


def on_panel(name: str = 'panel') -> Experiment:
    return replace(measured(panel(0.4, 0.04), 'panel'), name=name)


def plate_with_a_back() -> Experiment:
    """A panel with a reading on its other side."""
    front = panel(0.4, 0.04)
    back = front.vertices_m - [0.0, 0.002, 0.0], front.faces[:, ::-1] + len(front.vertices_m)
    plate = Surface.from_triangles(
        np.concatenate([front.vertices_m, back[0]]), np.concatenate([front.faces, back[1]]), 0.04
    )
    part = measured(plate, 'panel')
    behind = part.readings.positions_m[0] - [0.0, 0.002, 0.0]
    readings = Readings.of(
        np.vstack([part.readings.positions_m, behind]),
        np.append(part.readings.thickness_um, 0.0),
        normals=np.vstack([part.readings.normals, -part.readings.normals[0]]),
    )
    return Experiment.of('plate', plate, part.path, readings)


def at_model(study: Study, model=MODEL) -> Fit:
    """A fit that has found this model."""
    parameters = FreeParameters.of(model, *model.effects)
    return study.beside(parameters, parameters.encode(model))

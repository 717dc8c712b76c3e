"""Readings without noise on the sample door and on a panel, and fits that know the model."""

from dataclasses import replace

import numpy as np

import paint_deposition as pd
from booth import MODEL, door, painted, panel, path_of, serpentine
from paint_deposition.inference.fitting.parameters import FreeParameters
from paint_deposition.inference.fitting.study import Study
from paint_deposition.inference.readings.campaign import Experiment

# Two passes of few sub-steps, over the door's arch and edges and over the panel.
PASSES_M = {'door': (0.75, 0.45), 'panel': (0.05, -0.1)}

# A door of the virtual paint shop, and one with a shielded valley.
DOOR = {
    'experiments': ('door',), 'readings': 60, 'repeats': 20, 'style': 'random',
    'parcels': 2_000_000, 'amplitude': None,
}  # fmt: skip
SHIELDED = DOOR | {'seed': 3, 'truth': 'faraday_shielding', 'amplitude': 0.35}


def measured(surface: pd.Surface, name: str, count: int = 24, **options) -> Experiment:
    """An experiment with readings at places that got some paint."""
    path = path_of(serpentine(PASSES_M[name], opens_at_m=0.3, period_s=0.1))
    film_um = painted(surface, path).raw_um
    at = np.random.default_rng(1).choice(np.flatnonzero(film_um > 1.0), count, replace=False)
    readings = pd.Readings.of(surface.vertices_m[at], film_um[at], normals=surface.normals[at])
    return Experiment.of(name, surface, path, readings, **options)


def study_of(*experiments: Experiment) -> Study:
    return Study.of(pd.Campaign(experiments))


def on_door(**options) -> Experiment:
    return measured(door(), 'door', **options)


def on_panel(name: str = 'panel') -> Experiment:
    return replace(measured(panel(0.4, 0.04), 'panel'), name=name)


def plate_with_a_back() -> Experiment:
    """A panel with a reading on its other side."""
    front, off_m = panel(0.4, 0.04), np.array([0.0, 0.002, 0.0])
    faces = np.concatenate([front.faces, front.faces[:, ::-1] + len(front.vertices_m)])
    vertices_m = np.concatenate([front.vertices_m, front.vertices_m - off_m])
    part = measured(pd.Surface.from_triangles(vertices_m, faces, 0.04), 'panel')
    read = part.readings
    both = pd.Readings.of(
        np.vstack([read.positions_m, read.positions_m[0] - off_m]),
        np.append(read.thickness_um, 0.0),
        normals=np.vstack([read.normals, -read.normals[0]]),
    )
    return part.with_readings(both)


def at_model(study: Study, model=MODEL):
    """A fit that has found this model."""
    parameters = FreeParameters.of(model, *model.effects)
    return study.beside(parameters, parameters.encode(model))

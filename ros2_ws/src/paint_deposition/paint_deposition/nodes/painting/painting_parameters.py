"""The parameters that nodes with a film share, and the models, parts and films built from them."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from paint_deposition.effects.base import Effect
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import ModelError, PaintError
from paint_deposition.files.effect_file import load_effect_file
from paint_deposition.files.meshes import read_mesh
from paint_deposition.files.model_file import LoadEffect, read_model
from paint_deposition.film.common_film import LiveFilms, require_same_film_effects
from paint_deposition.motion.pose_stream import DEFAULT_POSE_MEMORY
from paint_deposition.nodes.managed_node import MANAGED
from paint_deposition.nodes.parameters import (
    CONFIGURED,
    NodeParameter,
    atomizers_parameter,
    direction_parameter,
    fixed,
    mesh_parameters,
)
from paint_deposition.part.points import SurfacePoints
from paint_deposition.part.surface import Surface
from paint_deposition.part.zones import Zones
from paint_deposition.request import POSE_FORMAT, is_pose

# A part ready to be painted: its refined surface, points on it, unpainted film, and zones.
PreparedPart = tuple[Surface, SurfacePoints, LiveFilms, Zones | None]


def model_parameters(use: str) -> dict[str, NodeParameter]:
    """The rows `model_file` and `allow_user_effects`; `use` completes "Setting it reads it"."""
    return {
        'model_file': NodeParameter(
            '',
            'Deposition model, model.yaml; empty: a 50 mm bell. Setting it, to the same file too, '
            f'reads it{use} [path]',
        ),
        'allow_user_effects': NodeParameter(
            False,
            'Allow a model to name effect files, whose Python code this node then runs '
            '[true/false]',
            fixed_because='whoever can set parameters could otherwise run code on this machine; '
            'restart the node with the new value',
        ),
    }


PAINTING = dict(
    **MANAGED,
    **fixed(
        'the film so far lies on this mesh, in this frame; clean the node up or restart it for '
        'another part',
        CONFIGURED,
        **mesh_parameters(max_edge_length_m=0.01),
        down=direction_parameter(
            'Direction of gravity in the frame of the mesh, any length; empty: -z for a part that '
            'stands or lies, -y for one drawn flat at z = 0 [-]'
        ),
    ),
    part_pose=NodeParameter(
        [],
        'Pose of the mesh in part_parent_frame, x y z qx qy qz qw; empty: not known [m, -]',
        constraints=f'{POSE_FORMAT}, or none',
        allows=lambda value: not value or is_pose(value),
        element=float,
    ),
    part_parent_frame=NodeParameter(
        '', 'Frame that part_pose is given in; poses in it are transformed [name]'
    ),
    trigger_latency_s=NodeParameter(
        0.1,
        'How late a state may arrive, by the stamps of the poses, and still switch the gun at its '
        'own stamp [s]',
        (0.0, 10.0),
    ),
    **fixed(
        'the subscriptions and the pose memory are made with it; clean the node up or restart it',
        CONFIGURED,
        max_pose_gap_s=NodeParameter(
            0.25, 'A longer interval between pose stamps is gun off [s]', (0.001, 60.0)
        ),
        atomizers=atomizers_parameter('that paint this part'),
        pose_queue_depth=NodeParameter(
            5000,
            'Depth of the queue of poses; if it overflows, paint is lost [poses]',
            (1, 100_000),
        ),
        pose_memory=NodeParameter(
            DEFAULT_POSE_MEMORY,
            'Poses kept, 64 bytes each, for repainting with another model; with more poses, a new '
            'model paints from then on only [poses]',
            (10_000, 100_000_000),
        ),
    ),
    **model_parameters(' and paints the motion so far again'),
    model_files=NodeParameter(
        [],
        'One deposition model for each of atomizers, in their order, where they differ; empty: '
        'model_file for all [path]',
        element=str,
    ),
    repaint=NodeParameter(
        True,
        'Paint the motion so far again with a new model; false: from then on only [true/false]',
    ),
    publish_rate_hz=NodeParameter(
        2.0, 'Rate of the messages while the film changes [Hz]', (0.1, 30.0)
    ),
)


def model_from_parameters(
    values: Mapping[str, Any], load: LoadEffect = load_effect_file
) -> DepositionModel:
    """The model that a node's parameters select; `load` reads the effect files it names.

    Raises:
        ModelError: the model is invalid, or names an effect file without `allow_user_effects`.
    """

    def refuse(path: Path) -> type[Effect]:
        raise ModelError(
            f'effect file {path} is not run, because it is Python code; if you trust it, start '
            'the node with allow_user_effects:=true'
        )

    if not values['model_file']:
        return DepositionModel()
    return read_model(values['model_file'], load if values['allow_user_effects'] else refuse)


def models_from_parameters(
    values: Mapping[str, Any], load: LoadEffect = load_effect_file
) -> tuple[tuple[DepositionModel, ...], list[str]]:
    """The model of each gun, and its file, from `model_files` or `model_file`, '' for the default.

    Without `atomizers` there is one of each.

    Raises:
        PaintError: as above, or the number of models is not that of the guns.
    """
    guns, files = values['atomizers'] or [''], values['model_files']
    if not files:
        models = (model_from_parameters(values, load),) * len(guns)
        return models, [values['model_file']] * len(guns)
    if len(files) != len(guns) or values['model_file']:
        another = ' and model_file another' if values['model_file'] else ''
        raise PaintError(
            f'model_files names {len(files)} models for {len(guns)} atomizers{another}: give '
            'model_file for all, or model_files one for each of atomizers'
        )
    models = tuple(model_from_parameters({**values, 'model_file': file}, load) for file in files)
    require_same_film_effects(dict(zip(guns, models, strict=True)))
    return models, files


def read_part(values: Mapping[str, Any], mesh_file: str) -> Surface:
    """The surface of a mesh, refined and oriented by a node's parameters.

    Raises:
        PaintError: there is no mesh, or it cannot be read.
    """
    if not mesh_file:
        raise PaintError("mesh_file is empty: give the part's mesh")
    down = np.array(values['down']) if values['down'] else None
    return read_mesh(mesh_file, values['mesh_scale'], values['max_edge_length_m'], down)

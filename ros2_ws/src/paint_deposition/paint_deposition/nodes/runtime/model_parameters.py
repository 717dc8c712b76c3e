"""The parameters that select a node's deposition model, and reading that model."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from paint_deposition.effects.base import Effect
from paint_deposition.effects.catalogue import load_effect_file
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import ModelError, PaintError
from paint_deposition.files.model_file import LoadEffect, read_model
from paint_deposition.film.common_film import require_same_film_effects
from paint_deposition.nodes.runtime.parameters import NodeParameter, ParameterTable


def model_parameters(use: str) -> ParameterTable:
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


def model_from_parameters(
    values: Mapping[str, Any], load: LoadEffect = load_effect_file
) -> DepositionModel:
    """The model that a node's parameters select; `load` reads the effect files it names.

    Raises:
        ModelError: the model is invalid, or names an effect file without `allow_user_effects`.
    """
    if not values['model_file']:
        return DepositionModel()
    return read_model(
        values['model_file'], load if values['allow_user_effects'] else _refuse_effect_file
    )


def models_from_parameters(
    values: Mapping[str, Any], load: LoadEffect = load_effect_file
) -> tuple[DepositionModel, ...]:
    """The model of each gun, from `model_files` or `model_file`; one model without `atomizers`.

    Raises:
        PaintError: as above, or the number of models is not that of the guns.
    """
    guns, files = values['atomizers'] or [''], values['model_files']
    if not files:
        return (model_from_parameters(values, load),) * len(guns)
    if len(files) != len(guns) or values['model_file']:
        another = ' and model_file another' if values['model_file'] else ''
        raise PaintError(
            f'model_files names {len(files)} models for {len(guns)} atomizers{another}: give '
            'model_file for all, or model_files one for each of atomizers'
        )
    models = tuple(model_from_parameters({**values, 'model_file': file}, load) for file in files)
    require_same_film_effects(dict(zip(guns, models, strict=True)))
    return models


def _refuse_effect_file(path: Path) -> type[Effect]:
    raise ModelError(
        f'effect file {path} is not run, because it is Python code; if you trust it, start the '
        'node with allow_user_effects:=true'
    )

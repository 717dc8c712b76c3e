"""What the figures of a result say of its inputs."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.files.provenance import origin


def provenance(
    model: DepositionModel | Mapping[str, DepositionModel] | None,
    files: Mapping[str, str],
    campaign: str = '',
) -> dict[str, Any]:
    return {'provenance': origin(model, files, campaign)}


def input_files(about: Mapping[str, Any]) -> dict[str, str]:
    """Of what a command says of its inputs, those that are files."""
    keys = ('mesh_file', 'mesh', 'trajectory', 'model_file', 'model')
    told = {key.removesuffix('_file'): str(about[key]) for key in keys if about.get(key)}
    return {what: file for what, file in told.items() if Path(file).exists()}


def with_provenance(
    about: Mapping[str, Any],
    model: DepositionModel | Mapping[str, DepositionModel],
    more_files: Mapping[str, str] = MappingProxyType({}),
) -> dict[str, Any]:
    """What is said of a result, and the model and the files that it was made from."""
    return {**about, **provenance(model, input_files(about) | dict(more_files))}

"""Campaign files: which parts were painted along which recording and measured where."""

from collections.abc import Callable
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from paint_deposition.errors import PaintError, ReadingsError, did_you_mean
from paint_deposition.files.gauge_readings import read_readings
from paint_deposition.files.meshes import read_mesh
from paint_deposition.files.recordings.bags import read_trajectory
from paint_deposition.files.strict_yaml import read_yaml
from paint_deposition.motion.path_builder import DEFAULT_MAX_POSE_GAP_S, spray_path
from paint_deposition.part.facing import toward_the_gun
from paint_deposition.readings.campaign import Campaign, Experiment

TOP_KEYS = ('experiments', 'model')
REQUIRED = ('mesh', 'trajectory', 'measurements')
TOPICS = ('pose_topic', 'state_topic')
EXPERIMENT_KEYS = (*REQUIRED, *TOPICS, 'name', 'mesh_scale', 'max_pose_gap_s', 'down')
# Readings are matched to the surface; a finer mesh only helps where the surface is strongly
# curved.
MAX_EDGE_LENGTH_M = 0.02


def read_campaign(
    path: str | Path, progress: Callable[[str], None] = lambda line: None
) -> Campaign:
    """Read a campaign with all that it names.

    Args:
        path: YAML; paths in it are relative to it.
        progress: called with a line for each experiment and each note on it.

    Raises:
        PaintError: naming the file, the experiment and the key at fault, and the remedy.
    """
    path = Path(path)
    content = _load(path)
    _check_keys(path, content, TOP_KEYS, 'campaign')
    entries = content.get('experiments')
    if not isinstance(entries, list) or not entries:
        raise ReadingsError(f"{path}: 'experiments' is {entries!r}; list at least one experiment")
    model = content.get('model')
    if model is not None:
        _require_text(path, 'campaign', 'model', model)
    experiments: list[Experiment] = []
    for number, entry in enumerate(entries, start=1):
        _check_entry(path, entry, number)
        name = str(entry.get('name', f'experiment_{number}'))
        if name in [e.name for e in experiments]:
            raise ReadingsError(f"{path}: two experiments are called '{name}'; rename one")
        progress(f'reading {name}')
        try:
            experiments.append(_read_experiment(path.parent, name, entry, progress))
        except PaintError as error:
            raise type(error)(f"{path}: experiment '{name}': {error}") from None
    start = None if model is None else str(path.parent / model)
    return Campaign(tuple(experiments), start, str(path))


def _read_experiment(
    folder: Path, name: str, entry: dict[str, Any], progress: Callable[[str], None]
) -> Experiment:
    files = {key: str(folder / entry[key]) for key in REQUIRED}
    down = np.array(entry['down'], dtype=float) if 'down' in entry else None
    surface = read_mesh(
        files['mesh'], float(entry.get('mesh_scale', 1.0)), MAX_EDGE_LENGTH_M, down
    )
    trajectory = read_trajectory(
        files['trajectory'], entry.get('pose_topic'), entry.get('state_topic')
    )
    gap = float(entry.get('max_pose_gap_s', DEFAULT_MAX_POSE_GAP_S))
    path, counts = spray_path(trajectory, gap)
    surface = toward_the_gun(surface, path.position_m, path.rotation[:, :, 2])
    for note in (*surface.notes, *trajectory.notes):
        progress(f'{name}: {note}')
    if counts.rejected:
        progress(f'{name}: {counts.rejected} of {counts.received} poses dropped')
    return Experiment.of(name, surface, path, read_readings(files['measurements']), files)


def _load(path: Path) -> dict[str, Any]:
    content = read_yaml(path, 'campaign', ReadingsError)
    if not isinstance(content, dict):
        raise ReadingsError(f"{path}: is not a campaign; expected the key 'experiments'")
    return content


def _check_entry(path: Path, entry: Any, number: int) -> None:
    where = f'experiment {number}'
    if not isinstance(entry, dict):
        raise ReadingsError(f'{path}: {where} is {entry!r}; expected keys {", ".join(REQUIRED)}')
    _check_keys(path, entry, EXPERIMENT_KEYS, where)
    for key in REQUIRED:
        if key not in entry:
            raise ReadingsError(f"{path}: {where} has no '{key}'; name its file")
    for key in (*REQUIRED, *TOPICS):
        _require_text(path, where, key, entry.get(key, key))
    for key in ('mesh_scale', 'max_pose_gap_s'):
        value = entry.get(key, 1.0)
        if not _is_number(value) or value <= 0:
            raise ReadingsError(f"{path}: {where}: '{key}' is {value!r}; expected above 0")
    down = entry.get('down', [0, 0, -1])
    if not isinstance(down, list) or len(down) != 3 or not all(map(_is_number, down)):
        raise ReadingsError(f"{path}: {where}: 'down' is {down!r}; expected [x, y, z]")


def _require_text(path: Path, where: str, key: str, value: Any) -> None:
    if not isinstance(value, str) or not value:
        raise ReadingsError(f"{path}: {where}: '{key}' is {value!r}; expected text")


def _is_number(value: Any) -> bool:
    """Whether it is a finite number; true and false are none."""
    return isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value)


def _check_keys(path: Path, content: dict, known: tuple[str, ...], where: str) -> None:
    for key in content:
        if key not in known:
            raise ReadingsError(
                f'{path}: unknown key {key!r} in {where}; {did_you_mean(key, known)}'
            )

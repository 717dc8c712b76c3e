"""The runs of a cell: one folder for each coat on each part, with its film and its recording."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from paint_deposition.errors import RecordingError
from paint_deposition.files.recordings.mcap_recovery import mcap_files

FILM_FILE = 'film.json'
METADATA_FILE = 'metadata.yaml'
# Figures of the film that the table of runs shows; None where the run has no film.
FIGURES = (
    'mean_um', 'std_dev_um', 'min_um', 'max_um', 'coverage', 'within_target', 'target_um',
    'target_tolerance_um', 'painted_volume_cm3', 'capture_fraction',
)  # fmt: skip


@dataclass(frozen=True)
class CellRun:
    """One coat on one part; '' or None is not known.

    Attributes:
        run: name of its folder.
        type, serial, coat: of the part, as the cell said.
        since, until: when the part was in the cell, ISO 8601.
        gap_s: how long the first poses waited for the part [s].
        recording: 'complete', 'unfinished' or 'none'. duration_s: of a complete one [s].
        poses: that were painted. gaps: among them.
        film: figures of the film by name, see ``FIGURES``.
        atomizers: what each gun laid.
    """

    run: str
    type: str
    serial: str
    coat: int
    since: str
    until: str
    gap_s: float | None
    recording: str
    duration_s: float | None
    poses: int | None
    gaps: int | None
    film: dict[str, float | None]
    atomizers: list[dict[str, Any]]


def read_cell_runs(folder: Path) -> list[CellRun]:
    """The runs below a folder, the oldest first.

    Raises:
        RecordingError: it is no folder, it has no runs, or a file in a run cannot be understood.
    """
    if not folder.is_dir():
        raise RecordingError(f'{folder} is no folder; give the output_directory of the nodes')
    runs = [run for place in sorted(folder.iterdir()) if (run := _run(place))]
    if not runs:
        raise RecordingError(
            f'{folder} holds no run; a run begins with ~/change_part of the simulator, or with '
            'the recorder'
        )
    return sorted(runs, key=lambda run: (run.since or '9', run.run))


def _run(place: Path) -> CellRun | None:
    """The run in a folder, None if it holds none."""
    film_file, metadata_file = place / FILM_FILE, place / METADATA_FILE
    recorded = place.is_dir() and bool(mcap_files(place))
    if not film_file.is_file() and not recorded:
        return None
    try:
        film = json.loads(film_file.read_text(encoding='utf-8')) if film_file.is_file() else {}
        complete = recorded and metadata_file.is_file()
        bag = yaml.safe_load(metadata_file.read_text(encoding='utf-8')) if complete else {}
        information = bag.get('rosbag2_bagfile_information', {})
        noted = information.get('custom_data') or {}
        part, poses = film.get('part') or {}, film.get('poses') or {}
        duration = information.get('duration')
        return CellRun(
            run=place.name,
            type=str(part.get('type') or noted.get('part_type', '')),
            serial=str(part.get('serial') or noted.get('serial', '')),
            coat=int(part.get('coat') or noted.get('coat', 1)),
            since=str(part.get('since', '')),
            until=str(part.get('until', '')),
            gap_s=part.get('gap_s'),
            recording='complete' if bag else 'unfinished' if recorded else 'none',
            duration_s=duration['nanoseconds'] * 1e-9 if duration else None,
            poses=poses.get('received'),
            gaps=poses.get('gaps'),
            film={name: film[name] for name in FIGURES if name in film},
            atomizers=list(film.get('atomizers') or []),
        )
    except (ValueError, TypeError, AttributeError, KeyError, yaml.YAMLError) as error:
        reason = ' '.join(str(error).split())
        raise RecordingError(
            f'{place}: {FILM_FILE} or {METADATA_FILE} cannot be understood ({reason}); move the '
            'folder away'
        ) from None

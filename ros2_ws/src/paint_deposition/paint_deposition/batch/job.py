"""The cases of a sweep, the inputs that they share, each read once, and what a case computes."""

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from paint_deposition.api.planning import plan
from paint_deposition.api.simulation import simulate
from paint_deposition.batch.cases import Case, code_digest, digest_of
from paint_deposition.batch.sweep_file import (
    DRAW,
    MOTION_KEYS,
    PASS_KEYS,
    SweepFile,
    Values,
    effects_of,
    variations,
    varied_model,
    varied_motion,
)
from paint_deposition.effects.base import Effect
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import BatchError, PaintError
from paint_deposition.files.effect_file import load_unnamed_effect_file
from paint_deposition.files.gauge_readings import read_readings
from paint_deposition.files.meshes import read_mesh
from paint_deposition.files.model_file import ModelFile, read_model_file
from paint_deposition.files.motion_files import read_motion
from paint_deposition.files.provenance import model_digest, sha256
from paint_deposition.inference.fitting.posterior import draw_models
from paint_deposition.inference.readings.readings import Readings
from paint_deposition.motion.trajectory import Trajectory
from paint_deposition.part.surface import Surface
from paint_deposition.request import MotionOptions

NOTHING = 'nothing'
# Columns that hold a list in each row: the film at every vertex, the gauge at every reading.
PREDICTED = 'predicted_um'


@dataclass
class Job:
    """The cases of a sweep and their inputs."""

    file: SweepFile  # the sweep
    folder: Path  # that its paths are relative to
    values: list[Values] = field(default_factory=list)  # of each case, what varies
    cases: list[Case] = field(default_factory=list)  # in the same order
    # What they share, by name.
    inputs: dict[str, Any] = field(default_factory=lambda: {NOTHING: None})
    files: dict[str, Path] = field(default_factory=dict)  # read for it, by what they are
    notes: dict[str, None] = field(default_factory=dict)  # for the user, a line each
    # By id, those of the library and users' own of the models.
    effects: dict[str, type[Effect]] = field(default_factory=dict)
    _read: dict[Any, Any] = field(default_factory=dict, repr=False)

    @staticmethod
    def of(
        file: SweepFile, folder: Path, progress: Callable[[str], None] = lambda line: None
    ) -> 'Job':
        """Read everything that a sweep names, each file once.

        Raises:
            PaintError: a file that cannot be used, or values that do not go together.
        """
        job = Job(file, folder)
        varied = [*file.grid.get('model', ()), *(case.get('model') for case in file.cases)]
        named = [n for n in dict.fromkeys((file.model, *varied)) if isinstance(n, str)]
        models = [job._model_file(folder / name).model for name in named]
        job.effects = effects_of(models)
        job.values = variations(file, models)
        for number, values in enumerate(job.values):
            if number % 100 == 0:
                progress(f'preparing case {number + 1} of {len(job.values)}')
            inputs = job._inputs(values)
            options = job._options(values, planned=inputs[1] == NOTHING)
            model = job._model(values)
            own = [effect.file_content.decode() for effect in model.effects]
            digest = digest_of(code_digest(), model_digest(model), own, options, inputs)
            job.cases.append((digest, {'model': model, **options}, inputs))
        return job

    @property
    def varied(self) -> list[str]:
        """Names of what varies."""
        return list(dict.fromkeys(name for values in self.values for name in values))

    def _named(self, key: str, values: Values) -> Path | None:
        name = values.get(key, getattr(self.file, key))
        return self.folder / name if name else None

    def _once(self, key: Any, read: Callable[[], Any]) -> Any:
        if key not in self._read:
            self._read[key] = read()
        return self._read[key]

    def _input(self, what: str, path: Path, how: Any, read: Callable[[], Any]) -> str:
        """The name of an input, by its file's content and how it is read; it is read once."""
        name = f'{what}-{digest_of(self._once(path, lambda: sha256(path)), how)}'
        if name not in self.inputs:
            value = self.inputs[name] = read()
            self.files[f'{what} {path.name}'] = path
            self.notes |= dict.fromkeys(getattr(value, 'notes', ()))
            self.notes |= dict.fromkeys(getattr(value, 'warnings', ()))
        return name

    def _model_file(self, path: Path) -> ModelFile:
        self.files[f'model {path.name}'] = path
        return self._once(('model', path), lambda: read_model_file(path, load_unnamed_effect_file))

    def _model(self, values: Values) -> DepositionModel:
        path, sample = self._named('model', values), self.file.sample
        file = ModelFile(DepositionModel()) if path is None else self._model_file(path)
        model, posterior = file.model, file.posterior
        if DRAW in values and sample:
            if path is None:
                raise BatchError('no model is given, and the parameters of one vary; give model')
            if posterior is None:
                raise BatchError(
                    f'{path}: has no posterior to draw from; take a model that calibrate, '
                    'diagnose or refit wrote'
                )
            drawn = self._once(
                ('draws', path), lambda: draw_models(model, posterior, sample.count, sample.seed)
            )
            model = drawn[values[DRAW]]
        return varied_model(model, values, self.effects)

    def _inputs(self, values: Values) -> tuple[str, str, str]:
        """Names of the part, the motion and the readings of a case."""
        file, mesh = self.file, self._named('mesh', values)
        motion = self._named('trajectory', values)
        if mesh is None:
            raise BatchError('no mesh is given; give mesh')
        how = file.mesh_scale, file.max_edge_length_m
        down = None if file.down is None else np.array(file.down)
        surface = self._input(
            'mesh', mesh, (*how, file.down, file.body),
            lambda: read_mesh(mesh, *how, down, file.body),
        )  # fmt: skip
        recorded = NOTHING
        if motion is not None:
            given = file.model_dump(include=set(MotionOptions.model_fields))
            arm = given['urdf'] = given['urdf'] and str(self.folder / given['urdf'])
            if 'part_pose' in values:
                given['part_pose'] = values['part_pose']
            source, its = MotionOptions.model_validate(given), [given, arm and sha256(Path(arm))]
            recorded = self._input('trajectory', motion, its, lambda: read_motion(motion, source))
        if not file.readings:
            return surface, recorded, NOTHING
        path, part = self.folder / file.readings, self.inputs[surface]
        places = self._input(
            'readings', path, surface, lambda: read_readings(path, None, surface=part)
        )
        return surface, recorded, places

    def _options(self, values: Values, planned: bool) -> dict[str, Any]:
        file = self.file
        for name in MOTION_KEYS if planned else PASS_KEYS:
            if name in values and planned:
                raise BatchError(f'{name} varies a recorded motion; give a trajectory')
            if name in values:
                raise BatchError(
                    f'{name} varies planned passes; leave trajectory out, or vary '
                    f'{", ".join(MOTION_KEYS)}'
                )
        passes = file.passes.model_dump() | {n: values[n] for n in PASS_KEYS if n in values}
        if planned and passes['speed_m_per_s'] is None and passes['target_um'] is None:
            raise BatchError(
                'passes are planned, but neither their speed nor a target is given; give passes: '
                '{speed_m_per_s: ...}, passes: {target_um: ...}, or a trajectory'
            )
        return {
            'motion': {name: values[name] for name in MOTION_KEYS if name in values},
            'passes': passes if planned else {},
            'film': {
                name: getattr(file, name)
                for name in ('target_um', 'tolerance_um', 'max_pose_gap_s')
            },
        }


def computed(
    parameters: Mapping[str, Any],
    surface: Surface,
    trajectory: Trajectory | None,
    readings: Readings | None,
) -> dict[str, list[Any]]:
    """The figures of a case, one row; a case without a film says why in the column ``error``.

    Args:
        parameters: ``model``, ``motion``, ``passes``, and ``film``, options of ``simulate``.
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
            **parameters['film'],
        )  # fmt: skip
    except PaintError as error:
        return {'error': [str(error)]}
    statistics = film.statistics
    figures |= {
        **statistics.to_dict(),
        'sigma_n': statistics.std_dev_um / statistics.mean_um if statistics.mean_um else None,
        'spraying_time_s': film.path.spraying_time_s,
        'film_sha256': hashlib.sha256(film.film_um.tobytes()).hexdigest(),
        'warnings': '; '.join(film.warnings),
    }
    if film.predicted_um is not None:
        figures[PREDICTED] = film.predicted_um.tolist()
    return {name: [value] for name, value in figures.items()}

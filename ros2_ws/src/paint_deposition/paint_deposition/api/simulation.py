"""The film that recorded motions leave on a part, how the guns ran over it, and sample files."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import ModelError, PaintError, RecordingError
from paint_deposition.film.common_film import TOTAL, Coats, CommonFilm, require_same_film_effects
from paint_deposition.film.film import Film, GunOnPart
from paint_deposition.film.integrator import NO_PAINT_UM, FilmIntegrator, Precision, after_effects
from paint_deposition.film.live_film import without_refused_states
from paint_deposition.film.spray_geometry import spray_geometry
from paint_deposition.film.statistics import film_statistics, require_band
from paint_deposition.inference.readings.campaign import Experiment
from paint_deposition.inference.readings.plausibility import readings_in_doubt
from paint_deposition.inference.readings.readings import Readings
from paint_deposition.motion.path_builder import checked_path
from paint_deposition.motion.trajectory import DEFAULT_MAX_POSE_GAP_S, Trajectory
from paint_deposition.part.points import SurfacePoints
from paint_deposition.part.surface import Surface, toward_the_guns
from paint_deposition.part.zones import Zones

Progress = Callable[[str, float], None]


def look_at(
    surface: Surface,
    trajectory: Trajectory,
    model: DepositionModel | None = None,
    *,
    max_pose_gap_s: float = DEFAULT_MAX_POSE_GAP_S,
) -> GunOnPart:
    """Set a motion beside a part, as ``simulate`` does, without painting it.

    Args:
        surface: the part; it is turned round, with a note, if the gun looks at its back.
        trajectory: poses and trigger in the frame of the mesh.
        model: its pattern and projection say where the spray goes; default: a 50 mm bell.
        max_pose_gap_s: a longer time between two poses counts as gun off [s].

    Raises:
        RecordingError: the poses make no motion, or the gun never sprays.
    """
    if model is not None:
        without_refused_states(trajectory, model, strict=True)
    model = model or DepositionModel()
    return look_at_guns(surface, [trajectory], [model], max_pose_gap_s=max_pose_gap_s)[0]


def look_at_guns(
    surface: Surface,
    trajectories: Sequence[Trajectory],
    models: Sequence[DepositionModel],
    *,
    max_pose_gap_s: float = DEFAULT_MAX_POSE_GAP_S,
) -> list[GunOnPart]:
    """Set the motions of several guns beside a part, each with its model, without painting it.

    The first gun whose axis meets the part says which side of it is outward.
    """
    paths = []
    for trajectory, model in zip(trajectories, models, strict=True):
        path, counts, odd = checked_path(trajectory, max_pose_gap_s, model.max_step_m)
        warned = replace(trajectory, warnings=(*trajectory.warnings, *odd))
        paths.append((warned, path, counts))
    surface = toward_the_guns(surface, ((p.position_m, p.rotation[:, :, 2]) for _, p, _ in paths))
    return [
        GunOnPart(
            surface, trajectory, path, counts, model,
            spray_geometry(surface, path, model, trajectory.frame_id),
        )
        for model, (trajectory, path, counts) in zip(models, paths, strict=True)
    ]  # fmt: skip


def simulate(
    surface: Surface,
    trajectory: Trajectory | Sequence[Trajectory],
    model: DepositionModel | Sequence[DepositionModel] | None = None,
    *,
    names: Sequence[str] = (),
    coats: Sequence[str] = (),
    wet_on_wet: bool = False,
    readings: Readings | None = None,
    max_pose_gap_s: float = DEFAULT_MAX_POSE_GAP_S,
    target_um: float = 0.0,
    tolerance_um: float = 0.0,
    zones: Zones | None = None,
    strict: bool = False,
    progress: Progress = lambda what, share: None,
) -> Film:
    """Compute the film on a part from a recorded motion, or from those of several guns.

    Args:
        surface: the part; it is turned round, with a note, if the gun looks at its back. Of
            several guns the first whose axis meets the part decides.
        trajectory: poses and trigger in the frame of the mesh; one for each gun.
        model: what the gun sprays, one for all or one for each; default: a 50 mm bell.
        names: of the guns, where there are several; default: gun 1, gun 2 and so on.
        coats: names of the coats that the motions lay, one for each motion in the order of
            painting; several with one name are guns of one coat. Default: all lay one coat.
        wet_on_wet: whether all coats are one wet film. Else each has dried before the next, and
            what acts on the finished film, sag say, acts on each by itself.
        readings: places at which the gauge is to be predicted too, effects on it included, of the
            layer that each reading is of.
        max_pose_gap_s: a longer time between two poses counts as gun off [s].
        target_um, tolerance_um: the film wanted and what it may differ, for the figures [um].
        zones: regions of the part with targets of their own, from ``read_zones``.
        strict: whether to refuse states whose brush the model lacks; else they are left out with
            a warning, as in the cell.
        progress: called with what is being done and the share of it that is done, 0 to 1.

    Raises:
        RecordingError: the poses make no motion, the gun never sprays, or no paint lands on the
            part; says why.
        ModelError: models of several guns that do not go together.
        ReadingsError: readings that are not on the part.
        PaintError: a tolerance that is not less than the target, a zone without a vertex, or names
            of guns or coats that do not go with the motions or the readings.
    """
    require_band(target_um, tolerance_um)
    motions = [trajectory] if isinstance(trajectory, Trajectory) else list(trajectory)
    if isinstance(model, Sequence):
        models = list(model)
    else:
        models = [model or DepositionModel()] * len(motions)
    if len(models) != len(motions):
        raise ModelError(
            f'{len(models)} models for {len(motions)} guns: give one for all, or one for each of '
            'them'
        )
    laid = Coats.of_guns(coats, len(motions), coats if wet_on_wet else ())
    if names and len(names) != len(motions):
        raise PaintError(f'{len(names)} names for {len(motions)} guns: give one for each, or none')
    if len(motions) > 1:
        names = list(names) or [f'gun {number}' for number in range(1, len(motions) + 1)]
        named = list(zip(names, models, strict=True))
        for _, rows in laid.films_of(TOTAL):
            require_same_film_effects(dict(named[rows]))
        require_same_film_effects(dict(named), ['on_gauge'])
    motions = [without_refused_states(*gun, strict) for gun in zip(motions, models, strict=True)]
    seen = look_at_guns(surface, motions, models, max_pose_gap_s=max_pose_gap_s)
    surface = seen[0].surface
    point_zones = zones.on(surface) if zones else None
    common = _painted(surface.points(), seen, 'single', progress)
    film_um = common.layer_um(laid)
    if film_um.max() < NO_PAINT_UM:
        geometry = seen[0].geometry
        cause = geometry.warnings[0] if geometry.warnings else geometry.sentence
        raise RecordingError(f'{motions[0].source}: no paint lands on the part: {cause}')
    statistics = film_statistics(
        film_um, surface.vertex_areas_m2, common.used.emitted_cm3,
        target_um=target_um, target_tolerance_um=tolerance_um, zones=point_zones,
    )  # fmt: skip
    laid_cm3 = common.laid_cm3(surface.vertex_areas_m2).tolist()
    guns = tuple(
        replace(
            gun, name=name, painted_volume_cm3=painted_cm3,
            emitted_volume_cm3=integrator.used.emitted_cm3,
        )
        for name, gun, painted_cm3, integrator in zip(
            names or [''], seen, laid_cm3, common.guns, strict=True
        )
    )  # fmt: skip
    predicted_um = None
    doubts: tuple[str, ...] = ()
    if readings is not None:
        progress('predicting the readings', 0.0)
        # Each reading by itself, in double precision, and the slope of the film around it.
        each = replace(readings, point=np.arange(len(readings)).astype(str))
        each = replace(each, layer=np.array('')) if coats else each
        part = Experiment.of('part', surface, seen[0].path, each)
        at_points = _painted(part.points, seen, 'double', progress)
        predicted_um = np.empty(len(part))
        for layer, seeing in laid.by_layer(readings.layer).items():
            layer_um = at_points.layer_um(laid, layer)
            shown_um = after_effects('on_gauge', layer_um, models[0].effects, part.points)
            predicted_um[seeing] = shown_um[: len(part)][seeing]
        doubts = readings_in_doubt(surface, readings, predicted_um)
    added = []
    for k, name in enumerate(laid.names if coats else ()):
        rows = laid.guns(k, k + 1)
        used, coat_um = CommonFilm(common.guns[rows]).used, common.layer_um(laid, name)
        of_coat = film_statistics(coat_um, surface.vertex_areas_m2, used.emitted_cm3)
        added.append(Film(surface, guns[rows], coat_um, of_coat, paint=used, name=name))
    return Film(
        surface, guns, film_um, statistics, readings, predicted_um, common.used, doubts,
        tuple(added), point_zones,
    )  # fmt: skip


def _painted(
    points: SurfacePoints,
    seen: Sequence[GunOnPart],
    precision: Precision,
    progress: Progress,
) -> CommonFilm:
    """What the guns lay at these points."""
    integrators = []
    before, steps = 0, sum(len(gun.path) for gun in seen)
    for gun in seen:

        def report(done: int, before: int = before) -> None:
            progress('painting', (before + done) / steps)

        integrators.append(FilmIntegrator(points, gun.model, precision, gun.surface))
        integrators[-1].add(gun.path, report)
        before += len(gun.path)
    return CommonFilm(tuple(integrators))


def sample_folder() -> Path:
    """Folder of the samples, wherever pip or colcon put it.

    Raises:
        PaintError: the package was installed without its shared files.
    """
    package = Path(__file__).resolve().parents[1]
    places = [package.parent / 'samples']
    places += [folder / 'share' / package.name / 'samples' for folder in package.parents]
    for place in places:
        if (place / 'door.stl').is_file():
            return place
    raise PaintError(f'no samples belong to {package}; install the package with pip or colcon')

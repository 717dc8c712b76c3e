"""Saving the film of a part with its statistics."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from paint_deposition.film.common_film import CommonFilm
from paint_deposition.film.statistics import FilmStatistics, film_statistics
from paint_deposition.nodes.painting.painting_node import PaintingNode
from paint_deposition.part.surface import Surface
from paint_deposition.part.zones import PointZones
from paint_deposition.report.writers.write import write_film


def statistics_of(
    values: Mapping[str, Any],
    surface: Surface,
    film_um: np.ndarray,
    emitted_cm3: float,
    zones: PointZones | None,
) -> FilmStatistics:
    """The statistics of a film (V,), by the targets and the thresholds among the parameters."""
    chosen = {k: values[k] for k in ('painted_above_um', 'target_um', 'target_tolerance_um')}
    return film_statistics(film_um, surface.vertex_areas_m2, emitted_cm3, zones=zones, **chosen)


def volume_by_gun(guns: Sequence[str], surface: Surface, film: CommonFilm) -> dict[str, float]:
    """Solids that each gun laid on the part, by its name [cm3]."""
    return dict(zip(guns, film.laid_cm3(surface.vertex_areas_m2).tolist(), strict=True))


def shares(laid_cm3: Mapping[str, float]) -> dict[str, float]:
    """Each gun's share of the paint on the part, 0 to 1; 0 for all without paint."""
    total = sum(laid_cm3.values())
    return {gun: laid / total if total else 0.0 for gun, laid in laid_cm3.items()}


def film_writer(
    node: PaintingNode, folder: Path, stem: str, part: Mapping[str, Any] | None = None
) -> Callable[[], list[Path]]:
    """A function that writes the film as it is now and returns the paths; for any thread.

    Args:
        folder, stem: of the files.
        part: description of the part for the statistics file.
    """
    film, surface, values = node.film.snapshot(), node.surface, dict(node.values)
    zones = node.zones
    names, counts = node.gun_names, [gun.counts.to_dict() for gun in node.film.guns]
    refused = [source.refused_frames.items() for source in node.inputs]
    details = {
        'mesh_file': node.mesh_file,
        'mesh_id': surface.mesh_id,
        'frame_id': node.frame.frame_id,
        'down': surface.down,
        'model_file': values['model_file'],
        'zones_file': values['zones_file'],
        'effects': list(dict.fromkeys(e.id for gun in film.guns for e in gun.model.effects)),
        'poses': node.film.counts.to_dict(),
        'poses_in_other_frames': {frame: count for frames in refused for frame, count in frames},
        **({'part': part} if part else {}),
    }

    def write() -> list[Path]:
        laid_cm3 = volume_by_gun(names, surface, film)
        files = values['model_files'] or [values['model_file']] * len(names)
        details['atomizers'] = [
            {
                'name': name,
                'model_file': file,
                'painted_volume_cm3': laid_cm3[name],
                'share': share,
                'emitted_volume_cm3': gun.emitted_cm3,
                'poses': poses,
            }
            for (name, share), file, gun, poses in zip(
                shares(laid_cm3).items(), files, film.guns, counts, strict=True
            )
        ]
        film_um = film.film_um
        figures = statistics_of(values, surface, film_um, film.emitted_cm3, zones)
        if any(gun.model.brushes for gun in film.guns):
            details['paint'] = film.used.figures(figures.mean_um, figures.painted_volume_cm3)
        return write_film(
            folder, surface, film_um, figures, zones=zones, stem=stem,
            statistics_file=f'{stem}.json', details=details,
            color_range_um=(values['color_min_um'], values['color_max_um']),
        )  # fmt: skip

    return write

"""The film on its way to the disk, and its figures."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from paint_deposition.film.common_film import CommonFilm
from paint_deposition.film.statistics import FilmStatistics, film_statistics
from paint_deposition.nodes.painting.film_messages import shares
from paint_deposition.nodes.painting.painting_node import PaintingNode
from paint_deposition.part.surface import Surface
from paint_deposition.report.writers.film import write_film


def figures_of(
    values: Mapping[str, Any], surface: Surface, film_um: np.ndarray, emitted_cm3: float
) -> FilmStatistics:
    """The figures of a film (V,) with the target and the limit that the parameters set."""
    return film_statistics(
        film_um,
        surface.vertex_areas_m2,
        emitted_cm3,
        painted_above_um=values['painted_above_um'],
        target_um=values['target_um'],
        target_tolerance_um=values['target_tolerance_um'],
    )


def laid_by(guns: Sequence[str], surface: Surface, film: CommonFilm) -> dict[str, float]:
    """Solids on the part by the name of the gun that laid them [cm3]."""
    return dict(zip(guns, film.laid_cm3(surface.vertex_areas_m2).tolist(), strict=True))


def film_to_save(
    node: PaintingNode,
    mesh_id: str,
    folder: Path,
    stem: str,
    part: Mapping[str, Any] | None = None,
) -> Callable[[], list[Path]]:
    """A function that writes the film as it is now, in any thread, and returns the paths.

    Args:
        node: that has painted it. mesh_id: of its refined mesh.
        folder, stem: where to.
        part: what to say of the part in the statistics.
    """
    film, surface, values = node.film.up_to_date(), node.surface, dict(node.values)
    names, counts = node.gun_names, [gun.counts.to_dict() for gun in node.film.guns]
    details = {
        'mesh_file': node.mesh_file,
        'mesh_id': mesh_id,
        'frame_id': node.frame.frame_id,
        'down': surface.down,
        'model_file': values['model_file'],
        'effects': list(dict.fromkeys(e.id for gun in film.guns for e in gun.model.effects)),
        'poses': node.film.counts.to_dict(),
        'poses_in_other_frames': {
            frame: count for gun in node.inputs for frame, count in gun.refused_frames.items()
        },
        **({'part': part} if part else {}),
    }

    def write() -> list[Path]:
        laid_cm3 = laid_by(names, surface, film)
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
        figures = figures_of(values, surface, film_um, film.emitted_cm3)
        if any(gun.model.brushes for gun in film.guns):
            details['paint'] = film.used.figures(figures.mean_um, figures.painted_volume_cm3)
        return write_film(
            folder,
            surface,
            film_um,
            figures,
            stem=stem,
            statistics_file=f'{stem}.json',
            details=details,
            color_range_um=(values['color_min_um'], values['color_max_um']),
        )

    return write

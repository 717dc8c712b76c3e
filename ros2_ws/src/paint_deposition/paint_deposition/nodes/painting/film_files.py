"""The simulator's film on its way to the disk."""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from paint_deposition.film.common_film import CommonFilm
from paint_deposition.nodes.painting.film_messages import shares
from paint_deposition.results.film import write_film

if TYPE_CHECKING:
    from paint_deposition.nodes.painting.deposition_simulator import DepositionSimulator


def film_to_save(
    node: DepositionSimulator, film: CommonFilm, folder: Path, stem: str
) -> Callable[[], list[Path]]:
    """A function that writes the film as it is now, in any thread, and returns the paths."""
    film_um, values = film.film_um, node.values
    details = {
        'mesh_file': values['mesh_file'],
        'mesh_id': node.mesh_id,
        'frame_id': node.frame.frame_id,
        'down': node.surface.down,
        'model_file': values['model_file'],
        'effects': list(dict.fromkeys(e.id for gun in film.guns for e in gun.model.effects)),
        'poses': node.film.counts.to_dict(),
        'poses_in_other_frames': {
            frame: count for gun in node.inputs for frame, count in gun.refused_frames.items()
        },
        'atomizers': _gun_details(node, film),
    }
    return functools.partial(
        write_film,
        folder,
        node.surface,
        film_um,
        node.statistics(film_um, film.emitted_cm3),
        stem=stem,
        statistics_file=f'{stem}.json',
        details=details,
        color_range_um=(values['color_min_um'], values['color_max_um']),
    )


def _gun_details(node: DepositionSimulator, film: CommonFilm) -> list[dict[str, Any]]:
    laid_cm3 = node.laid_cm3(film)
    files = node.values['model_files'] or [node.values['model_file']] * len(film.guns)
    return [
        {
            'name': name,
            'model_file': file,
            'painted_volume_cm3': laid_cm3[name],
            'share': share,
            'emitted_volume_cm3': gun.emitted_cm3,
            'poses': live.counts.to_dict(),
        }
        for (name, share), file, gun, live in zip(
            shares(laid_cm3).items(), files, film.guns, node.film.guns, strict=True
        )
    ]

"""How the gun ran over the part: passes, speed, standoff, lean of its axis, paint beside it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.film.facet_error import facet_error
from paint_deposition.film.geometry_warnings import geometry_warnings
from paint_deposition.film.gun_view import GunView
from paint_deposition.motion.path import SprayPath
from paint_deposition.part.surface import Surface

# Distances from the surface are told without the few of approaches and ends.
RANGE = (0.05, 0.95)


@dataclass(frozen=True)
class SprayGeometry:
    """How the gun ran over the part while it sprayed.

    Attributes:
        passes: that spray for 50 mm or more.
        speed_m_per_s: median of the TCP's over the paint sprayed [m/s].
        standoff_m: median distance of the TCP from the nearest surface where the gun is over the
            part, NaN where it never is [m].
        standoff_low_m, standoff_high_m: 90 % of that paint leaves between these distances [m].
        off_normal_deg: median angle between tool z and the way to that surface [deg].
        paint_over_part: share of the spray's straight rays that meet the outward side of the
            part, 0 to 1.
        facet_error: worst error of the film from flat facets of a curved part, as a share of the
            thickest film; see ``film.facet_error``.
        warnings: what is odd, a line each, with its likely cause.
    """

    passes: int
    speed_m_per_s: float
    standoff_m: float
    standoff_low_m: float
    standoff_high_m: float
    off_normal_deg: float
    paint_over_part: float
    facet_error: float
    warnings: tuple[str, ...] = ()

    @property
    def sentence(self) -> str:
        """The figures in a line."""
        where = 'TCP nowhere over the part'
        if math.isfinite(self.standoff_m):
            where = (
                f'TCP {self.standoff_m:.2f} m from the surface ({self.standoff_low_m:.2f} to '
                f'{self.standoff_high_m:.2f}), z {self.off_normal_deg:.0f} degrees off its normal'
            )
        return (
            f'{self.passes} {"pass" if self.passes == 1 else "passes"}, '
            f'{self.speed_m_per_s:.2f} m/s, {where}, {100 * self.paint_over_part:.0f} % of the '
            'paint over the part'
        )

    @property
    def facet_sentence(self) -> str:
        """What the coarseness of the mesh costs."""
        return f'coarseness of the mesh: up to {100 * self.facet_error:.1f} % of the peak film'

    def to_dict(self) -> dict[str, Any]:
        """The figures by name, with the sentence and the warnings."""
        return {**vars(self), 'sentence': self.sentence, 'warnings': list(self.warnings)}


def spray_geometry(
    surface: Surface, path: SprayPath, model: DepositionModel, frame_id: str = ''
) -> SprayGeometry:
    """Sum up how the gun ran over a part, and say what is odd.

    Args:
        surface: the part, turned to the gun.
        path: the motion; some of it sprays.
        model: its pattern and projection count, its effects do not.
        frame_id: of the poses, for the warnings.
    """
    facets = facet_error(surface, path, model)
    view = GunView(surface, path, model)
    low, middle, high, lean = [math.nan] * 4
    if view.over.any():
        distance = view.distance_m[view.over]
        low, middle, high = np.quantile(distance, [RANGE[0], 0.5, RANGE[1]]).tolist()
        lean = float(np.median(view.off_normal_deg[view.over]))
    return SprayGeometry(
        passes=len(view.passes),
        speed_m_per_s=float(np.median(view.path.speed_m_per_s)),
        standoff_m=middle,
        standoff_low_m=low,
        standoff_high_m=high,
        off_normal_deg=lean,
        paint_over_part=float(view.landing.mean()),
        facet_error=facets.share,
        # Wrong geometry also makes facets cost more: it is told alone.
        warnings=tuple(geometry_warnings(view, frame_id)) or tuple(filter(None, [facets.warning])),
    )

"""A film in figures, weighted by surface area."""

import math
from dataclasses import asdict, dataclass

import numpy as np

# Thinner film counts as bare metal: overspray dust that no gauge shows.
DEFAULT_PAINTED_ABOVE_UM = 1.0


@dataclass(frozen=True)
class FilmStatistics:
    """What the film on a part amounts to; mean to max are over the painted part of its area.

    Attributes:
        mean_um: mean film [um].
        std_dev_um: standard deviation of the film [um].
        min_um, max_um: least and greatest film [um].
        coverage: share of the part's area that is painted, 0 to 1.
        within_target: share of the painted area in the target band, 0 to 1; NaN without a target.
        painted_volume_cm3: solids on the whole part, dust included [cm3].
        capture_fraction: solids on the part over `emitted_volume_cm3`; NaN without any. It is no
            transfer efficiency: K1 already holds that of a part which catches everything.
        emitted_volume_cm3: solids that a part which catches everything would get [cm3].
        area_m2: of the part [m2].
        painted_above_um: film that counts as painted [um].
        target_um, target_tolerance_um: the band is target +- tolerance [um]; 0 is no target.

    With nothing painted, mean to max are 0.
    """

    mean_um: float
    std_dev_um: float
    min_um: float
    max_um: float
    coverage: float
    within_target: float
    painted_volume_cm3: float
    capture_fraction: float
    emitted_volume_cm3: float
    area_m2: float
    painted_above_um: float
    target_um: float
    target_tolerance_um: float

    def to_dict(self) -> dict[str, float | None]:
        """All figures by name; None stands for NaN, which JSON does not know."""
        return {k: None if math.isnan(v) else float(v) for k, v in asdict(self).items()}


def film_statistics(
    film_um: np.ndarray,
    area_m2: np.ndarray,
    emitted_cm3: float,
    *,
    painted_above_um: float = DEFAULT_PAINTED_ABOVE_UM,
    target_um: float = 0.0,
    target_tolerance_um: float = 0.0,
) -> FilmStatistics:
    """Sum a film up.

    Args:
        film_um: (V,) film at the vertices [um].
        area_m2: (V,) area that each vertex stands for [m2]; 1 um on 1 m2 is 1 cm3.
        emitted_cm3: solids that a part which catches everything would get, K1 times the time
            sprayed [cm3].
        painted_above_um: film that counts as painted [um].
        target_um, target_tolerance_um: target band [um]; target 0 is none.
    """
    painted = film_um > painted_above_um
    film, area = film_um[painted], area_m2[painted]
    painted_area = float(area.sum())
    mean = variance = least = greatest = 0.0
    within = math.nan
    if painted_area > 0.0:
        mean = float(np.sum(film * area)) / painted_area
        variance = float(np.sum((film - mean) ** 2 * area)) / painted_area
        least, greatest = float(film.min()), float(film.max())
    if target_um > 0.0:
        good = np.abs(film - target_um) <= target_tolerance_um
        within = float(area[good].sum()) / painted_area if painted_area > 0.0 else 0.0
    volume = float(np.sum(film_um * area_m2))
    return FilmStatistics(
        mean_um=mean,
        std_dev_um=math.sqrt(variance),
        min_um=least,
        max_um=greatest,
        coverage=painted_area / float(area_m2.sum()),
        within_target=within,
        painted_volume_cm3=volume,
        capture_fraction=volume / emitted_cm3 if emitted_cm3 > 0.0 else math.nan,
        emitted_volume_cm3=float(emitted_cm3),
        area_m2=float(area_m2.sum()),
        painted_above_um=float(painted_above_um),
        target_um=float(target_um),
        target_tolerance_um=float(target_tolerance_um),
    )

"""A flat panel painted by straight parallel passes: eq. (3) across them, how far readings reach.

Section 4.1 of Conner et al. (IROS 2002). Paint that lands beyond the readings is extrapolated. A
little more film along a panel's rim, as fat edges have it, then makes the fitted pattern far too
wide, which its intervals do not show.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.optimize import least_squares
from scipy.special import chdtrc

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import ReadingsError
from paint_deposition.film.pass_film import sampled_collapse
from paint_deposition.inference.fitting.least_squares import Fit
from paint_deposition.inference.fitting.study import Study
from paint_deposition.inference.readings.campaign import Campaign, Experiment
from paint_deposition.inference.readings.plausibility import FEWEST_POINTS
from paint_deposition.inference.readings.readings import Readings, root_mean_square
from paint_deposition.model.eq3_collapse import ThreeGaussianCollapse
from paint_deposition.model.eq4_eq5_uniformity import ParallelPasses
from paint_deposition.motion.trajectory import ONLY_BRUSH


@dataclass(frozen=True)
class Panel:
    """Where readings and passes lie across the direction of travel."""

    across_m: np.ndarray  # (P,) coordinate of each point [m]
    passes_m: np.ndarray  # (n,) coordinate of each pass's line [m]
    speed_m_per_s: np.ndarray  # (n,) of each pass
    # (n,) bool, passes on which the gun was turned by half a turn against the first.
    mirrored: np.ndarray
    distance_m: float  # mean distance of the TCP from the surface, the standoff [m]
    travel_rad: float  # direction of the first pass in the tool's x-y frame [rad]
    brush: int = ONLY_BRUSH  # number of the brush of all passes

    @staticmethod
    def of(experiment: Experiment) -> 'Panel | None':
        """The panel of an experiment, or None if part or motion are of another kind."""
        normals = experiment.measured_points.normals
        positions = experiment.measured_points.positions_m
        outward = normals.mean(axis=0)
        outward /= np.linalg.norm(outward)
        if (normals @ outward).min() < np.cos(np.radians(3.0)) or len(experiment.brushes) != 1:
            return None
        path = experiment.path.select(experiment.path.flow > 0.0)
        passes = [path.select(path.spray_pass == n) for n in np.unique(path.spray_pass)]
        passes = [p for p in passes if p.dwell_s @ p.speed_m_per_s > 0.05]
        if not passes:
            return None
        travels = np.array([p.dwell_s @ p.velocity_m_per_s for p in passes])
        travels /= np.linalg.norm(travels, axis=1, keepdims=True)
        travel = travels[0]
        axes = np.array([np.median(p.rotation, axis=0) for p in passes])
        across, turned = np.cross(-outward, travel), axes[:, :, 0] @ axes[0, :, 0]
        # All but the ends of a pass lie close to one line [m]: the first sub-steps of a pass may
        # still be counted with the pass before.
        parallel = np.cos(np.radians(2.0))
        spread = [np.ptp(np.quantile(p.position_m @ across, (0.05, 0.95))) for p in passes]
        if (
            np.abs(travels @ travel).min() < parallel
            or (-axes[:, :, 2] @ outward).min() < np.cos(np.radians(5.0))
            or np.abs(turned).min() < parallel
            or max(spread) > 0.02
        ):
            return None
        height = np.mean([np.median(p.position_m @ outward) for p in passes])
        return Panel(
            across_m=positions @ across,
            passes_m=np.array([np.median(p.position_m @ across) for p in passes]),
            speed_m_per_s=np.array([np.median(p.speed_m_per_s) for p in passes]),
            mirrored=turned < 0.0,
            distance_m=float(height - (positions @ outward).mean()),
            travel_rad=float(np.arctan2(travel @ axes[0, :, 1], travel @ axes[0, :, 0])),
            brush=min(experiment.brushes),
        )

    @property
    def scale_m(self) -> float:
        """Order of a pass's width: the index, or a share of the readings' extent [m]."""
        if len(self.passes_m) > 1:
            return float(np.median(np.diff(np.sort(self.passes_m))))
        return 0.6 * float(np.ptp(self.across_m))

    @property
    def places_m(self) -> np.ndarray:
        """(P, n) distance of each point from each pass's line, along that pass's own x axis."""
        away = self.across_m[:, np.newaxis] - self.passes_m
        return np.where(self.mirrored, -away, away)

    def film_um(self, collapse: ThreeGaussianCollapse) -> np.ndarray:
        """(P,) film of all passes at the points, eq. (3) being that of the first one [um]."""
        faster = self.speed_m_per_s[0] / self.speed_m_per_s
        return (collapse.thickness_um(self.places_m) * faster).sum(axis=1)

    def figures(self, collapse: ThreeGaussianCollapse, measured_um: np.ndarray) -> dict[str, Any]:
        """Eq. (3), and eq. (5) for it at the panel's own index if it has one, beside (P,) [um]."""
        index = self.scale_m if len(self.passes_m) > 1 else None
        return {
            **collapse.model_dump(),
            'index_m': index,
            'sigma_n': index and ParallelPasses.one_way(collapse).sigma_n(index),
            'rmse_um': root_mean_square(measured_um - self.film_um(collapse)),
            'speed_m_per_s': float(self.speed_m_per_s[0]),
        }


def check_panel(
    readings: Readings, panel: Panel, measured_um: np.ndarray, sigma_um: np.ndarray
) -> None:
    """Refuse a panel whose readings cannot determine a pass.

    Args:
        readings: as taken. panel: where points and passes lie.
        measured_um, sigma_um: (P,) point means and their standard deviations [um].
    """
    places = panel.places_m
    nearest = places[np.arange(len(places)), np.abs(places).argmin(axis=1)]
    # A point lies beside a pass from this share of the panel's scale on.
    beside = 0.05 * panel.scale_m
    if nearest.min() > -beside or nearest.max() < beside:
        missing = 'x < 0' if nearest.min() > -beside else 'x > 0'
        raise ReadingsError(
            f'{readings.source}: all readings lie on one side of the passes ({missing} is bare '
            'of readings, x from tool z times travel); measure across whole passes'
        )
    weights = sigma_um**-2.0
    mean = float(weights @ measured_um) / float(weights.sum())
    scatter = float(weights @ (measured_um - mean) ** 2)
    # The film has structure if noise alone scatters as much with a smaller probability.
    if chdtrc(len(measured_um) - 1, scatter) > 1e-3:
        raise ReadingsError(
            f'{readings.source}: the film varies by no more than the noise of the gauge '
            f'({float(measured_um.std()):.2f} µm between points); there is no pattern in it, '
            'measure beyond the passes or paint at a wider index'
        )


def fit_collapse(
    panel: Panel, measured_um: np.ndarray, sigma_um: np.ndarray
) -> ThreeGaussianCollapse:
    """Fit eq. (3) of the first pass, summed over all, by a loss that forgives gross errors.

    Args:
        panel: where points and passes lie.
        measured_um, sigma_um: (P,) point means and their standard deviations [um].
    """
    scale = panel.scale_m
    faster = panel.speed_m_per_s[0] / panel.speed_m_per_s
    places = panel.places_m / scale
    area = max(float(measured_um.mean()), 1e-3)

    def film(x: np.ndarray) -> np.ndarray:
        gains, centres, sigmas = x[:3] * area, np.array([x[3], -x[4], 0.0]), np.exp(x[5:])
        away = (places[:, :, np.newaxis] - centres) / sigmas
        heights = gains / (3.0 * np.sqrt(2.0 * np.pi) * sigmas)
        return ((heights * np.exp(-0.5 * away**2)).sum(axis=2) * faster).sum(axis=1)

    low = [0.0, 0.0, 0.0, 0.0, 0.0, *3 * [np.log(0.02)]]
    high = [30.0, 30.0, 30.0, 1.5, 1.5, *3 * [np.log(1.0)]]
    # Starts are offset radii and standard deviations in units of the panel's scale; residuals
    # beyond ``f_scale`` standard deviations get a smaller weight.
    found = [
        least_squares(
            lambda x: (film(x) - measured_um) / sigma_um,
            [1.0, 1.0, 1.0, radius, radius, *np.log([sigma, sigma, 1.5 * sigma])],
            bounds=(low, high), loss='soft_l1', f_scale=2.0,
            x_scale=[1.0, 1.0, 1.0, 0.2, 0.2, 0.5, 0.5, 0.5], max_nfev=60,
        )
        for radius, sigma in product((0.2, 0.35, 0.5), (0.12, 0.22))
    ]  # fmt: skip
    best = min(found, key=lambda result: result.cost).x
    gain = best[:3] * area * scale
    sigma = np.exp(best[5:]) * scale
    return ThreeGaussianCollapse(
        K1_um_m=gain[0], K2_um_m=gain[1], K3_um_m=gain[2],
        r1_m=best[3] * scale, r2_m=best[4] * scale,
        sigma1_m=sigma[0], sigma2_m=sigma[1], sigma3_m=sigma[2],
    )  # fmt: skip


# Readings reach an edge of the pattern beyond which no more of a pass's paint lands than this.
PAINT_BEYOND = 0.025
# Of a pass the distances of the outermost readings on either side [m], the shares of its paint
# that land further out, and the distance at which both sides would be reached [m].
Reach = tuple[tuple[float, float], tuple[float, float], float]


def short_reaches(campaign: Campaign, model: DepositionModel) -> dict[int, str]:
    """The panels of a campaign on which no pass was measured to both edges of its pattern.

    By the number of their experiment, a sentence each. Of a brush there are none if one of its
    panels shows both edges, or where no part is a flat panel.
    """
    by_brush: dict[int, dict[int, Reach]] = {}
    for k, one in enumerate(campaign.experiments):
        if panel := Panel.of(one):
            reach = reach_of(panel, model.painting_with(panel.brush))
            by_brush.setdefault(panel.brush, {})[k] = reach
    found: dict[int, str] = {}
    for reaches in by_brush.values():
        if min(max(beyond) for _, beyond, _ in reaches.values()) > PAINT_BEYOND:
            for k, (ends_m, beyond, needed_m) in reaches.items():
                found[k] = (
                    f'{campaign.experiments[k].name}: the readings end {ends_m[0]:.2f} and '
                    f'{ends_m[1]:.2f} m to the sides of a pass, where {100 * beyond[0]:.0f} and '
                    f'{100 * beyond[1]:.0f} % of its paint lands further out: the edges of the '
                    'pattern are extrapolated; measure, on a larger panel if need be, '
                    f'about {needed_m:.1f} m to both sides of a pass'
                )
    return found


def shifts(
    study: Study, fit: Fit, short: Iterable[int], fitted: Callable[[Study], Fit]
) -> np.ndarray:
    """(n, k) by how much the fit's vector moves without the readings at the ends.

    Args:
        short: numbers of the panels whose ends are left out, strip by strip.
    """
    experiments, moved = study.campaign.experiments, []
    panels = {k: panel for k in short if (panel := Panel.of(experiments[k]))}
    # Width of the strips at the ends [m].
    for strip_m in (0.05, 0.1):
        inside = np.ones(len(study), dtype=bool)
        for number, panel in panels.items():
            low, high = panel.across_m.min() + strip_m, panel.across_m.max() - strip_m
            here = study.campaign.experiment_of == number
            inside[here] = (panel.across_m >= low) & (panel.across_m <= high)
        if FEWEST_POINTS <= inside.sum() < len(inside):
            try:
                moved.append(fitted(study.of_points(inside)).vector - fit.vector)
            except ReadingsError:  # no reading of a part is left
                continue
    return np.array(moved).reshape(len(moved), len(fit.vector))


def reach_of(panel: Panel, model: DepositionModel) -> Reach:
    """How far the readings of a panel reach to both sides of the pass that they cover best."""
    reaches: list[Reach] = []
    low, high = panel.across_m.min(), panel.across_m.max()
    passes = zip(panel.passes_m, panel.speed_m_per_s, panel.mirrored, strict=True)
    for line, speed, mirrored in passes:
        collapse = sampled_collapse(
            model, speed, standoff_m=panel.distance_m, travel_rad=panel.travel_rad, turned=mirrored
        )
        x, landed = collapse.x_m, cumulative_trapezoid(collapse.film_um, collapse.x_m, initial=0.0)
        landed = landed / landed[-1]
        below, above = np.interp([low - line, high - line], x, landed, left=0.0, right=1.0)
        beyond = float(below), float(1.0 - above)
        ends = np.interp([PAINT_BEYOND, 1.0 - PAINT_BEYOND], landed, x)
        to_ends = float(line - low), float(high - line)
        needed_m = float(np.abs(ends).max())
        reaches.append((to_ends, beyond, needed_m))
    return min(reaches, key=lambda reach: max(reach[1]))

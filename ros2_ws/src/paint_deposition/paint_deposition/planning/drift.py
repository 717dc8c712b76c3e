"""How far index and standoff may drift before sigma_n leaves its tolerance."""

from dataclasses import replace

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.model.uniformity import ParallelPasses
from paint_deposition.planning.index_search import farthest_within
from paint_deposition.planning.pass_setup import PassSetup

# Drift is followed as far as these shares of the right value.
LEAST, MOST = 0.4, 1.8
STEPS = 100
# With effects each step costs a pass through the integrator.
STEPS_WITH_EFFECTS = 12


def index_drift_m(raster: ParallelPasses, index_m: float, tolerance: float) -> tuple[float, float]:
    """Least and greatest index around a good one that keep sigma_n within the tolerance [m]."""
    return (
        farthest_within(raster.sigma_n, index_m, LEAST * index_m, tolerance, STEPS),
        farthest_within(raster.sigma_n, index_m, MOST * index_m, tolerance, STEPS),
    )


def standoff_drift_m(
    model: DepositionModel,
    setup: PassSetup,
    speed_m_per_s: float,
    index_m: float,
    tolerance: float,
    index_drift: tuple[float, float],
) -> tuple[float, float]:
    """Change of standoff, nearer (negative) and further, that keeps within the tolerance [m].

    The bare projection widens a pass in proportion to its distance from the emission point,
    which is as good as a narrower index; with effects every standoff is computed.
    """
    here = setup.standoff_m
    if not model.effects:
        distance = here + model.projection.emission_offset_m
        nearer = distance * (index_m / index_drift[1] - 1.0)
        return max(nearer, -here), distance * (index_m / index_drift[0] - 1.0)

    both_ways = not setup.raster(model, speed_m_per_s).alike

    def sigma_n(standoff_m: float) -> float:
        there = replace(setup, standoff_m=standoff_m, one_way=setup.one_way or not both_ways)
        return there.raster(model, speed_m_per_s).sigma_n(index_m)

    nearest = farthest_within(sigma_n, here, LEAST * here, tolerance, STEPS_WITH_EFFECTS)
    farthest = farthest_within(sigma_n, here, MOST * here, tolerance, STEPS_WITH_EFFECTS)
    return nearest - here, farthest - here

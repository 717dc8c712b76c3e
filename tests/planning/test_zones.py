"""Films that are to be on the targets of their zones."""

import numpy as np
import pytest

import paint_deposition as pd
from paint_deposition.errors import PaintError
from paint_deposition.part.zones import Box, Zone, Zones
from planning.test_improvement import NARROW, even, panel  # noqa: F401


def zone(name, target_um, tolerance_um, low_x=-1.0, high_x=1.0):
    box = np.array([[low_x, -1.0, -1.0], [high_x, 1.0, 1.0]])
    return Zone(name, target_um, tolerance_um, (Box(box),))


@pytest.mark.slow
def test_each_zone_comes_to_its_target(panel, even):  # noqa: F811
    """The gun is slower over the half that is to be thicker; between them the spray blends."""
    thin, thick = 0.9 * even.mean_um, 1.25 * even.mean_um
    # Between the halves is a strip as wide as the spray, in which any film will do.
    zones = Zones((
        zone('left', thin, 0.1 * thin, high_x=-0.06), zone('right', thick, 0.1 * thick, 0.06),
    ))  # fmt: skip
    found = pd.improve(panel, even.trajectory, NARROW, zones=zones, paint_weight=0.0)
    left, right = found.after.statistics.zones.values()
    assert (left.mean_um, right.mean_um) == pytest.approx((thin, thick), rel=0.04)
    before, after = (one.statistics.zones for one in (found.before, found.after))
    for name in ('left', 'right'):
        assert after[name].within_target > before[name].within_target + 0.2
    assert found.after.sigma_n < 0.4 * found.before.sigma_n
    written = found.to_dict()['zones']
    assert [(one['name'], one['after']['mean_um']) for one in written] == [
        ('left', left.mean_um), ('right', right.mean_um),
    ]  # fmt: skip
    x = panel.vertices_m[:, 0]
    assert not found.wanted.region[np.abs(x) < 0.059].any()


@pytest.mark.slow
def test_one_zone_over_all_is_the_target_of_the_part(panel, even):  # noqa: F811
    target = 1.1 * even.mean_um
    whole = Zones((zone('all', target, 0.1 * target),))
    of_zone = pd.improve(panel, even.trajectory, NARROW, zones=whole)
    of_part = pd.improve(panel, even.trajectory, NARROW, target_um=target, tolerance=0.1)
    np.testing.assert_allclose(of_zone.after.film_um, of_part.after.film_um, rtol=1e-9)
    assert of_zone.after.sigma_n == pytest.approx(of_part.after.sigma_n, rel=1e-9)
    assert of_zone.after.within == pytest.approx(of_part.after.within)


@pytest.mark.slow
def test_a_plan_for_zones_needs_no_other_target(panel):  # noqa: F811
    zones = Zones((zone('left', 15.0, 2.0, high_x=0.0), zone('right', 20.0, 2.0)))
    found = pd.plan(panel, NARROW, zones=zones, overspray_m=0.2)
    left, right = found.statistics.zones.values()
    assert (left.mean_um, right.mean_um) == pytest.approx((15.0, 20.0), abs=1.0)
    assert found.unoptimised.sigma_n > 1.5 * found.sigma_n
    with pytest.raises(PaintError, match="zone 'far' holds no vertex"):
        pd.plan(panel, NARROW, zones=Zones((zone('far', 9.0, 1.0, low_x=3.0, high_x=4.0),)))

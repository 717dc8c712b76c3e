"""Whether the gun keeps clear of the part."""

from dataclasses import replace

import numpy as np
import pytest

import paint_deposition as pd
from booth import panel, panel_with_screen, serpentine
from paint_deposition.errors import PlanError
from paint_deposition.planning.planned_film import contacts
from paint_deposition.planning.requests import GunEnvelope

# The gun runs along x at 0.25 m before the panel; the screen stands 0.1 m before it at |x| < 0.05.
SPEED, HALF = 0.3, 0.45
MOTION = serpentine(speed_m_per_s=SPEED, half_width_m=HALF)


def test_a_screen_before_the_gun_is_met_while_it_passes():
    assert contacts(panel(), MOTION, GunEnvelope()) == ()
    (contact,) = contacts(panel_with_screen(), MOTION, GunEnvelope(radius_m=0.04, before_m=0.2))
    assert not contact.by_gun
    # By 200 mm of cylinder over the 150 mm from the TCP to the screen; aside no further than 40.
    assert contact.depth_m == pytest.approx(0.04, abs=0.01)
    assert contact.begin_s == pytest.approx((HALF - 0.05 - 0.04) / SPEED, abs=0.05)
    assert contact.end_s == pytest.approx((HALF + 0.05 + 0.04) / SPEED, abs=0.05)
    assert abs(contact.place_m[1] + 0.1) < 1e-9


@pytest.mark.slow
def test_a_plan_on_which_the_gun_touches_the_part_is_refused_or_says_so(tmp_path):
    """The gun's body reaches back from the TCP, 30 mm from the panel: the screen is in its way."""
    low = {'speed_m_per_s': 0.3, 'standoff_m': 0.03, 'smoothing_radius_m': 0.3}
    with pytest.raises(PlanError, match=r'the gun touches the part at .* allow_contact keeps it'):
        pd.plan(panel_with_screen(), **low)
    kept = pd.plan(panel_with_screen(), allow_contact=True, **low)
    touched, *_ = [line for line in kept.warnings if 'the gun touches the part' in line]
    pd.write(kept, tmp_path)
    assert f'! WARNING: {touched}' in (tmp_path / 'passes.mod').read_text()


def test_a_gun_in_the_part_is_told_from_a_near_part():
    through = replace(MOTION, positions_m=MOTION.positions_m + np.array([0.0, 0.2, 0.0]))
    (contact,) = contacts(panel_with_screen(), through, GunEnvelope(radius_m=0.04, before_m=0.0))
    assert contact.by_gun
    assert 'touches' in str(contact)

"""Flow control of a replay: who has taken what, and who is not waited for."""

import pytest

pytest.importorskip('rclpy')

from paint_deposition.nodes.replay.flow_control import LOST_AFTER_S, UNHEARD_AFTER_S, PoseWindow


def published(window: PoseWindow, stamps, now_s: float = 0.0) -> PoseWindow:
    for stamp in stamps:
        window.publish(stamp, now_s)
    return window


def test_what_never_arrives_is_given_up_while_reports_come():
    window = PoseWindow()
    window.present(['simulator'], 0.0)
    published(window, range(10), now_s=0.0)
    now_s = 0.0
    while now_s < LOST_AFTER_S:
        window.report('simulator', 6, now_s)
        assert window.ahead(now_s) == 3
        now_s += 0.2
    window.report('simulator', 6, now_s + 0.2)
    assert window.ahead(now_s + 0.2) == 0
    assert window.lost() == {'simulator': 3}


def test_who_never_reports_is_given_up_until_it_does():
    """The others are waited for as before."""
    window = PoseWindow()
    window.present(['mute', 'simulator'], 0.0)
    published(window, range(10), now_s=0.0)
    window.report('simulator', 7, 0.0)
    assert window.ahead(UNHEARD_AFTER_S - 0.1) == 10
    assert window.unheard() == []
    assert window.ahead(UNHEARD_AFTER_S + 0.1) == 2
    assert window.unheard() == ['mute']
    assert window.slowest() == ['simulator']
    published(window, range(10, 20), now_s=30.0)
    window.report('simulator', 19, 30.0)
    assert window.ahead(30.0) == 0
    published(window, range(20, 25), now_s=40.0)
    window.report('simulator', 24, 40.0)
    window.report('mute', 21, 40.0)
    published(window, range(25, 26), now_s=40.0)
    assert window.ahead(40.0) > 0

"""Flow control of a replay: who has taken what, and who is not waited for."""

import threading

import pytest
from geometry_msgs.msg import PoseStamped

from paint_deposition.nodes.bags.pace import LOST_TIMEOUT_S, NO_REPORT_TIMEOUT_S, FlowControl


@pytest.fixture
def window(cell):
    """The control of a publisher of poses."""
    publisher = cell.create_publisher(PoseStamped, 'atomizer/pose', 10)
    return FlowControl(cell, publisher, 200, threading.Event())


def published(window: FlowControl, stamps, now_s: float = 0.0) -> None:
    for stamp in stamps:
        window.add_sent(stamp, now_s)


def test_lost_poses_are_not_waited_for_while_reports_arrive(window):
    window.set_subscribers(['simulator'], 0.0)
    published(window, range(10))
    now_s = 0.0
    while now_s < LOST_TIMEOUT_S:
        window.report('simulator', 6, now_s)
        assert window.lag(now_s) == {'simulator': 3}
        now_s += 0.2
    window.report('simulator', 6, now_s + 0.2)
    assert window.lag(now_s + 0.2) == {}
    assert window.subscribers['simulator'].lost == 3


def test_a_subscriber_that_never_reports_is_not_waited_for(window):
    """The others are waited for as before."""
    window.set_subscribers(['mute', 'simulator'], 0.0)
    published(window, range(10))
    window.report('simulator', 7, 0.0)
    assert window.lag(NO_REPORT_TIMEOUT_S - 0.1) == {'mute': 10, 'simulator': 2}
    assert window.lag(NO_REPORT_TIMEOUT_S + 0.1) == {'simulator': 2}
    assert window.subscribers['mute'].never_reported
    published(window, range(10, 25), now_s=40.0)
    window.report('simulator', 24, 40.0)
    window.report('mute', 21, 40.0)
    assert window.lag(40.0) == {'mute': 3}


def test_only_present_subscribers_are_waited_for(window):
    window.set_subscribers(['doomed', 'survivor'], 0.0)
    published(window, range(10))
    window.report('survivor', 9, 0.0)
    assert window.lag(0.0) == {'doomed': 10}
    window.set_subscribers(['late', 'survivor'], 0.0)
    assert window.lag(0.0) == {}
    published(window, range(10, 15))
    window.report('survivor', 14, 0.0)
    assert window.lag(0.0) == {'late': 5}

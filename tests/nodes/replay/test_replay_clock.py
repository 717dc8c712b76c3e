"""The time in a bag against the steady clock, whatever else the machine does."""

import time

import pytest

pytest.importorskip('rclpy')

from paint_deposition.nodes.replay.replay_clock import ReplayClock

START_NS = 1_760_000_000_000_000_000


@pytest.mark.parametrize('rate', [0.5, 2.0])
def test_time_runs_at_the_rate(rate):
    clock = ReplayClock(rate)
    clock.stand_at(START_NS)
    before_s = time.monotonic()
    clock.start()
    after_s = time.monotonic()
    clock.wait_for(START_NS + 50_000_000, timeout_s=0.1)
    read_s = time.monotonic()
    ran_ns = clock.time_ns - START_NS
    done_s = time.monotonic()
    assert rate * (read_s - after_s) * 1e9 - 1 <= ran_ns <= rate * (done_s - before_s) * 1e9 + 1
    assert ran_ns > 0


def test_a_pause_takes_no_time():
    clock = ReplayClock(1.0)
    clock.stand_at(START_NS)
    clock.start()
    clock.pause()
    paused_ns = clock.time_ns
    assert not clock.wait_for(paused_ns + 1, timeout_s=0.01)
    assert clock.time_ns == paused_ns
    clock.resume()
    assert clock.wait_for(paused_ns + 1, timeout_s=60.0)


def test_at_rate_0_time_jumps_from_message_to_message():
    clock = ReplayClock(0.0)
    clock.stand_at(START_NS)
    clock.start()
    assert clock.wait_for(START_NS + 10**12, timeout_s=60.0)
    assert clock.time_ns == START_NS
    clock.reach(START_NS + 10**12)
    assert clock.time_ns == START_NS + 10**12

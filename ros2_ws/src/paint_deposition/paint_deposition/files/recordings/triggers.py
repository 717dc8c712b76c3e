"""When the gun was on: AtomizerState, Bool, or a number in any field of any message."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Any

import numpy as np

from paint_deposition.errors import RecordingError, did_you_mean
from paint_deposition.files.recordings.bag_files import Bag, BagTopic
from paint_deposition.files.recordings.headers import set_points_of, stamp_ns
from paint_deposition.files.recordings.message_definitions import STATE_TYPE
from paint_deposition.files.recordings.signals import Signal
from paint_deposition.motion.trajectory import numbered
from paint_deposition.motion.trigger import ONLY_BRUSH, SPRAYS_NOTHING, relative_flow

BOOL_TYPE = 'std_msgs/msg/Bool'
# What a state says of the process while the gun sprays.
SETTINGS = ('flow', 'shaping_air_l_per_min', 'bell_speed_rpm', 'voltage_kv')
MOST_FIELDS = 12


@dataclass(frozen=True)
class Switching:
    """How the gun was switched.

    Attributes:
        stamps_ns: (M,) int64 times of the changes, those of the log where ``by_log_time``.
        flow: (M,) from then on.
        brush: (M,) int64 from then on; empty where it is not recorded.
        set_points: (M, 4) as those of a trajectory; empty where none are recorded.
        settings: median of each setting in the states.
        notes: what was understood, a line each.
    """

    stamps_ns: np.ndarray
    flow: np.ndarray
    brush: np.ndarray
    set_points: np.ndarray = field(default_factory=lambda: np.empty((0, 4)))
    settings: dict[str, float] = field(default_factory=dict)
    by_log_time: bool = False
    notes: tuple[str, ...] = ()


def choose_state_topic(bag: Bag, name: str) -> BagTopic:
    """The named topic of a bag, AtomizerState or Bool."""
    return bag.choose(name, (STATE_TYPE, BOOL_TYPE), 'state')


def unused_triggers(bag: Bag) -> tuple[str, ...]:
    """One note that names the topics that could be the trigger; none where there are none."""
    # States say what they are, a Bool may be anything: the first is the likeliest trigger.
    topics = [topic for topic in bag.topics_of(STATE_TYPE, BOOL_TYPE) if topic.message_count]
    if not topics:
        return ()
    named = ' and '.join(f'{topic.name} ({topic.type})' for topic in topics)
    return (
        f'recording {bag.path}: {named} {"is" if len(topics) == 1 else "are"} not used, the gun '
        f'sprays whenever poses flow; add `state_topic: {topics[0].name}` (--state-topic) if '
        'that is the trigger',
    )


def read_switching(bag: Bag, name: str) -> Switching:
    """How a topic of AtomizerState (header stamps) or Bool (log times) switched the gun.

    Or a field of other messages and, where it is not 0, the level beyond which the gun is on:
    ``/io.states[3]``, ``/io.level > 12``, ``/io.closed < 1``. Raises RecordingError where there is
    no such topic or field, or it is no switch.
    """
    signal = Signal.of(name)
    topic = bag.find(signal.topic) if signal else None
    if signal is None or topic is None or topic.type in (STATE_TYPE, BOOL_TYPE):
        return _states(bag, choose_state_topic(bag, name))
    rows = sorted(_values(bag, topic, signal), key=lambda row: row[0])
    known = [row for row in rows if math.isfinite(row[1])]
    if not known:
        raise RecordingError(f'{topic.name} in {bag.path} has no numbers; record it again')
    stamps, values, _ = map(np.array, zip(*known, strict=True))
    note = (
        f'trigger {topic.name}{signal.path} is {values.min():.4g} to {values.max():.4g}: the gun '
        f'is on where it is {"below" if signal.below else "above"} {signal.level:g}'
    )
    if left_out := len(rows) - len(known):
        note += f'; {left_out} values that are no number are left out'
    on, by_log = signal.is_on(values), not all(stamped for *_, stamped in rows)
    return Switching(stamps, on.astype(float), numbered([]), by_log_time=by_log, notes=(note,))


def _states(bag: Bag, topic: BagTopic) -> Switching:
    """Changes of AtomizerState or Bool; a state without a brush is of the only one."""
    changes: list[tuple[int, float, int, tuple[float, ...]]] = []
    settings: dict[str, list[float]] = {}
    without_flow = 0
    for _, log_time_ns, message in bag.decoded([topic.name]):
        if topic.type == BOOL_TYPE:
            flow = relative_flow(bool(message.data))
            changes.append((log_time_ns, flow, ONLY_BRUSH, (0.0,) * 4))
            continue
        stamp = stamp_ns(message.header)
        if stamp == 0:
            raise RecordingError(
                f'{topic.name} in {bag.path} has a state without a stamp; '
                'let the publisher stamp each state'
            )
        flow = relative_flow(message.spraying, message.flow)
        without_flow += bool(message.spraying) and flow == 0.0
        brush = int(getattr(message, 'brush', ONLY_BRUSH))
        changes.append((stamp, flow, brush, set_points_of(message)))
        for name in SETTINGS:
            value = getattr(message, name, np.nan)
            if message.spraying and np.isfinite(value):
                settings.setdefault(name, []).append(value)
    changes.sort(key=lambda change: change[0])
    set_points = np.array([points for *_, points in changes])
    notes = (f'trigger {topic.name} {SPRAYS_NOTHING} ({without_flow} states)',)
    return Switching(
        np.array([stamp for stamp, *_ in changes], dtype=np.int64),
        np.array([flow for _, flow, *_ in changes], dtype=float),
        numbered([brush for _, _, brush, _ in changes]),
        set_points if set_points.any() else np.empty((0, 4)),
        {name: float(np.median(values)) for name, values in settings.items()},
        topic.type == BOOL_TYPE,
        notes if without_flow else (),
    )


def _values(bag: Bag, topic: BagTopic, signal: Signal) -> Iterator[tuple[int, float, bool]]:
    """(time, value, whether the time is the message's own stamp) of each message."""
    for _, log_time_ns, message in bag.decoded([topic.name]):
        stamp = stamp_ns(message.header) if hasattr(message, 'header') else 0
        value = signal.value(message)
        if value is None:
            raise RecordingError(_no_field(bag, topic, message, signal.path))
        yield stamp or log_time_ns, value, bool(stamp)


def _no_field(bag: Bag, topic: BagTopic, message: Any, path: str) -> str:
    """What is wrong with a field, and those that could be meant."""
    found = [f'{topic.name}{switch}' for switch in _switches(message)]
    listed = ' '.join(found[:MOST_FIELDS]) + (' ...' if len(found) > MOST_FIELDS else '')
    if not path:
        return f'{topic.name} in {bag.path} is {topic.type}; name one of its fields: {listed}'
    remedy = did_you_mean(topic.name + path, found, f'there are: {listed or "none"}')
    return f'{topic.name} in {bag.path} has no number or Bool at {path}; {remedy}'


def _switches(value: Any, path: str = '') -> Iterator[str]:
    """Paths to the numbers and Bools in a message."""
    if isinstance(value, bool | int | float | np.bool_ | np.number):
        yield path
    elif is_dataclass(value):
        for item in fields(value):
            if item.name not in ('header', '__msgtype__'):
                yield from _switches(getattr(value, item.name), f'{path}.{item.name}')
    elif isinstance(value, list | np.ndarray):
        for index, inner in enumerate(value[: MOST_FIELDS + 1]):
            yield from _switches(inner, f'{path}[{index}]')

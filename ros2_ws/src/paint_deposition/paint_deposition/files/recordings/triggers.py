"""The trigger of a recording: AtomizerState, Bool, or a number in a field of any message."""

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any

import numpy as np

from paint_deposition.errors import RecordingError, did_you_mean
from paint_deposition.files.recordings.bag_files import Bag, BagTopic, custom_data
from paint_deposition.files.recordings.messages import STATE_TYPE, stamp_ns, trigger_change
from paint_deposition.motion.pose_stream import TriggerChange
from paint_deposition.motion.trajectory import (
    ONLY_BRUSH,
    SPRAYS_NOTHING,
    Trajectory,
    numbered,
    relative_flow,
)

BOOL_TYPE = 'std_msgs/msg/Bool'
# Fields of AtomizerState that are summarised while the gun sprays.
SETTINGS = ('flow', 'shaping_air_l_per_min', 'bell_speed_rpm', 'voltage_kv')
MOST_FIELDS = 12
SYNTAX = re.compile(
    r'(?P<topic>[\w/~]+)(?P<path>(\.\w+|\[\d+\])*)\s*((?P<side>[<>])\s*(?P<level>[-+.\deE]+))?'
)
STEP = re.compile(r'\.(\w+)|\[(\d+)\]')


@dataclass(frozen=True)
class Signal:
    """A signal such as ``/io.states[3]``, ``/io.level > 12`` or ``/io.closed < 1``.

    ``path`` of the field is '' for the field ``data`` of std_msgs. The signal is on above
    ``level``, or under it if ``below`` is set.
    """

    topic: str
    path: str
    below: bool = False
    level: float = 0.0

    @staticmethod
    def parse(text: str) -> 'Signal | None':
        """Parse a signal, None for other text; raises RecordingError for an invalid level."""
        match = SYNTAX.fullmatch(text.strip())
        if match is None:
            return None
        try:
            level = float(match['level'] or 0.0)
        except ValueError:
            raise RecordingError(
                f"{text}: '{match['level']}' is no number; give a level such as 12"
            ) from None
        return Signal(match['topic'], match['path'], match['side'] == '<', level)

    def value(self, message: Any) -> float | None:
        """The number in a message, None where there is none."""
        value = message
        # The messages of std_msgs have one field.
        try:
            for name, index in STEP.findall(self.path) or [('data', '')]:
                value = getattr(value, name) if name else value[int(index)]
        except (AttributeError, IndexError, TypeError):
            return None
        known = isinstance(value, bool | int | float | np.bool_ | np.number)
        return float(value) if known else None

    def is_on(self, values: Any) -> Any:
        """Whether the signal is on at a value, or at each of an array."""
        return values < self.level if self.below else values > self.level


# A change of the trigger: its time, flow and brush from then on, and when it was logged [ns].
Change = tuple[int, float, int, int]
# For a trigger without stamps the log times are used, if those of the poses show that recorder and
# robot have the same clock.
MAX_CLOCK_OFFSET_S = 1.0


def choose_state_topic(bag: Bag, name: str) -> BagTopic:
    """The named topic of a bag, AtomizerState or Bool."""
    return bag.choose(name, (STATE_TYPE, BOOL_TYPE), 'state')


def with_trigger(bag: Bag, name: str, motion: Trajectory, log_times_ns: np.ndarray) -> Trajectory:
    """The motion, logged at (N,) int64, with the trigger of a topic.

    That is AtomizerState (header stamps) or Bool (log times), or a field of other messages, with
    the level beyond which the gun is on unless it is 0: ``/io.states[3]``, ``/io.level > 12``,
    ``/io.closed < 1``. Raises RecordingError if there is no such topic or field, if it is no
    number, or if it has no stamps and the clock of the robot is another than the recorder's.
    """
    signal, settings = Signal.parse(name), dict[str, float]()
    topic = bag.find(signal.topic) if signal else None
    if signal is None or topic is None or topic.type in (STATE_TYPE, BOOL_TYPE):
        topic = choose_state_topic(bag, name)
        by_log_time = topic.type == BOOL_TYPE
        changes, settings, notes = _changes_of_states(bag, topic)
    else:
        changes, by_log_time, notes = _changes_of_signal(bag, topic, signal)
    offset_s = float(np.median(log_times_ns - motion.stamps_ns)) * 1e-9
    if by_log_time and abs(offset_s) > MAX_CLOCK_OFFSET_S:
        raise RecordingError(
            f'{name} in {bag.path} has no stamps, and the stream of poses was logged '
            f'{offset_s:.3g} s off its own stamps; record {STATE_TYPE} instead'
        )
    rows: np.ndarray = np.empty(0, np.int64)
    # Where the clock was set back, the order in which they came says of which stream they are; in
    # the run of a part it says so as it did to the simulator.
    if 'serial' in custom_data(bag.path) or np.any(np.diff(motion.stamps_ns) < 0):
        logged = np.array([change[3] for change in changes], np.int64)
        rows = np.searchsorted(np.maximum.accumulate(log_times_ns), logged)
    else:
        changes.sort(key=lambda change: change[0])
    return replace(
        motion, trigger_stamps_ns=np.array([change[0] for change in changes], np.int64),
        trigger_flow=np.array([change[1] for change in changes], float),
        trigger_brush=numbered([change[2] for change in changes]), trigger_rows=rows,
        settings=settings, notes=(*motion.notes, *notes),
    )  # fmt: skip


def _changes_of_signal(
    bag: Bag, topic: BagTopic, signal: Signal
) -> tuple[list[Change], bool, list[str]]:
    """The changes of a signal, whether they are by log time, and how it was interpreted."""
    rows: list[tuple[int, float, int, bool]] = []
    for _, log_time_ns, message in bag.decoded([topic.name]):
        stamp = stamp_ns(message.header) if hasattr(message, 'header') else 0
        value = signal.value(message)
        if value is None:
            found = [f'{topic.name}{path}' for path in _numeric_fields(message)]
            listed = ' '.join(found[:MOST_FIELDS]) + (' ...' if len(found) > MOST_FIELDS else '')
            if not signal.path:
                raise RecordingError(
                    f'{topic.name} in {bag.path} is {topic.type}; name one of its fields: {listed}'
                )
            raise RecordingError(
                f'{topic.name} in {bag.path} has no number or Bool at {signal.path}; '
                + did_you_mean(topic.name + signal.path, found, f'there are: {listed or "none"}')
            )
        rows.append((stamp or log_time_ns, value, log_time_ns, bool(stamp)))
    known = [row for row in rows if math.isfinite(row[1])]
    if not known:
        raise RecordingError(f'{topic.name} in {bag.path} has no numbers; record it again')
    values = [value for _, value, *_ in known]
    note = (
        f'trigger {topic.name}{signal.path} is {min(values):.4g} to {max(values):.4g}: the gun '
        f'is on where it is {"below" if signal.below else "above"} {signal.level:g}'
    )
    if left_out := len(rows) - len(known):
        note += f'; {left_out} values that are no number are left out'
    changes = [(at, float(signal.is_on(v)), ONLY_BRUSH, logged) for at, v, logged, _ in known]
    return changes, not all(stamped for *_, stamped in rows), [note]


def _changes_of_states(
    bag: Bag, topic: BagTopic
) -> tuple[list[Change], dict[str, float], list[str]]:
    """The changes on a topic of AtomizerState or Bool, the median of each setting, and notes."""
    changes: list[Change] = []
    settings: dict[str, list[float]] = {}
    without_flow, refused = 0, []
    for _, log_time_ns, message in bag.decoded([topic.name]):
        if topic.type == BOOL_TYPE:
            change = TriggerChange(log_time_ns, relative_flow(bool(message.data)))
        else:
            try:
                change = trigger_change(message)
            except RecordingError as error:
                refused.append(str(error))
                continue
            without_flow += bool(message.spraying) and change.flow == 0.0
        changes.append((change.stamp_ns, change.flow, change.brush, log_time_ns))
        for name in SETTINGS if change.flow > 0.0 else ():
            value = getattr(message, name, np.nan)
            if np.isfinite(value) and value != 0.0:  # 0 is what is not filled
                settings.setdefault(name, []).append(value)
    if refused:
        bag.skipped[f'states on {topic.name}, the first of them an {refused[0]}'] = len(refused)
    notes = [f'trigger {topic.name} {SPRAYS_NOTHING} ({without_flow} states)'] * bool(without_flow)
    return changes, {name: float(np.median(values)) for name, values in settings.items()}, notes


def _numeric_fields(value: Any, path: str = '') -> Iterator[str]:
    """Paths to the numbers and Bools in a message."""
    if isinstance(value, bool | int | float | np.bool_ | np.number):
        yield path
    elif is_dataclass(value):
        for item in fields(value):
            if item.name not in ('header', '__msgtype__'):
                yield from _numeric_fields(getattr(value, item.name), f'{path}.{item.name}')
    elif isinstance(value, list | np.ndarray):
        for index, inner in enumerate(value[: MOST_FIELDS + 1]):
            yield from _numeric_fields(inner, f'{path}[{index}]')

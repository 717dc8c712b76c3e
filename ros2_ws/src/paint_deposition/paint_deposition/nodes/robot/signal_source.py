"""What the sources of a gun's signals have in common: from signals to states, and their delay."""

import math
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any
from urllib.parse import urlsplit

import numpy as np
from geometry_msgs.msg import PoseStamped
from paint_msgs.msg import AtomizerState
from rclpy.qos import qos_profile_sensor_data

from paint_deposition.errors import PaintError
from paint_deposition.files.recordings.headers import pose_of, stamp_ns
from paint_deposition.files.recordings.triggers import MAX_CLOCK_OFFSET_S
from paint_deposition.motion.stream_quality import SpeedNow
from paint_deposition.nodes.robot.atomizer_source import LATCHED_STATES, POSES
from paint_deposition.nodes.runtime.messages import header
from paint_deposition.nodes.runtime.node import ERROR, OK, WARN, PaintNode, Status
from paint_deposition.nodes.runtime.parameters import NodeParameter

# What a state takes from signals: the field, and its unit.
FIELDS = {
    'flow': ('flow_cm3_per_min', 'cm3/min'), 'bell_speed': ('bell_speed_rpm', '1/min'),
    'shaping_air': ('shaping_air_l_per_min', 'l/min'), 'voltage': ('voltage_kv', 'kV'),
}  # fmt: skip
REMEMBERED = 50

SIGNALS = {
    'trigger': NodeParameter('', 'Signal that opens the gun [name]'),
    'trigger_level': NodeParameter(0.0, 'The gun is on above this value of it [its unit]'),
    **{
        name: NodeParameter('', f'Signal of {name}, in {unit}; empty: unknown [name]')
        for name, (_, unit) in FIELDS.items()
    },
    'calibrated_flow': NodeParameter(
        0.0, 'Flow at which the model was calibrated; 0: flow counts as it [cm3/min]',
        (0.0, math.inf),
    ),
    'delay_s': NodeParameter(
        0.0, 'How late a signal is that has no time of its own, taken from its stamp [s]',
        (0.0, 10.0),
    ),
}  # fmt: skip


class StartsOfMotion:
    """Finds in poses when the gun starts from rest, and how late its opening is told.

    In a programme that opens the gun in the instruction in which the robot starts, the two are
    one moment, and what is between them in the stamps is the delay of the signal.
    """

    def __init__(self) -> None:
        self._speed = SpeedNow()
        self._stood = False
        self._starts: deque[int] = deque(maxlen=REMEMBERED)
        self._opened: deque[int] = deque(maxlen=REMEMBERED)

    def add_pose(self, stamp: int, position_m: np.ndarray) -> None:
        """Take a pose."""
        self._speed.add(np.array([stamp]), position_m[np.newaxis])
        speed = self._speed.m_per_s
        if speed < 0.005:
            self._stood, self._rest_ns = True, stamp
        elif self._stood and speed > 0.02:
            self._stood = False
            self._starts.append(self._rest_ns)

    def add_opening(self, stamp: int) -> None:
        """Take the stamp with which the gun is told to open."""
        self._opened.append(stamp)

    def delay_s(self) -> tuple[float, int]:
        """Median time from a start to the opening near it [s], NaN for none, and their number."""
        starts = np.array(self._starts)
        apart = [1e-9 * (at - starts) for at in self._opened if len(starts)]
        nearest = [float(each[np.argmin(np.abs(each))]) for each in apart]
        # The opening of the gun belongs to a start that is so near [s].
        near = [each for each in nearest if abs(each) < 2.0]
        return (float(np.median(near)) if near else math.nan), len(near)


class SignalSource(PaintNode):
    """Publishes `atomizer/state` from signals that a thread of the subclass follows.

    The state is published, latched, when it changes and once all named signals have arrived.
    Passwords come from the environment: parameters are read, and recorded, by others.
    """

    PASSWORD: str  # the variable of the environment

    def __init__(self, name: str, **kwargs: Any):
        super().__init__(name, **kwargs)
        self._publisher = self.create_publisher(AtomizerState, 'atomizer/state', LATCHED_STATES)
        named = ('trigger', *FIELDS)
        self.signals = {self.values[kind]: kind for kind in named if self.values[kind]}
        self._received: dict[str, float] = {}
        self._published = ''
        self._newest_ns = 0
        # Of the connection, and of each signal.
        self._problem, self._problems = 'not connected yet', dict.fromkeys(self.signals, '')
        # Signals of which nothing came since the connection was made.
        self._silent: set[str] = set()
        self._lock = threading.Lock()
        self._lags_s: deque[float] = deque(maxlen=REMEMBERED)
        self._starts = StartsOfMotion()
        self.create_subscription(PoseStamped, POSES, self._take_pose, qos_profile_sensor_data)
        self.report({'signals': self.status})
        self.start_thread(self._keep_following)

    def _validate(self, values: Mapping[str, Any]) -> None:
        if urlsplit(values['url']).username is not None:
            raise PaintError(
                f'{self.get_name()}: url holds a login, which all nodes of the cell could read; '
                f'give user, and its password in the environment as {self.PASSWORD}'
            )
        if not values['trigger']:
            raise PaintError(f'{self.get_name()}: trigger is empty: name the signal of the gun')
        named = [values[kind] for kind in ('trigger', *FIELDS) if values[kind]]
        if len(set(named)) < len(named):
            raise PaintError(f'{self.get_name()}: a signal is named twice: {" ".join(named)}')

    def follow(self, stopped: Callable[[], bool]) -> None:
        """Connect and ``take`` the signals until ``stopped``; errors are told, then retried."""
        raise NotImplementedError

    def _keep_following(self) -> None:
        while not self.stopped.is_set():
            self._silent = {*self.signals}
            try:
                self.follow(self.stopped.is_set)
            except Exception as error:  # whatever a network and its libraries bring
                text = ' '.join(str(error).split()) or type(error).__name__
                self._problem = f'{self.values["url"]}: {text}'
            self.stopped.wait(1.0)

    def connected(self) -> None:
        """All signals are subscribed to."""
        self._problem = ''

    def take(self, signal: str, value: float, own_ns: int | None = None) -> None:
        """Take the value of a signal that arrives now; ``own_ns`` is the server's time for it."""
        kind, at_ns, arrived_ns = self.signals[signal], own_ns, time.time_ns()
        if not math.isfinite(value):
            self.refuse(signal, f'is {value}')
            return
        with self._lock:
            self._problem = self._problems[signal] = ''
            # The first value may have been there for long.
            if own_ns is not None and signal not in self._silent:
                lag_s = 1e-9 * (arrived_ns - own_ns)
                self._lags_s.append(lag_s)
                if abs(lag_s) > MAX_CLOCK_OFFSET_S:
                    late = f'{signal} arrives {lag_s:.3g} s after its own time: set the clocks'
                    self._problems[signal], at_ns = late, None
            self._silent.discard(signal)
            if at_ns is None:
                at_ns = arrived_ns - round(1e9 * self.values['delay_s'])
            self._newest_ns = max(self._newest_ns, at_ns)
            self._received[kind] = value
            if not {*self.signals.values()} - self._received.keys():
                self._publish(self._newest_ns)

    def refuse(self, signal: str, reason: str) -> None:
        """Say why what came of a signal is no value."""
        with self._lock:
            self._problems[signal] = f'{signal} {reason}; the gun stays as it was'

    def _publish(self, at_ns: int) -> None:
        values, known = self.values, self._received
        spraying = known['trigger'] > values['trigger_level']
        full, flow = values['calibrated_flow'], known.get('flow', math.nan)
        relative = flow / full if full > 0.0 and 'flow' in known else 1.0
        points = {field: known.get(name, math.nan) for name, (field, _) in FIELDS.items()}
        state = AtomizerState(spraying=spraying, flow=relative, **points)
        if str(state) == self._published:  # NaN does not equal itself
            return
        if spraying and 'spraying=True' not in self._published:
            self._starts.add_opening(at_ns)
        self._published = str(state)
        state.header = header('', at_ns)
        self._publisher.publish(state)

    def _take_pose(self, pose: PoseStamped) -> None:
        with self._lock:
            self._starts.add_pose(stamp_ns(pose.header), pose_of(pose.pose)[0])

    def status(self) -> Status:
        with self._lock:
            return self._status_now()

    def _status_now(self) -> Status:
        received = {
            f'{kind}, {signal}': self._received.get(kind, 'not received')
            for signal, kind in self.signals.items()
        }
        lag = f'{1e3 * np.median(self._lags_s):.1f}' if self._lags_s else 'no time is sent'
        delay_s, starts = self._starts.delay_s()
        late = f'{1e3 * delay_s:.1f}, of {starts} starts' if starts else 'no start from rest yet'
        values = received | {
            'from the time of the server to arrival [ms]': lag,
            'delay taken out [ms]': f'{1e3 * self.values["delay_s"]:.1f}',
            'opening after the start of motion [ms]': late,
        }
        if problems := [each for each in (self._problem, *self._problems.values()) if each]:
            return Status(ERROR, '; '.join(problems), values)
        missing = [name for name, value in received.items() if value == 'not received']
        if missing:
            return Status(WARN, f'not received: {"; ".join(missing)}', values)
        return Status(OK, 'following the signals', values)

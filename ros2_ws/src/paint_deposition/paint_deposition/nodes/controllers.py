"""Nodes `rws_source` and `opcua_source`: the gun's signals, of ABB or by OPC UA."""

import asyncio
import importlib
import math
import os
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from datetime import timezone
from types import SimpleNamespace
from typing import Any
from urllib import request
from urllib.parse import urlencode, urlsplit
from xml.etree import ElementTree

import numpy as np
from paint_msgs.msg import AtomizerState

from paint_deposition.errors import PaintError, quoted
from paint_deposition.files.recordings.bags import MAX_CLOCK_OFFSET_S
from paint_deposition.nodes.atomizer_source import LATCHED_STATES
from paint_deposition.nodes.node import ERROR, OK, WARN, PaintNode, Status, Task
from paint_deposition.nodes.parameters import NodeParameter, fixed
from paint_deposition.nodes.topics import STATE_TOPIC, header

TIMEOUT_S = 5.0
POLL_S = 0.2
PATH = '/rw/iosystem/signals/'
# What a state takes from signals: the field, and its unit.
FIELDS = {
    'flow': ('flow_cm3_per_min', 'cm3/min'), 'bell_speed': ('bell_speed_rpm', '1/min'),
    'shaping_air': ('shaping_air_l_per_min', 'l/min'), 'voltage': ('voltage_kv', 'kV'),
}  # fmt: skip

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


class SignalSource(PaintNode):
    """Publishes `atomizer/state` from signals that a thread of the subclass follows.

    The state is published, latched, when it changes and once all named signals have arrived.
    Passwords come from the environment: parameters are read, and recorded, by others.
    """

    PASSWORD: str  # the variable of the environment
    LIBRARY: str
    # Connects and takes the signals until ``stopped``; errors are told, then retried.
    follow: Callable[[], None]

    def _configure(self) -> Mapping[str, Task]:
        self._publisher = self.create_publisher(AtomizerState, STATE_TOPIC, LATCHED_STATES)
        named = ('trigger', *FIELDS)
        self.signals = {self.values[kind]: kind for kind in named if self.values[kind]}
        self._received: dict[str, float] = {}
        self._published = ''
        self._newest_ns = 0
        # Of the connection, and of each signal.
        self._problem, self._problems = 'not connected yet', dict.fromkeys(self.signals, '')
        self._logged: set[str] = set()
        # Signals of which nothing came since the connection was made.
        self._silent: set[str] = set()
        self._lock = threading.Lock()
        self._lags_s: deque[float] = deque(maxlen=50)
        self.start_thread(self._keep_following)
        return {'signals': self.status}

    def _validate(self, values: Mapping[str, Any], changed: set[str]) -> None:
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
        try:
            importlib.import_module(self.LIBRARY)
        except ImportError:
            library = self.LIBRARY.partition('.')[0]
            raise PaintError(
                f'{self.get_name()}: {library} is not installed; run: pip install {library}'
            ) from None

    def _keep_following(self) -> None:
        while not self.stop_requested.is_set():
            self._silent = {*self.signals}
            try:
                self.follow()
            except Exception as error:  # whatever a network and its libraries bring
                text = ' '.join(str(error).split()) or type(error).__name__
                self._problem = f'{self.values["url"]}: {text}'
            self.stop_requested.wait(1.0)

    def take(self, signal: str, value: float, own_ns: int | None = None) -> None:
        """Take the value of a signal that arrives now; ``own_ns`` is the server's time for it."""
        kind, at_ns, arrived_ns = self.signals[signal], own_ns, time.time_ns()
        if not math.isfinite(value):
            self.refuse(signal, f'is {value}')
            return
        with self._lock:
            self._problem = self._problems[signal] = ''
            lag_s = 0.0 if own_ns is None else 1e-9 * (arrived_ns - own_ns)
            # The first value may have been there for long, and cannot be of the future.
            if own_ns is not None and (signal not in self._silent or lag_s < -MAX_CLOCK_OFFSET_S):
                self._lags_s.append(lag_s)
                if abs(lag_s) > MAX_CLOCK_OFFSET_S:
                    late = f'{signal} arrives {lag_s:.0f} s after its own time: set the clocks'
                    self._problems[signal], at_ns = late, None
            self._silent.discard(signal)
            if at_ns is None:
                at_ns = arrived_ns - round(1e9 * self.values['delay_s'])
            if self._newest_ns > arrived_ns + 1e9 * MAX_CLOCK_OFFSET_S:  # this clock was set back
                self._newest_ns = 0
            self._newest_ns = max(self._newest_ns, at_ns)
            self._received[kind] = value
            if {*self.signals.values()} - self._received.keys():
                return
            values, known = self.values, self._received
            full, flow = values['calibrated_flow'], known.get('flow', math.nan)
            state = AtomizerState(
                spraying=known['trigger'] > values['trigger_level'],
                flow=flow / full if full > 0.0 and 'flow' in known else 1.0,
                **{field: known.get(name, math.nan) for name, (field, _) in FIELDS.items()},
            )
            if str(state) != self._published:  # NaN does not equal itself
                self._published = str(state)
                state.header = header('', self._newest_ns)
                self._publisher.publish(state)

    def refuse(self, signal: str, reason: str) -> None:
        """Say why what came of a signal is no value."""
        with self._lock:
            self._problems[signal] = f'{signal} {reason}; the gun stays as it was'

    def status(self) -> Status:
        with self._lock:
            received = {
                f'{kind}, {signal}': self._received.get(kind, 'not received')
                for signal, kind in self.signals.items()
            }
            lag = f'{1e3 * np.median(self._lags_s):.1f}' if self._lags_s else 'no time is sent'
            problems = [each for each in (self._problem, *self._problems.values()) if each]
        values = received | {'from the time of the server to arrival [ms]': lag}
        for problem in {*problems} - self._logged:
            self.get_logger().error(problem)
        self._logged = {*problems}
        if problems:
            return ERROR, '; '.join(problems), values
        missing = [name for name, value in received.items() if value == 'not received']
        if missing:
            return WARN, f'not received: {"; ".join(missing)}', values
        return OK, 'following the signals', values


class RwsSource(SignalSource):
    """Follows signals, as `EtherNetIP/Gun/doGun` or `doGun`, through a subscription of RWS 1.0.

    Events have no time of their own: `delay_s` is taken from their arrival.
    """

    NAME = 'rws_source'
    PARAMETERS = fixed(
        'the signals are subscribed to with it; restart the node',
        url=NodeParameter('http://192.168.125.1', 'Address of the controller [URL]'),
        user=NodeParameter(
            'Default User', 'User of the controller; its password is in RWS_PASSWORD [name]'
        ),
        **SIGNALS,
    )
    PASSWORD, LIBRARY = 'RWS_PASSWORD', 'websockets.sync.client'

    def follow(self) -> None:
        """Subscribe to all signals in one group, and take its events."""
        from websockets.sync.client import connect

        wanted: dict[str, Any] = {'resources': [*range(1, len(self.signals) + 1)]}
        for number, signal in enumerate(self.signals, start=1):
            # The highest of the three priorities that RWS has.
            wanted |= {f'{number}': f'{PATH}{signal};state', f'{number}-p': 2}
        url, user = self.values['url'].rstrip('/'), self.values['user']
        logins = request.HTTPPasswordMgrWithDefaultRealm()
        logins.add_password(None, url, user, os.environ.get(self.PASSWORD, 'robotics'))
        cookies = request.HTTPCookieProcessor()
        opener = request.build_opener(cookies, request.HTTPDigestAuthHandler(logins))
        body = urlencode(wanted, doseq=True).encode()
        try:
            with opener.open(f'{url}/subscription', body, TIMEOUT_S) as answer:
                events, first = answer.headers['Location'], answer.read()
            if urlsplit(events).hostname != urlsplit(url).hostname:
                told = quoted(events)
                raise PaintError(f'events are said to be at {told}, which is another host')
            kept = '; '.join(f'{cookie.name}={cookie.value}' for cookie in cookies.cookiejar)
            protocols: Any = ['robapi2_subscription']
            with connect(
                events, subprotocols=protocols, additional_headers={'Cookie': kept},
                open_timeout=TIMEOUT_S, close_timeout=POLL_S,
            ) as socket:  # fmt: skip
                self._problem = ''  # all signals are subscribed to
                self._take_all(first)
                while not self.stop_requested.is_set():
                    with suppress(TimeoutError):
                        self._take_all(socket.recv(POLL_S))
        finally:
            # A controller has few sessions, and keeps those that are not closed. To one that does
            # not answer the node gives no time when it ends.
            with suppress(OSError):
                wait_s = POLL_S if self.stop_requested.is_set() else TIMEOUT_S
                opener.open(f'{url}/logout', None, wait_s).close()

    def _take_all(self, event: str | bytes) -> None:
        """Take the value of each signal in an event, which is XHTML."""
        for item in ElementTree.fromstring(event).iter():
            if not item.get('class', '').startswith('ios-signalstate'):
                continue
            link, value = '', None
            for inner in item.iter():
                link = inner.get('href', '') or link
                value = inner.text if inner.get('class') == 'lvalue' else value
            path = link.partition(PATH)[2].partition(';')[0]
            for signal in self.signals:
                if value is not None and f'/{path}'.endswith(f'/{signal}'):
                    self.take(signal, float(value))


class OpcuaSource(SignalSource):
    """Follows variables of a server, such as one of OPC 40702, by their node ids or browse paths.

    A value counts from the source's time for it, which the server sends; `delay_s` is for one
    that sends none.
    """

    NAME = 'opcua_source'
    PARAMETERS = fixed(
        'the signals are subscribed to with it; restart the node',
        url=NodeParameter('opc.tcp://127.0.0.1:4840', 'Address of the server [URL]'),
        period_s=NodeParameter(
            0.02, 'How often the server samples and sends what has changed [s]', (1e-3, 10.0)
        ),
        user=NodeParameter(
            '', 'User of the server, whose password is in OPCUA_PASSWORD; empty: anonymous [name]'
        ),
        security_policy=NodeParameter(
            'None',
            'How messages are signed and encrypted [name]',
            choices=('None', 'Basic256Sha256', 'Aes128Sha256RsaOaep', 'Aes256Sha256RsaPss'),
        ),
        certificate_file=NodeParameter('', 'Certificate of this client, DER or PEM [path]'),
        private_key_file=NodeParameter('', 'Private key of this client, DER or PEM [path]'),
        server_certificate_file=NodeParameter(
            '', 'Certificate that the server must have; empty: the one that it sends [path]'
        ),
        **SIGNALS,
    )
    PASSWORD, LIBRARY = 'OPCUA_PASSWORD', 'asyncua.client.client'

    def _validate(self, values: Mapping[str, Any], changed: set[str]) -> None:
        super()._validate(values, changed)
        keys = [values['certificate_file'], values['private_key_file']]
        if (values['security_policy'] != 'None') != all(keys) or any(keys) != all(keys):
            raise PaintError(
                'opcua_source: security_policy, certificate_file and private_key_file belong '
                'together: give all of them, or none'
            )

    def follow(self) -> None:
        """Subscribe to all variables, and take their values."""
        asyncio.run(self._follow())

    async def _follow(self) -> None:
        from asyncua.client.client import Client

        client = Client(self.values['url'])
        if self.values['user']:
            client.set_user(self.values['user'])
            client.set_password(os.environ.get(self.PASSWORD, ''))
        if self.values['security_policy'] != 'None':
            named = ('certificate_file', 'private_key_file', 'server_certificate_file')
            files = filter(None, (self.values[name] for name in named))
            secured = [self.values['security_policy'], 'SignAndEncrypt', *files]
            await client.set_security_string(','.join(secured))
        async with client:
            found: dict[Any, str] = {}
            for signal in self.signals:
                if '=' in signal:
                    node = client.get_node(signal)
                else:
                    node = await client.nodes.objects.get_child(signal.split('/'))
                found[node.nodeid] = signal

            handler = SimpleNamespace(
                datachange_notification=lambda node, value, data: self._take_value(
                    found[node.nodeid], value, data.monitored_item.Value
                )
            )
            period_ms = 1e3 * self.values['period_s']
            subscription = await client.create_subscription(period_ms, handler)
            nodes = [client.get_node(each) for each in found]
            await subscription.subscribe_data_change(nodes, sampling_interval=period_ms)
            self._problem = ''  # all signals are subscribed to
            while not self.stop_requested.is_set():
                await asyncio.sleep(POLL_S)
                await client.check_connection()

    def _take_value(self, signal: str, value: Any, told: Any) -> None:
        """Take what a subscription brings of a signal."""
        own, own_ns = told.SourceTimestamp, None
        if own is not None:
            since = own.replace(tzinfo=own.tzinfo or timezone.utc)
            own_ns = round(since.timestamp() * 1e6) * 1000
        if told.StatusCode is not None and not told.StatusCode.is_good():
            self.refuse(signal, f'is {told.StatusCode.name}')
            return
        try:
            self.take(signal, float(value), own_ns)
        except (TypeError, ValueError):
            self.refuse(signal, f'is no number but {value!s:.60}')

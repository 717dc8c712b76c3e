"""Nodes `rws_source` and `opcua_source`: the gun's signals, of ABB or by OPC UA."""

import asyncio
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from datetime import timezone
from types import SimpleNamespace
from typing import Any
from urllib import request
from urllib.parse import urlencode, urlsplit
from xml.etree import ElementTree

from paint_deposition.errors import PaintError, quoted
from paint_deposition.nodes.robot.signal_source import SIGNALS, SignalSource
from paint_deposition.nodes.runtime.parameters import NodeParameter, fixed_while_running

TIMEOUT_S = 5.0
POLL_S = 0.2
PATH = '/rw/iosystem/signals/'

POLL_S = 0.2


RWS = fixed_while_running(
    'the signals are subscribed to with it; restart the node',
    url=NodeParameter('http://192.168.125.1', 'Address of the controller [URL]'),
    user=NodeParameter(
        'Default User', 'User of the controller; its password is in RWS_PASSWORD [name]'
    ),
    **SIGNALS,
)


class RwsSource(SignalSource):
    """Follows signals, as `EtherNetIP/Gun/doGun` or `doGun`, through a subscription of RWS 1.0.

    Events have no time of their own: `delay_s` is taken from their arrival.
    """

    PARAMETERS = RWS
    PASSWORD = 'RWS_PASSWORD'

    def __init__(self, **kwargs: Any):
        super().__init__('rws_source', **kwargs)

    def follow(self, stopped: Callable[[], bool]) -> None:
        """Subscribe to all signals in one group, and take its events."""
        try:
            from websockets.sync.client import connect
        except ImportError:
            raise PaintError('websockets is not installed; run: pip install websockets') from None
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
            more = {'Cookie': kept}
            protocols: Any = ['robapi2_subscription']
            with connect(events, subprotocols=protocols, additional_headers=more) as socket:
                self.connected()
                self._take_all(first)
                while not stopped():
                    with suppress(TimeoutError):
                        self._take_all(socket.recv(POLL_S))
        finally:
            # A controller has few sessions, and keeps those that are not closed.
            with suppress(OSError):
                opener.open(f'{url}/logout', None, TIMEOUT_S).close()

    def _take_all(self, event: str | bytes) -> None:
        for path, value in signal_values(event):
            for signal in self.signals:
                if path == signal or path.endswith(f'/{signal}'):
                    self.take(signal, value)


def signal_values(event: str | bytes) -> Iterator[tuple[str, float]]:
    """The path and the value of each signal in an event of RWS, which is XHTML."""
    for item in ElementTree.fromstring(event).iter():
        if not item.get('class', '').startswith('ios-signalstate'):
            continue
        link, value = '', None
        for inner in item.iter():
            link = inner.get('href', '') or link
            value = inner.text if inner.get('class') == 'lvalue' else value
        path = link.partition(PATH)[2].partition(';')[0]
        if path and value is not None:
            yield path, float(value)


OPCUA = fixed_while_running(
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
        'How messages are signed and encrypted',
        choices=('None', 'Basic256Sha256', 'Aes128Sha256RsaOaep', 'Aes256Sha256RsaPss'),
    ),
    certificate_file=NodeParameter('', 'Certificate of this client, DER or PEM [path]'),
    private_key_file=NodeParameter('', 'Private key of this client, DER or PEM [path]'),
    server_certificate_file=NodeParameter(
        '', 'Certificate that the server must have; empty: the one that it sends [path]'
    ),
    **SIGNALS,
)


class OpcuaSource(SignalSource):
    """Follows variables of a server, such as one of OPC 40702, by their node ids or browse paths.

    A value counts from the source's time for it, which the server sends; `delay_s` is for one
    that sends none.
    """

    PARAMETERS = OPCUA
    PASSWORD = 'OPCUA_PASSWORD'

    def __init__(self, **kwargs: Any):
        super().__init__('opcua_source', **kwargs)

    def _validate(self, values: Mapping[str, Any]) -> None:
        super()._validate(values)
        keys = [values['certificate_file'], values['private_key_file']]
        if (values['security_policy'] != 'None') != all(keys) or any(keys) != all(keys):
            raise PaintError(
                'opcua_source: security_policy, certificate_file and private_key_file belong '
                'together: give all of them, or none'
            )

    def follow(self, stopped: Callable[[], bool]) -> None:
        """Subscribe to all variables, and take their values."""
        asyncio.run(self._follow(stopped))

    async def _follow(self, stopped: Callable[[], bool]) -> None:
        try:
            from asyncua.client.client import Client
        except ImportError:
            raise PaintError('asyncua is not installed; run: pip install asyncua') from None
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

            def notify(node: Any, value: Any, data: Any) -> None:
                self._take_value(found[node.nodeid], value, data.monitored_item.Value)

            handler = SimpleNamespace(datachange_notification=notify)
            period_ms = 1e3 * self.values['period_s']
            subscription = await client.create_subscription(period_ms, handler)
            nodes = [client.get_node(each) for each in found]
            await subscription.subscribe_data_change(nodes, sampling_interval=period_ms)
            self.connected()
            while not stopped():
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

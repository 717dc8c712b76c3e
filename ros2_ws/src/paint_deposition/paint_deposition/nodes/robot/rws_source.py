"""Node `rws_source`: the gun's signals of an ABB controller, by Robot Web Services 1.0."""

import os
from collections.abc import Callable, Iterator
from contextlib import suppress
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
PROTOCOL = 'robapi2_subscription'
# Of the three that RWS has, the one for signals that are wanted at once.
HIGH = 2

SOURCE = fixed_while_running(
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

    PARAMETERS = SOURCE
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
            wanted |= {f'{number}': f'{PATH}{signal};state', f'{number}-p': HIGH}
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
            with connect(events, subprotocols=[PROTOCOL], additional_headers=more) as socket:  # type: ignore[list-item]
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

"""Gun signals over real sockets: an RWS server as ABB describes it, and a server of asyncua."""

import socket
import threading
import time
from contextlib import contextmanager
from datetime import datetime, timedelta, timezone
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import parse_qs

import numpy as np
import pytest
from asyncua import ua
from asyncua.crypto.cert_gen import generate_private_key, generate_self_signed_app_certificate
from asyncua.crypto.permission_rules import User, UserRole
from asyncua.sync import Server
from cryptography import x509
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat
from cryptography.x509.oid import ExtendedKeyUsageOID
from paint_msgs.msg import AtomizerState
from websockets.sync.server import serve

from nodes.cell import free_port, parameters
from paint_deposition.errors import PaintError
from paint_deposition.files.recordings.messages import stamp_ns
from paint_deposition.nodes import controllers
from paint_deposition.nodes.controllers import OpcuaSource, RwsSource

GUN, FLOW = 'EtherNetIP/Gun/doGun', 'EtherNetIP/Gun/aoFlow'
EVENT = (
    '<?xml version="1.0" encoding="utf-8"?><html xmlns="http://www.w3.org/1999/xhtml"><head>'
    '<title>Event</title><base href="http://localhost/"/></head><body><div class="state">'
    '<a href="subscription/1" rel="group"/><ul>{}</ul></div></body></html>'
)
ITEM = (
    '<li class="ios-signalstate-ev" title="{0}"><a href="/rw/iosystem/signals/{0};state" '
    'rel="self"/><span class="lvalue">{1}</span><span class="lstate">not simulated</span></li>'
)


def event(**values: float) -> str:
    paths = {'gun': GUN, 'flow': FLOW}
    return EVENT.format(''.join(ITEM.format(paths[k], v) for k, v in values.items()))


class Controller:
    """POST /subscription with digest and a cookie, then events on a websocket."""

    def __init__(self) -> None:
        self.subscribed: dict[str, list[str]] = {}
        self.socket = None
        self.cookie, self.events, self.sessions = '', '', 0

    def tell(self, **values: float) -> None:
        self.socket.send(event(**values))

    @contextmanager
    def running(self):
        controller = self

        class Http(BaseHTTPRequestHandler):
            def do_POST(self) -> None:
                body = self.rfile.read(int(self.headers['Content-Length'])).decode()
                if 'username="Default User"' not in self.headers.get('Authorization', ''):
                    self.send_response(401)
                    challenge = 'Digest realm="validusers@robapi.abb", nonce="7", qop="auth"'
                    self.send_header('WWW-Authenticate', challenge)
                    self.end_headers()
                    return
                controller.subscribed = parse_qs(body)
                controller.sessions += 1
                self.send_response(201)
                self.send_header('Location', controller.events or f'ws://127.0.0.1:{port}/poll/1')
                self.send_header('Set-Cookie', 'ABBCX=21; path=/')
                self.end_headers()
                self.wfile.write(event(gun=0, flow=0).encode())

            def do_GET(self) -> None:
                controller.sessions -= self.path == '/logout' and 'ABBCX' in self.headers['Cookie']
                self.send_response(200)
                self.end_headers()

            def log_message(self, *_) -> None:
                pass

        def poll(connection) -> None:
            controller.cookie = connection.request.headers['Cookie']
            controller.socket = connection
            for _ in connection:  # until it is closed
                pass

        events = serve(poll, '127.0.0.1', 0, subprotocols=['robapi2_subscription'])
        port = events.socket.getsockname()[1]
        http = ThreadingHTTPServer(('127.0.0.1', 0), Http)
        for server in (events, http):
            threading.Thread(target=server.serve_forever, daemon=True).start()
        try:
            yield f'http://127.0.0.1:{http.server_address[1]}'
        finally:
            http.shutdown()
            http.server_close()
            events.shutdown()


class OneUser:
    def get_user(self, iserver, username=None, password=None, certificate=None):
        known = (username, password) == ('cell', 'secret')
        return User(role=UserRole.User) if known else None


@contextmanager
def supply(address: str, *secured: Path):
    """A server with the gun's variables below Objects, secured by a certificate and a key."""
    server = Server()
    if secured:
        server.aio_obj.iserver.user_manager = OneUser()
        server.set_security_policy([ua.SecurityPolicyType.Basic256Sha256_SignAndEncrypt])
        server.load_certificate(str(secured[0]))
        server.load_private_key(str(secured[1]))
    server.set_endpoint(address)
    space = server.register_namespace('urn:supply')
    gun = server.nodes.objects.add_object(space, 'Gun')
    with server:
        yield {
            name: gun.add_variable(f'ns={space};s=Gun.{name}', f'{space}:{name}', value)
            for name, value in (('Open', False), ('Voltage', 0.0))
        }


def write(variable, value, at: datetime, **status: ua.StatusCode) -> None:
    variable.write_value(ua.DataValue(ua.Variant(value), SourceTimestamp=at, **status))


@pytest.fixture
def states(onlooker):
    return onlooker('atomizer/state')


def test_signals_of_a_controller_switch_the_gun(start, states, wait_until):
    controller = Controller()
    with controller.running() as url:
        values = {'trigger': 'doGun', 'flow': FLOW, 'calibrated_flow': 250.0, 'delay_s': 0.05}
        node = start(RwsSource, url=url, **values)
        wait_until(lambda: len(states.heard['atomizer/state']) == 1, what='the first state')
        wait_until(lambda: controller.socket is not None)
        assert controller.subscribed == {
            'resources': ['1', '2'], '1': ['/rw/iosystem/signals/doGun;state'], '1-p': ['2'],
            '2': [f'/rw/iosystem/signals/{FLOW};state'], '2-p': ['2'],
        }  # fmt: skip
        assert controller.cookie == 'ABBCX=21'
        controller.tell(flow=300.0)
        controller.tell(gun=1)
        wait_until(lambda: len(states.heard['atomizer/state']) == 3, what='the changes')
        opened = states.decoded('atomizer/state', 2)
        assert (opened.spraying, opened.flow, opened.flow_cm3_per_min) == (True, 1.2, 300.0)
        assert np.isnan(opened.voltage_kv)
        assert 0.05e9 <= time.time_ns() - stamp_ns(opened.header) < 60e9
        wait_until(lambda: states.reports('rws_source: signals', 'following the signals'))
        broken = controller.socket
        broken.close()
        wait_until(lambda: states.reports('rws_source: signals', url, b'\x02'), what='the break')
        wait_until(lambda: controller.socket is not broken, what='another connection')
        assert controller.sessions == 1
        node.close()
        wait_until(lambda: controller.sessions == 0, what='the end of the session')


def test_a_controller_that_is_silent_does_not_hold_up_the_end(start, wait_until, monkeypatch):
    monkeypatch.setattr(controllers, 'TIMEOUT_S', 0.5)
    controller = Controller()
    with socket.create_server(('127.0.0.1', 0)) as silent, controller.running() as url:
        controller.events = f'ws://127.0.0.1:{silent.getsockname()[1]}/poll/1'
        node = start(RwsSource, url=url, trigger='doGun', flow=FLOW)
        wait_until(lambda: controller.sessions, what='the session')
        began_s = time.monotonic()
        node.close()
        assert time.monotonic() - began_s < 5.0


def test_the_cookie_of_a_controller_goes_to_no_other_host(start, states, wait_until):
    controller = Controller()
    controller.events = 'ws://localhost:1/poll/1'
    with controller.running() as url:
        start(RwsSource, url=url, trigger='doGun', flow=FLOW)
        wait_until(lambda: states.reports('rws_source: signals', 'another host', b'\x02'))
        assert controller.cookie == ''


def test_a_supply_may_want_a_user_and_encryption(start, states, wait_until, tmp_path, monkeypatch):
    """The password is in no parameter and in no diagnostics."""
    certificate, private_key = tmp_path / 'certificate.der', tmp_path / 'private_key.pem'
    key = generate_private_key()
    pem = key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())
    private_key.write_bytes(pem)
    names, host = {'commonName': 'cell'}, socket.gethostname()
    made = generate_self_signed_app_certificate(
        key, 'urn:cell', names, [x509.DNSName(host)], [ExtendedKeyUsageOID.CLIENT_AUTH]
    )
    certificate.write_bytes(made.public_bytes(Encoding.DER))
    monkeypatch.setenv('OPCUA_PASSWORD', 'secret')
    address = f'opc.tcp://127.0.0.1:{free_port(socket.SOCK_STREAM)}'
    with supply(address, certificate, private_key):
        node = start(
            OpcuaSource, url=address, trigger='ns=2;s=Gun.Open', user='cell',
            security_policy='Basic256Sha256', certificate_file=str(certificate),
            private_key_file=str(private_key),
        )  # fmt: skip
        wait_until(lambda: len(states.heard['atomizer/state']) == 1, what='the first state')
        assert 'secret' not in str(node.values)


def test_variables_of_a_material_supply_count_from_their_own_time(start, states, wait_until):
    address = f'opc.tcp://127.0.0.1:{free_port(socket.SOCK_STREAM)}'
    with supply(address) as gun:
        values = {'trigger': 'ns=2;s=Gun.Open', 'voltage': '2:Gun/2:Voltage'}
        start(OpcuaSource, url=address, **values)
        wait_until(lambda: len(states.heard['atomizer/state']) == 1, what='the first state')
        # Behind the state before, or the opening would count from that.
        first_s = 1e-9 * stamp_ns(states.newest('atomizer/state').header)
        at = datetime.fromtimestamp(first_s, timezone.utc) + timedelta(milliseconds=1)
        write(gun['Open'], True, at)
        wait_until(lambda: len(states.heard['atomizer/state']) == 2, what='the opening')
        opened = states.newest('atomizer/state')
        assert (opened.spraying, opened.flow, opened.voltage_kv) == (True, 1.0, 0.0)
        assert stamp_ns(opened.header) == pytest.approx(1e9 * at.timestamp(), abs=2e3)
        write(gun['Voltage'], 62.0, at - timedelta(seconds=30))
        told = 'Voltage arrives 30'
        wait_until(lambda: states.reports('opcua_source: signals', told, b'\x02'), what=told)
        assert states.newest('atomizer/state').voltage_kv == 62.0
        # Nothing that is no value goes unnoticed, nor is taken for one.
        heard = len(states.heard['atomizer/state'])
        bad = ua.StatusCode(ua.StatusCodes.BadSensorFailure)
        write(gun['Voltage'], None, datetime.now(timezone.utc), StatusCode=bad)
        told = 'Voltage is BadSensorFailure; the gun stays as it was'
        wait_until(lambda: states.reports('opcua_source: signals', told, b'\x02'), what=told)
        write(gun['Open'], False, datetime.now(timezone.utc))
        wait_until(lambda: len(states.heard['atomizer/state']) > heard, what='the closing')
        assert states.newest('atomizer/state').voltage_kv == 62.0
        wait_until(lambda: states.reports('opcua_source: signals', told, b'\x02'), what=told)


def test_values_from_before_a_connection_are_not_called_late(ros_context):
    """After a break, too; and whoever looks does so while the source takes values."""

    class Twice(OpcuaSource):
        connections = 0

        def follow(self) -> None:
            self.connections += 1
            for number in range(3000 if self.connections > 1 else 1):
                self.take('gun', 1.0, time.time_ns() - (0 if number else 80_000_000_000))
            raise OSError('broken off')

    node = Twice(context=ros_context, parameter_overrides=parameters(trigger='gun'))
    while node.connections < 3:
        _, words, _ = node.status()
        assert 'after its own time' not in words
    node.destroy_node()


def test_a_value_of_the_future_counts_from_its_arrival(ros_context, monkeypatch):
    """The first, too, which may be old."""
    chosen = parameters(trigger='gun', url='opc.tcp://127.0.0.1:9')  # nobody is there
    node = OpcuaSource(context=ros_context, parameter_overrides=chosen)
    states: list[AtomizerState] = []
    (publisher,) = (p for p in node.publishers if p.topic_name == '/atomizer/state')
    monkeypatch.setattr(publisher, 'publish', states.append)
    for value in (0.0, 1.0):
        node.take('gun', value, time.time_ns() + 80_000_000_000)
        assert stamp_ns(states[-1].header) <= time.time_ns()
    assert 'gun arrives -80 s after its own time: set the clocks' in node.status()[1]
    node.destroy_node()


def test_a_library_that_is_missing_ends_the_node(start, monkeypatch):
    monkeypatch.setattr(OpcuaSource, 'LIBRARY', 'nowhere_at_all.client')
    with pytest.raises(PaintError, match='run: pip install nowhere_at_all'):
        start(OpcuaSource, trigger='gun')

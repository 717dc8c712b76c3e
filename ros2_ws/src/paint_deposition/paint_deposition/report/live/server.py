"""The server of the live page: its files, and a socket to each browser that is kept up to date."""

import asyncio
import hmac
import json
import secrets
import socket
from collections.abc import Callable, Sequence
from pathlib import Path
from threading import Thread

from tornado.httpserver import HTTPServer
from tornado.netutil import bind_sockets
from tornado.web import Application, RequestHandler, StaticFileHandler
from tornado.websocket import WebSocketClosedError, WebSocketHandler

from paint_deposition.errors import PaintError
from paint_deposition.report.live.scene import Scene, Seen, frame

DEFAULT_HOST, DEFAULT_PORT = '127.0.0.1', 8090
# The variable of the environment for the token: others can read the words of a command.
TOKEN = 'PAINT_TOKEN'
STATIC = Path(__file__).parent / 'static'
# A browser that answers no ping for so long has gone [s].
PING_S = 10.0
THIS_MACHINE = ('127.0.0.1', 'localhost', '::1')


class Page:
    """Serves the live page, from a thread of its own, until it is closed.

    Args:
        scenes: what a browser can choose from; it begins with the first.
        host: address to listen on. Any but this machine's own needs a token.
        port: 0 for one that is free.
        token: that browsers must give; '' makes one where it is needed.
        command: called, in that thread, with 'pause' or 'again' of a page that can be replayed.

    Attributes:
        url: with the token, for a browser; cookie: in which it keeps the token.
        browsers: that are connected. bytes_sent: to all of them so far.

    Raises:
        PaintError: the address or the port cannot be listened on.
    """

    def __init__(
        self,
        scenes: Sequence[Scene],
        host: str = DEFAULT_HOST,
        port: int = DEFAULT_PORT,
        token: str = '',
        command: Callable[[str], None] | None = None,
    ) -> None:
        if not token and host not in THIS_MACHINE:
            token = secrets.token_urlsafe(16)
        self.scenes, self.token, self.command = scenes, token, command
        self.browsers: set[_Browser] = set()
        self.bytes_sent = 0
        try:
            sockets = bind_sockets(port, host)
        except OSError as error:
            raise PaintError(
                f'port {port} of {host}: {error.strerror or error}; choose another port or host'
            ) from None
        shown = host if host not in ('', '0.0.0.0', '::') else socket.gethostname()
        at = f'[{shown}]' if ':' in shown else shown
        at_port = sockets[0].getsockname()[1]
        # Pages on other ports of a machine share its cookies.
        self.cookie = f'token_{at_port}'
        self.url = f'http://{at}:{at_port}/'
        self.url += f'?token={token}' if token else ''
        self._loop = asyncio.new_event_loop()
        self._closing = asyncio.Event()
        self._thread = Thread(target=self._run, args=(sockets,), name='page', daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Let the browsers go and stop to listen."""
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._closing.set)
            self._thread.join()

    def _run(self, sockets: list[socket.socket]) -> None:
        self._loop.run_until_complete(self._serve(sockets))
        self._loop.close()

    async def _serve(self, sockets: list[socket.socket]) -> None:
        files = {'path': STATIC, 'default_filename': 'index.html'}
        server = HTTPServer(
            Application(
                [('/scene', _Browser), ('/(.*)', _File, files)],
                page=self, websocket_ping_interval=PING_S, log_function=lambda handler: None,
            )
        )  # fmt: skip
        server.add_sockets(sockets)
        await self._closing.wait()
        server.stop()
        for browser in list(self.browsers):
            browser.close()
        await server.close_all_connections()


class _Guarded(RequestHandler):
    """Refuses whoever lacks the token; a browser keeps it in a cookie."""

    page: Page

    def prepare(self) -> None:
        self.page = self.settings['page']
        token, named = self.page.token, self.get_argument('token', '')
        given = named or self.get_cookie(self.page.cookie) or ''
        if token and not hmac.compare_digest(given.encode(), token.encode()):
            self._refuse('the token is missing or wrong: use the address with ?token=')
        elif token and named:
            self.set_cookie(self.page.cookie, token, httponly=True, samesite='Strict')
        elif not token and self.request.host_name.strip('[]') not in THIS_MACHINE:
            # Another site's name that leads here, by which its scripts could read the page.
            self._refuse('open the page as 127.0.0.1 or localhost')

    def set_default_headers(self) -> None:
        self.set_header('Content-Security-Policy', "default-src 'self'; img-src 'self' data:")
        self.set_header('Cache-Control', 'no-cache')

    def _refuse(self, why: str) -> None:
        self.set_status(403)
        self.finish(f'{why}\n')


class _File(_Guarded, StaticFileHandler):
    """A file of the page."""


class _Browser(_Guarded, WebSocketHandler):
    """A browser: it has one scene and is sent what it lacks of it."""

    def open(self, *_: str, **__: str) -> None:
        self._scene = self.page.scenes[0]
        self.page.browsers.add(self)
        self._sending = asyncio.create_task(self._send())

    def on_message(self, message: str | bytes) -> None:
        asked = json.loads(message)
        if isinstance(scene := asked.get('scene'), int) and 0 <= scene < len(self.page.scenes):
            self._scene = self.page.scenes[scene]
        elif self.page.command and asked.get('command') in ('pause', 'again'):
            self.page.command(asked['command'])

    def on_close(self) -> None:
        self.page.browsers.discard(self)
        self._sending.cancel()

    async def _send(self) -> None:
        page, seen = self.page, Seen()
        named = [{'part': scene.part, 'model': scene.model} for scene in page.scenes]
        frames = [frame('scenes', scenes=named, replayed=page.command is not None)]
        try:
            while True:
                frames += self._scene.lacking(seen)
                for message in frames:  # waits while the link is busy
                    await self.write_message(message, binary=True)
                    page.bytes_sent += len(message)
                frames = []
                # Browsers are brought up to date this often [s].
                await asyncio.sleep(0.1)
        except WebSocketClosedError:
            pass

"""The live page: what it shows of a part, and the server that brings it to browsers."""

import asyncio
import hmac
import json
import math
import secrets
import socket
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from threading import Lock, Thread
from typing import Any

import numpy as np
from tornado.httpserver import HTTPServer
from tornado.netutil import bind_sockets
from tornado.web import Application, RequestHandler, StaticFileHandler
from tornado.websocket import WebSocketClosedError, WebSocketHandler

from paint_deposition.errors import PaintError
from paint_deposition.film.statistics import FIGURES
from paint_deposition.part.surface import Surface
from paint_deposition.report.colour_scales import FILM_PALETTE, RESIDUAL_PALETTE, ColourScale

DEFAULT_HOST, DEFAULT_PORT = '127.0.0.1', 8090
# The variable of the environment for the token: others can read the words of a command.
TOKEN = 'PAINT_TOKEN'
THIS_MACHINE = ('127.0.0.1', 'localhost', '::1')
# Steps in which the film is shown, finer than a gauge's: less is no change that travels.
STEP_UM = 1.0 / 32.0
# Rows of a series beyond which its older half is forgotten: hours of figures, 500 m of a track.
MOST_ROWS = 50_000

Arrays = Mapping[str, np.ndarray] | None


def frame(kind: str, arrays: Arrays = None, **values: Any) -> bytes:
    """A message to the page: the length of its head (uint32), the head as JSON, the arrays."""
    arrays = arrays or {}
    listed = [[name, array.dtype.name, array.size] for name, array in arrays.items()]
    # JSON knows no NaN and no infinity; the page takes null for them.
    plain = {
        k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in values.items()
    }
    head = json.dumps({'kind': kind, **plain, 'arrays': listed}, allow_nan=False).encode()
    return b''.join(
        [len(head).to_bytes(4, 'little'), head, *(a.tobytes() for a in arrays.values())]
    )


class Scene:
    """A part with its film, guns and history; any thread may change and send it.

    A film travels as 16-bit floats, good to 0.016 µm or 0.05 %, and of these only those that a
    browser does not have: a slow one gets fewer messages and ends with the same film.
    """

    def __init__(self) -> None:
        self._lock = Lock()
        # Messages by kind, each of which takes the place of the last.
        self._blocks: dict[str, bytes] = {}
        self._film: np.ndarray = np.empty(0, np.uint16)
        self._forget()

    def _forget(self) -> None:
        self._rows: dict[str, list[Sequence[float]]] = {'history': [], 'track': []}
        # Of each gun: number, last point of its track, whether it sprayed there.
        self._guns: dict[str, tuple[int, np.ndarray | None, bool]] = {}
        self._shown: dict[str, dict[str, Any]] = {}

    def show_part(self, surface: Surface) -> None:
        """Show a bare part, and nothing else yet: the page forgets whatever it showed before."""
        arrays = {
            'vertices': surface.vertices_m.astype(np.float32),
            'faces': surface.faces.astype(np.uint32),
        }
        sides = {'outward': surface.outward.tolist(), 'down': surface.down.tolist()}
        with self._lock:
            self._blocks = {'part': frame('part', arrays, **sides)}
            self._film = np.zeros(len(surface.vertices_m), np.uint16)
            self._forget()

    def begin_again(self) -> None:
        """Forget tracks and history; the next film takes the place of this one."""
        with self._lock:
            self._forget()
            self._blocks['guns'] = frame('guns', guns=[])

    def tell(self, kind: str, arrays: Arrays = None, **values: Any) -> None:
        """Set what the page shall know of one kind."""
        with self._lock:
            self._blocks[kind] = frame(kind, arrays, **values)

    def show_scale(
        self, scale: ColourScale, bare_um: float, target_um: float = 0.0, tolerance_um: float = 0.0
    ) -> None:
        """Say which film [um] has which colour, and which film is wanted."""
        palettes = np.stack([FILM_PALETTE, RESIDUAL_PALETTE])
        self.tell('scale', {'palettes': palettes}, low=scale.low, high=scale.high, bare=bare_um,
                  target=target_um, tolerance=tolerance_um)  # fmt: skip

    def show_film(self, film_um: np.ndarray) -> None:
        """Show a film (V,) at the vertices of the part [um]."""
        with self._lock:
            self._film = (np.rint(film_um / STEP_UM) * STEP_UM).astype(np.float16).view(np.uint16)

    def add_figures(self, time_s: float, figures: Any, rmse_um: float = np.nan) -> None:
        """Add to the history: the attributes ``FIGURES`` of statistics, and the residual's RMS."""
        values = (getattr(figures, name) for name in FIGURES)
        row = [time_s, *(np.nan if value is None else value for value in values), rmse_um]
        with self._lock:
            self._append('history', row)

    def move_gun(self, name: str, position_m: np.ndarray, z_axis: np.ndarray, flow: float) -> None:
        """Show a gun at its TCP (3,) [m] with tool z (3,), and add to its track."""
        with self._lock:
            number, left_m, sprayed = self._guns.get(name, (len(self._guns), None, False))
            sprays = flow > 0.0
            # A gun that has moved by so much leaves another point of its track [m].
            if left_m is None or sprays != sprayed or np.linalg.norm(position_m - left_m) > 0.01:
                self._append('track', (number, *position_m.tolist(), sprays))
                left_m = position_m
            self._guns[name] = number, left_m, sprays
            shown = {'at': position_m.tolist(), 'z': z_axis.tolist(), 'flow': flow}
            self._shown[name] = shown
            self._blocks['guns'] = frame('guns', guns=list(self._shown.values()))

    def updates(self) -> Iterator[list[bytes]]:
        """For one browser: again and again, the messages that bring it up to date."""
        # What it has been sent; of each series the list itself, since another one may take its
        # place, and how much of it.
        seen: dict[str, bytes] = {}
        seen_film: np.ndarray = np.empty(0, np.uint16)
        seen_rows: dict[str, tuple[list[Sequence[float]], int]] = {}
        while True:
            with self._lock:
                blocks, film = dict(self._blocks), self._film
                rows = {series: (kept, len(kept)) for series, kept in self._rows.items()}
            frames = [block for kind, block in blocks.items() if seen.get(kind) != block]
            if seen.get('part') != blocks.get('part'):
                seen_film = np.zeros(len(film), np.uint16)
            changed = film != seen_film
            if changed.any():
                mask = np.packbits(changed, bitorder='little')
                frames.append(frame('film', {'changed': mask, 'um': film[changed]}))
            for series, (kept, count) in rows.items():
                had, sent = seen_rows.get(series, (kept, 0))
                first = sent if had is kept else 0
                if had is not kept or count > first:
                    new = np.array(kept[first:count], np.float32)
                    frames.append(frame('rows', {'rows': new}, series=series, first=first))
            seen, seen_film, seen_rows = blocks, film, rows
            yield frames

    def _append(self, series: str, row: Sequence[float]) -> None:
        rows = self._rows[series]
        if len(rows) >= MOST_ROWS:
            rows = self._rows[series] = rows[MOST_ROWS // 2 :]
        rows.append(row)


# --- the server


class Page:
    """Serves the live page, from a thread of its own, until it is closed.

    Args:
        scene: what every browser sees.
        host: address to listen on. Any but this machine's own needs a token.
        port: 0 for one that is free.
        token: that browsers must give; '' makes one where it is needed.
        command: called, in that thread, with 'pause' or 'again' where a run is painted again.

    Attributes:
        url: with the token, for a browser; cookie: in which it keeps the token.
        browsers: that are connected. bytes_sent: to all of them so far.

    Raises:
        PaintError: the address or the port cannot be listened on.
    """

    def __init__(
        self,
        scene: Scene,
        host: str = DEFAULT_HOST,
        port: int = DEFAULT_PORT,
        token: str = '',
        command: Callable[[str], None] | None = None,
    ) -> None:
        if not token and host not in THIS_MACHINE:
            token = secrets.token_urlsafe(16)
        self.scene, self.token, self.command = scene, token, command
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
        serving = self._serve(sockets)
        self._thread = Thread(
            target=self._loop.run_until_complete, args=(serving,), name='page', daemon=True
        )
        self._thread.start()

    def close(self) -> None:
        """Let the browsers go and stop to listen."""
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._closing.set)
            self._thread.join()
            self._loop.close()

    async def _serve(self, sockets: list[socket.socket]) -> None:
        static = Path(__file__).parent / 'static'
        files = {'path': static, 'default_filename': 'index.html'}
        server = HTTPServer(
            Application(
                [('/scene', _Browser), ('/(.*)', _File, files)],
                page=self, log_function=lambda handler: None,
                websocket_ping_interval=10.0,  # a browser that answers none for so long has gone
            )
        )  # fmt: skip
        server.add_sockets(sockets)
        await self._closing.wait()
        server.stop()
        for browser in list(self.browsers):
            browser.close()
        await server.close_all_connections()


def _guard(handler: RequestHandler) -> None:
    """Refuse whoever lacks the token; a browser keeps it in a cookie."""
    page: Page = handler.settings['page']
    named, refusal = handler.get_argument('token', ''), ''
    given = named or handler.get_cookie(page.cookie) or ''
    if page.token and not hmac.compare_digest(given.encode(), page.token.encode()):
        refusal = 'the token is missing or wrong: use the address with ?token='
    elif page.token and named:
        handler.set_cookie(page.cookie, page.token, httponly=True, samesite='Strict')
    elif not page.token and handler.request.host_name.strip('[]') not in THIS_MACHINE:
        # Another site's name that leads here, by which its scripts could read the page.
        refusal = 'open the page as 127.0.0.1 or localhost'
    if refusal:
        handler.set_status(403)
        handler.finish(f'{refusal}\n')


class _File(StaticFileHandler):
    """A file of the page."""

    prepare = _guard

    def set_default_headers(self) -> None:
        self.set_header('Content-Security-Policy', "default-src 'self'; img-src 'self' data:")
        self.set_header('Cache-Control', 'no-cache')


class _Browser(WebSocketHandler):
    """A browser, which is sent what it lacks of the scene."""

    prepare = _guard

    def open(self, *_: str, **__: str) -> None:
        self.page: Page = self.settings['page']
        self.page.browsers.add(self)
        self._sending = asyncio.create_task(self._send())

    def on_message(self, message: str | bytes) -> None:
        if self.page.command and message in ('pause', 'again'):
            self.page.command(str(message))

    def on_close(self) -> None:
        self.page.browsers.discard(self)
        self._sending.cancel()

    async def _send(self) -> None:
        try:
            for turn, frames in enumerate(self.page.scene.updates()):
                # A page that hears nothing for some seconds takes the server to be gone.
                if turn % 10 == 0:
                    frames.append(frame('alive'))
                for message in frames:  # waits while the link is busy
                    await self.write_message(message, binary=True)
                    self.page.bytes_sent += len(message)
                # Browsers are brought up to date this often [s].
                await asyncio.sleep(0.1)
        except WebSocketClosedError:
            pass

"""A headless Chromium that loads pages, runs scripts in them and takes pictures."""

import asyncio
import json
import shutil
import subprocess
from base64 import b64decode
from pathlib import Path
from typing import Any
from urllib.request import Request, urlopen

from tornado.websocket import WebSocketClientConnection, websocket_connect

from waiting import until

CHROMIUM = shutil.which('chromium') or shutil.which('google-chrome')
# A machine without a graphics card draws in software.
OPTIONS = (
    '--headless', '--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader',
    '--remote-debugging-port=0', '--no-first-run', '--mute-audio',
)  # fmt: skip


class Tab:
    """A page in the browser."""

    def __init__(self, browser: 'Chromium', url: str, width: int, height: int) -> None:
        self._loop, self._calls = browser.loop, 0
        made = Request(f'{browser.address}/json/new?about:blank', method='PUT')
        about = json.loads(urlopen(made).read())
        self._socket = self._loop.run_until_complete(self._connect(about['webSocketDebuggerUrl']))
        size = {'width': width, 'height': height, 'deviceScaleFactor': 1, 'mobile': width < 600}
        self.call('Emulation.setDeviceMetricsOverride', **size)
        self.call('Page.navigate', url=url)

    async def _connect(self, address: str) -> WebSocketClientConnection:
        return await websocket_connect(address, max_message_size=1 << 28)

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Call a method of the browser's protocol."""
        return self._loop.run_until_complete(self._call(method, parameters))

    async def _call(self, method: str, parameters: dict[str, Any]) -> dict[str, Any]:
        self._calls += 1
        call = {'id': self._calls, 'method': method, 'params': parameters}
        await self._socket.write_message(json.dumps(call))
        while True:  # events of the page come in between
            answer = json.loads(await self._socket.read_message())
            if answer.get('id') == self._calls:
                assert 'error' not in answer, answer
                return answer['result']

    def evaluate(self, script: str) -> Any:
        """The value of an expression in the page; promises are waited for."""
        answer = self.call(
            'Runtime.evaluate', expression=script, returnByValue=True, awaitPromise=True
        )
        assert 'exceptionDetails' not in answer, answer['exceptionDetails']
        return answer['result'].get('value')

    def wait_until(self, condition: str) -> None:
        """Wait until an expression in the page holds."""
        until(lambda: self.evaluate(f'Boolean({condition})'), condition)

    def picture(self, path: Path) -> Path:
        """What the page looks like, as PNG."""
        content = self.call('Page.captureScreenshot', format='png')['data']
        path.write_bytes(b64decode(content))
        return path


class Chromium:
    """The browser, with a folder for what it keeps; use it as a context manager."""

    def __init__(self, folder: Path) -> None:
        assert CHROMIUM is not None
        self.loop = asyncio.new_event_loop()
        command = [CHROMIUM, *OPTIONS, f'--user-data-dir={folder}', 'about:blank']
        quiet = {'stdout': subprocess.DEVNULL, 'stderr': subprocess.DEVNULL}
        self._process = subprocess.Popen(command, **quiet)
        told = folder / 'DevToolsActivePort'
        until(lambda: told.exists() and told.read_text().strip(), 'Chromium')
        self.address = f'http://127.0.0.1:{told.read_text().split()[0]}'

    def tab(self, url: str, width: int = 1440, height: int = 900) -> Tab:
        """A new tab with this page."""
        return Tab(self, url, width, height)

    def __enter__(self) -> 'Chromium':
        return self

    def __exit__(self, *_: object) -> None:
        self._process.terminate()
        self._process.wait(10.0)
        self.loop.close()

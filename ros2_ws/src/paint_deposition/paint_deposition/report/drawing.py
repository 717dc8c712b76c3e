"""Pictures drawn by a second process, which loads matplotlib while this one computes."""

from __future__ import annotations

import pickle
import subprocess
import sys
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from pkgutil import resolve_name
from types import TracebackType
from typing import Any

from paint_deposition.errors import PaintError

PICTURES = 'paint_deposition.report.pictures'


class Here:
    """Draws in this process, at once."""

    def start(self, picture: str, *drawn: Any) -> Future[Any]:
        """As ``DrawingProcess.start``, done when it returns."""
        done: Future[Any] = Future()
        done.set_result(_draw(picture, drawn))
        return done


HERE = Here()


class DrawingProcess:
    """A second process, and the pictures that it draws.

    Loading matplotlib takes as long as painting a door: begin before there is anything to draw.

    Args:
        module: of ``report.pictures``, what it shall have loaded, and warmed up if it has a
            ``warm_up``.
    """

    def __init__(self, module: str) -> None:
        # In a session of its own: Ctrl-C is the business of this process, which ends the other.
        self._process = subprocess.Popen(
            [sys.executable, '-m', __name__, module],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True,
        )  # fmt: skip
        self._asking = ThreadPoolExecutor(1)

    @property
    def pid(self) -> int:
        """Number of the second process."""
        return self._process.pid

    def __enter__(self) -> DrawingProcess:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: object, trace: TracebackType | None
    ) -> None:
        self._process.kill()
        self._process.communicate()
        self._asking.shutdown()

    def start(self, picture: str, *drawn: Any) -> Future[Any]:
        """Begin to draw.

        Args:
            picture: module of ``report.pictures`` and its function, ``'film:write_film_picture'``.
            drawn: what the function is given.

        Returns:
            What the function returns, or raises, once it has.
        """
        return self._asking.submit(self._ask, picture, drawn)

    def _ask(self, picture: str, drawn: tuple[Any, ...]) -> Any:
        question, answer = self._process.stdin, self._process.stdout
        assert question
        assert answer
        try:
            pickle.dump((picture, drawn), question, pickle.HIGHEST_PROTOCOL)
            question.flush()
            result = pickle.load(answer)
        except (BrokenPipeError, EOFError):
            raise PaintError(
                f'the process that draws {picture} ended with {self._process.wait()}; try again, '
                'with more memory free'
            ) from None
        if isinstance(result, Exception):
            raise result
        return result


def _draw(picture: str, drawn: tuple[Any, ...]) -> Any:
    return resolve_name(f'{PICTURES}.{picture}')(*drawn)


def _answer(module: str) -> None:
    """Draw what is asked for on stdin, until it is closed; results go to stdout, nothing else."""
    questions, answers, sys.stdout = sys.stdin.buffer, sys.stdout.buffer, sys.stderr
    loaded = resolve_name(f'{PICTURES}.{module}')
    if hasattr(loaded, 'warm_up'):
        loaded.warm_up()
    with suppress(EOFError):
        while True:
            picture, drawn = pickle.load(questions)
            try:
                result = _draw(picture, drawn)
            except Exception as error:
                result = error
            pickle.dump(result, answers, pickle.HIGHEST_PROTOCOL)
            answers.flush()


if __name__ == '__main__':
    _answer(sys.argv[1])

"""How a node's process runs and ends: cleanly, once, with an exit code that tells."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Iterator
from typing import Any

import rclpy
from rcl_interfaces.msg import SetParametersResult
from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from paint_deposition.errors import PaintError
from paint_deposition.nodes.runtime.parameters import (
    ParameterTable,
    declare_parameters,
    refusal_of_fixed,
)

EXIT_BAD_INPUT = 2
EXIT_CRASH = 1


class PaintNode(Node):
    """A node with a parameter table that can end its process and has something to finish then.

    `self.values` holds the parameters as they were at the start. Keyword arguments are those of
    rclpy's Node (context, namespace, parameter_overrides, ...).
    """

    PARAMETERS: ParameterTable = ()

    def __init__(self, name: str, **kwargs: Any):
        super().__init__(name, **kwargs)
        self.finished: Future = Future()
        try:
            self.values = declare_parameters(self, self.PARAMETERS)
        except PaintError:
            self.destroy_node()
            raise

    def set_parameters_atomically(
        self, parameter_list: list[Parameter[Any]]
    ) -> SetParametersResult:
        """Refuse to change what is fixed with the reason, which rclpy leaves out."""
        reason = refusal_of_fixed(self, self.PARAMETERS, parameter_list)
        if reason:
            return SetParametersResult(successful=False, reason=reason)
        return super().set_parameters_atomically(parameter_list)

    def set_parameters(self, parameter_list: list[Parameter[Any]]) -> list[SetParametersResult]:
        """As if each were set on its own."""
        return [self.set_parameters_atomically([parameter]) for parameter in parameter_list]

    def finish(self, exit_code: int = 0) -> None:
        """Ask the process to end; the callback that runs is completed first."""
        if not self.finished.done():
            self.finished.set_result(exit_code)

    def fail(self, error: Exception) -> None:
        """Ask the process to end with an error, from a thread or a callback that must return."""
        if not self.finished.done():
            self.finished.set_exception(error)

    def close(self) -> None:
        """Finish files and the like. Called once, after the last callback, in peace of signals."""


def run_node(
    make_node: Callable[..., Node],
    args: list[str] | None = None,
    executor_class: Callable[..., Executor] = SingleThreadedExecutor,
) -> int:
    """Run one node until it finishes or the process is told to stop; return the exit code.

    Ctrl-C, twice as `ros2 launch` sends it, and SIGTERM are a request to stop (exit code 0),
    never an exception in the middle of a callback. A PaintError becomes one line on stderr and
    exit code 2, any other exception a traceback and exit code 1; both close the node first.
    """
    node: Node | None = None
    try:
        with _interrupting_signals():
            _init(args)
            node = make_node()
        exit_code = _spin(node, executor_class)
    except KeyboardInterrupt:
        exit_code = 0
    except Exception as error:
        exit_code = _report(error)
    finally:
        # Python restores the default action of its own handlers while it exits, and a second
        # SIGINT would then kill it; an ignored signal stays ignored.
        _ignore_signals()
    try:
        if node is not None:
            exit_code = max(exit_code, _closed(node))
    finally:
        rclpy.try_shutdown()
    return exit_code


def _init(args: list[str] | None) -> None:
    try:
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:
        reason = str(error).split(', at /')[0]
        raise PaintError(f'ROS arguments: {" ".join(reason.split())}') from None


def _spin(node: Node, executor_class: Callable[..., Executor]) -> int:
    finished: Future = getattr(node, 'finished', None) or Future()
    executor = executor_class(context=node.context)
    executor.add_node(node)
    with _signals_finish(finished):
        executor.spin_until_future_complete(finished)
    executor.remove_node(node)
    executor.shutdown(timeout_sec=5.0)
    return (finished.result() or 0) if finished.done() else 0


def _closed(node: Node) -> int:
    try:
        if isinstance(node, PaintNode):
            node.close()
        node.destroy_node()
    except Exception as error:
        return _report(error)
    return 0


def _report(error: Exception) -> int:
    if isinstance(error, PaintError):
        sys.stderr.write(f'error: {error}\n')
        return EXIT_BAD_INPUT
    traceback.print_exception(error)
    return EXIT_CRASH


@contextlib.contextmanager
def _interrupting_signals() -> Iterator[None]:
    """Both signals interrupt, as Ctrl-C does: loading a mesh may take a while and is harmless."""

    def interrupt(_signum: int, _frame: object) -> None:
        raise KeyboardInterrupt

    signal.signal(signal.SIGINT, interrupt)
    signal.signal(signal.SIGTERM, interrupt)
    yield


@contextlib.contextmanager
def _signals_finish(finished: Future) -> Iterator[None]:
    """Signals complete `finished`, which wakes the executor.

    Python runs its handlers in the main thread, and that one sleeps in the middleware where no
    signal reaches it. The wake-up descriptor is written by the C handler at once, and a thread
    of ours reads it.
    """
    reader, writer = os.pipe()
    os.set_blocking(writer, False)

    def wait_for_signal() -> None:
        while os.read(reader, 1) != b'\0':
            if not finished.done():
                finished.set_result(0)

    signal.signal(signal.SIGINT, lambda _signum, _frame: None)
    signal.signal(signal.SIGTERM, lambda _signum, _frame: None)
    signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
    thread = threading.Thread(target=wait_for_signal, name='signals', daemon=True)
    thread.start()
    try:
        yield
    finally:
        _ignore_signals()
        signal.set_wakeup_fd(-1)
        os.write(writer, b'\0')
        thread.join()
        os.close(reader)
        os.close(writer)


def _ignore_signals() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)

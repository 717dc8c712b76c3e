"""How a node's process runs and ends: it closes the node once, and its exit code says why."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Iterator

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from paint_deposition.errors import PaintError
from paint_deposition.nodes.runtime.node import PaintNode

EXIT_BAD_INPUT = 2
EXIT_CRASH = 1


def run_node(make_node: Callable[[], PaintNode], stopped: threading.Event | None = None) -> int:
    """Run one node until it finishes or the process is told to stop; return the exit code.

    Ctrl-C, twice as `ros2 launch` sends it, and SIGTERM are a request to stop (exit code 0),
    never an exception in the middle of a callback. A PaintError becomes one line on stderr and
    exit code 2, any other exception a traceback and exit code 1; both close the node first.
    ``stopped`` is set where a signal has come before.
    """
    node: PaintNode | None = None
    stopped = stopped or threading.Event()

    def stop(*_: object) -> None:
        stopped.set()
        _break_off_loading()

    try:
        _on_signals(stop)
        if stopped.is_set():
            return 0
        _init()
        node = _made(make_node)
        exit_code = _spin(node, stopped)
    except Exception as error:
        exit_code = _report(error)
    finally:
        # Python restores the default action of its own handlers while it exits, and a second
        # SIGINT would then kill it; an ignored signal stays ignored.
        _on_signals(signal.SIG_IGN)
    try:
        if node is not None:
            exit_code = max(exit_code, _closed(node))
    finally:
        rclpy.try_shutdown()
    return exit_code


def _on_signals(action: Callable[..., None] | signal.Handlers) -> None:
    signal.signal(signal.SIGINT, action)
    signal.signal(signal.SIGTERM, action)


def _break_off_loading(*_: object) -> None:
    # Reading files can be broken off without harm; an exception could be lost in a library.
    if PaintNode.loading:
        sys.stderr.flush()
        os._exit(0)


def _init() -> None:
    try:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:
        reason = str(error).split(', at /')[0]
        raise PaintError(f'ROS arguments: {" ".join(reason.split())}') from None


def _made(make_node: Callable[[], PaintNode]) -> PaintNode:
    try:
        return make_node()
    except RuntimeError as error:
        # Of rclpy's own core: security without keys or without its libraries, a bad name.
        if type(error).__name__ != 'RCLError':
            raise
        reason = ' '.join(str(error).split(', at /')[0].split())
        raise PaintError(f'ROS cannot make the node: {reason}') from None


def _spin(node: PaintNode, stopped: threading.Event) -> int:
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    with _signals_finish(node.finished):
        if stopped.is_set():  # while the node was being made
            node.finish()
        else:
            node.get_logger().info('ready')
        executor.spin_until_future_complete(node.finished)
    executor.remove_node(node)
    executor.shutdown(timeout_sec=5.0)
    return (node.finished.result() or 0) if node.finished.done() else 0


def _closed(node: PaintNode) -> int:
    try:
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
def _signals_finish(finished: Future) -> Iterator[None]:
    """Signals complete `finished`, which wakes the executor.

    Python runs its signal handlers in the main thread, which sleeps in the middleware where no
    signal reaches it. The C handler writes to the wake-up descriptor at once, and the thread
    started here reads it.
    """
    reader, writer = os.pipe()
    os.set_blocking(writer, False)

    def wait_for_signal() -> None:
        while os.read(reader, 1) != b'\0':
            if not finished.done():
                finished.set_result(0)

    _on_signals(_break_off_loading)
    signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
    thread = threading.Thread(target=wait_for_signal, name='signals', daemon=True)
    thread.start()
    try:
        yield
    finally:
        _on_signals(signal.SIG_IGN)
        signal.set_wakeup_fd(-1)
        os.write(writer, b'\0')
        thread.join()
        os.close(reader)
        os.close(writer)

"""How a node's process runs and ends: it closes the node once, and its exit code says why."""

from __future__ import annotations

import os
import signal
import sys
import traceback
from collections.abc import Callable

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions

from paint_deposition.errors import PaintError
from paint_deposition.nodes.runtime.node import PaintNode

EXIT_BAD_INPUT = 2
EXIT_CRASH = 1
# The main thread sleeps in the middleware, where no signal reaches it; it wakes so often.
WAKE_S = 0.1


def run_node(make_node: Callable[[], PaintNode], signals: list[int] | None = None) -> int:
    """Run one node until it finishes or the process gets a signal; return the exit code.

    Ctrl-C, twice as `ros2 launch` sends it, and SIGTERM are a request to stop (exit code 0),
    never an exception in the middle of a callback. A PaintError becomes one line on stderr and
    exit code 2, any other exception a traceback and exit code 1; both close the node first.
    ``signals`` holds those that have come before.
    """
    node: PaintNode | None = None
    came = [] if signals is None else signals

    def note(number: int, _frame: object) -> None:
        came.append(number)
        if PaintNode.loading:
            # Reading files can be broken off without harm; an exception could be swallowed by a
            # library or by the compiler.
            os._exit(0)

    try:
        _on_signals(note)
        if came:
            return 0
        node = _made(make_node)
        exit_code = _spin(node, came)
    except Exception as error:
        exit_code = _report(error)
    finally:
        # Python restores the default action of its own handlers while it exits, and a second
        # SIGINT would then kill it; an ignored signal stays ignored.
        _on_signals(signal.SIG_IGN)
    try:
        if node is not None:
            node.close()
            node.destroy_node()
    except Exception as error:
        exit_code = max(exit_code, _report(error))
    finally:
        rclpy.try_shutdown()
    return exit_code


def _on_signals(action: Callable[[int, object], None] | signal.Handlers) -> None:
    signal.signal(signal.SIGINT, action)
    signal.signal(signal.SIGTERM, action)


def _made(make_node: Callable[[], PaintNode]) -> PaintNode:
    try:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:
        raise PaintError(f'ROS arguments: {_reason(error)}') from None
    try:
        return make_node()
    except RuntimeError as error:
        # Of rclpy's own core: security without keys or without its libraries, a bad name.
        if type(error).__name__ != 'RCLError':
            raise
        raise PaintError(f'ROS cannot make the node: {_reason(error)}') from None


def _reason(error: RuntimeError) -> str:
    return ' '.join(str(error).split(', at /')[0].split())


def _spin(node: PaintNode, signals: list[int]) -> int:
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    if not signals:
        node.get_logger().info('ready')
    while not (signals or node.finished.done()):
        executor.spin_once(timeout_sec=WAKE_S)
    executor.remove_node(node)
    executor.shutdown(timeout_sec=5.0)
    return (node.finished.result() or 0) if node.finished.done() else 0


def _report(error: Exception) -> int:
    if isinstance(error, PaintError):
        sys.stderr.write(f'error: {error}\n')
        return EXIT_BAD_INPUT
    traceback.print_exception(error)
    return EXIT_CRASH

"""The process of a node: it spins, closes the node once, and ends with an exit code."""

import signal
import sys
import traceback
from collections.abc import Callable

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions

from paint_deposition.errors import PaintError
from paint_deposition.nodes.runtime.node import PaintNode


def run_node(make_node: Callable[[], PaintNode], signals: list[int] | None = None) -> int:
    """Run one node until it finishes or the process gets a signal; return the exit code.

    SIGINT, which `ros2 launch` sends twice, and SIGTERM stop the node between callbacks with exit
    code 0. A PaintError is one line on stderr and exit code 2, any other exception a traceback
    and exit code 1. The node is closed in every case. ``signals`` were received before the call.
    """
    node: PaintNode | None = None
    received = [] if signals is None else signals

    def on_signal(number: int, _frame: object) -> None:
        received.append(number)
        PaintNode.stopping = True
        PaintNode.end_if_loading()

    try:
        _handle_signals(on_signal)
        if received:
            return 0
        node = _create_node(make_node)
        exit_code = _spin(node, received)
    except Exception as error:
        exit_code = _report_error(error)
    finally:
        # Python restores the default action of its own handlers while it exits, and a second
        # SIGINT would then kill it; an ignored signal stays ignored.
        _handle_signals(signal.SIG_IGN)
    try:
        if node is not None:
            node.close()
            node.destroy_node()
    except Exception as error:
        exit_code = max(exit_code, _report_error(error))
    finally:
        rclpy.try_shutdown()
    return exit_code


def _handle_signals(action: Callable[[int, object], None] | signal.Handlers) -> None:
    signal.signal(signal.SIGINT, action)
    signal.signal(signal.SIGTERM, action)


def _create_node(make_node: Callable[[], PaintNode]) -> PaintNode:
    try:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:
        raise PaintError(f'ROS arguments: {_reason(error)}') from None
    try:
        return make_node()
    except RuntimeError as error:
        # RCLError is not public. Causes: security without keys or libraries, an invalid name.
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
        # Signals do not reach the main thread while it waits in the middleware.
        executor.spin_once(timeout_sec=0.1)
    executor.remove_node(node)
    executor.shutdown(timeout_sec=5.0)
    return (node.finished.result() or 0) if node.finished.done() else 0


def _report_error(error: Exception) -> int:
    if isinstance(error, PaintError | MemoryError):
        sys.stderr.write(f'error: {str(error) or "not enough memory"}\n')
        return 2
    traceback.print_exception(error)
    return 1

"""The base class of all nodes, and the process of one."""

from __future__ import annotations

import concurrent.futures
import contextlib
import os
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from rclpy.timer import Timer

from paint_deposition.errors import PaintError, quoted
from paint_deposition.nodes.parameters import RUNS, ParameterTable, declare_parameters

OK = DiagnosticStatus.OK
WARN = DiagnosticStatus.WARN
ERROR = DiagnosticStatus.ERROR


# Of a diagnostic task: OK, WARN or ERROR (single bytes), what is said, and figures by name.
Status = tuple[bytes, str, Mapping[str, object]]
Task = Callable[[], Status]


class PaintNode(Node):
    """A node with a name and a table of parameters, which can end its process.

    Keyword arguments are those of rclpy's Node (context, namespace, parameter_overrides, ...).

    Attributes:
        loading: whether a node of this process is reading its files.
        signalled: whether this process was asked to end.
        configured: whether the files have been read.
        values: current values of the parameters, by name.
        stop_requested: an event that tells the thread of this node to end.
        tasks: the diagnostic tasks, by name.
        awaiting: number of requests whose work a thread does right now.
        finished: a future that ends the process, with an error if it has an exception.
    """

    NAME = 'paint_node'
    PARAMETERS: ParameterTable = MappingProxyType({})
    loading = signalled = False
    configured = True
    awaiting = 0
    _thread: threading.Thread | None = None

    def __init__(self, **kwargs: Any):
        super().__init__(self.NAME, **kwargs)
        self.finished: Future = Future()
        self.stop_requested = threading.Event()
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        try:
            self.values = declare_parameters(self, self.PARAMETERS)
            named = {name: v for name, v in self.values.items() if name != 'output_directory'}
            # Unlike the methods of a path, these mind no loop of links and no closed folder.
            files = [os.path.realpath(file) for file in self._files_of(named)]
            folders = [file if os.path.isdir(file) else os.path.dirname(file) for file in files]
            self._input_folders = [Path(folder) for folder in folders]
            self._validate(self.values, set())
            self._start()
        except PaintError:
            # The subclass is not configured yet: it has nothing of its own to destroy.
            super().destroy_node()
            raise
        self.add_on_set_parameters_callback(self._on_set_parameters)

    def _start(self) -> None:
        """Configure the node, and report what it does."""
        if tasks := self._load():
            self.report(tasks)

    def _load(self) -> Mapping[str, Task]:
        """Configure the node; SIGINT and SIGTERM interrupt it."""
        PaintNode.loading = True
        try:
            if PaintNode.signalled:
                os._exit(0)
            return self._configure()
        finally:
            PaintNode.loading = False

    # --- for the subclass

    def _validate(self, values: Mapping[str, Any], changed: set[str]) -> None:
        """Raise PaintError if these values contradict each other, or cannot be had now.

        ``changed`` has the names of those that change in a node whose files have been read.
        """

    def _configure(self) -> Mapping[str, Task]:
        """Read the files named in ``self.values``, and create topics, services and the like.

        Returns:
            The diagnostic tasks, by name.

        Raises:
            PaintError: the files cannot be used; the node ends, or waits for others.
        """
        return {}

    def _on_change(self, names: set[str]) -> None:
        """Apply the changes of these parameters; ``self.values`` has the new values."""

    def close(self) -> None:
        """Close files and the like. Called once, after the last callback; signals are ignored."""
        self.stop_requested.set()
        if self._thread is not None:
            self._thread.join()

    def destroy_node(self) -> None:
        PaintNode.close(self)
        super().destroy_node()

    # --- for all users

    def start_thread(self, work: Callable[[], None]) -> None:
        """Do work that ends soon once ``stop_requested`` is set, which closing the node does.

        An exception ends the process.
        """

        def guarded() -> None:
            try:
                work()
            except Exception as error:
                self.finish(error)

        self._thread = threading.Thread(target=guarded, name=self.get_name(), daemon=True)
        self._thread.start()

    def create_steady_timer(self, period_s: float, callback: Callable[[], Any]) -> Timer:
        """A timer that also runs while a simulated clock stands still."""
        return self.create_timer(period_s, callback, clock=self._steady)

    async def result_of(self, work: concurrent.futures.Future) -> Any:
        """Await work that a thread does; other callbacks run meanwhile."""
        self.awaiting += 1
        done: Future = Future(executor=self.executor)
        # Completed from another thread, a future does not wake the executor unless it has a
        # callback to run.
        done.add_done_callback(lambda _: None)
        work.add_done_callback(done.set_result)
        await done
        self.awaiting -= 1
        return work.result()

    def finish(self, error: Exception | None = None) -> None:
        """Ask the process to exit; the running callback is completed first.

        With an error where raising it would not end the process.
        """
        if self.finished.done():
            return
        if error is None:
            self.finished.set_result(None)
        else:
            self.finished.set_exception(error)

    def require_named_folder(self, file: str) -> None:
        """Raise PaintError for a file in no folder that was named when the node was started.

        Otherwise whoever can reach the node could read the files of this machine.
        """
        # Unlike the methods of a path, these mind no unknown user and no loop of links.
        path = Path(os.path.realpath(os.path.expanduser(file)))
        if os.path.exists(path) and not any(map(path.is_relative_to, self._input_folders)):
            raise PaintError(
                f'{quoted(file)} is in no folder that {self.get_name()} was given at its start; '
                'restart it with that folder in input_folders'
            )

    def _files_of(self, values: Mapping[str, Any]) -> list[str]:
        """The paths that parameters hold."""
        paths = {name for name, row in self.PARAMETERS.items() if row.is_path}
        held = [values[name] for name in values.keys() & paths]
        return [file for each in held for file in np.atleast_1d(each).tolist() if file]

    # --- diagnostics

    def report(self, tasks: Mapping[str, Task], period_s: float = 1.0) -> None:
        """Publish the status of each task by name on /diagnostics, once in each period.

        They go on while a simulated clock stands still. ``tasks`` may change later.
        """
        self.tasks = dict(tasks)
        self._reports = self.create_publisher(
            DiagnosticArray, '/diagnostics', QoSProfile(depth=10)
        )
        self.create_steady_timer(period_s, self.publish_diagnostics)

    def publish_diagnostics(self) -> None:
        """Publish the status of each task now."""
        message = DiagnosticArray()
        message.header.stamp = self.get_clock().now().to_msg()
        full_name = self.get_fully_qualified_name()
        for name, status_of in self.tasks.items():
            level, words, values = status_of()
            # Aggregators tell two cells apart by the namespace.
            task = f'{full_name.lstrip("/")}: {name}'
            figures = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
            message.status.append(
                DiagnosticStatus(
                    level=level, name=task, message=words, hardware_id=full_name, values=figures
                )
            )
        self._reports.publish(message)

    # --- changes of parameters

    def set_parameters_atomically(
        self, parameter_list: list[Parameter[Any]]
    ) -> SetParametersResult:
        """Refuse to change fixed parameters with the reason, which rclpy leaves out.

        A value in another type than that of its row, as 2 for 2.0, is set in that of the row.
        """
        changes: list[Parameter[Any]] = []
        for change in parameter_list:
            name, row = change.name, self.PARAMETERS.get(change.name)
            if row and row.fixed_because and (self.configured or row.fixed_while == RUNS):
                reason = f'{name} cannot change while the node {row.fixed_while}: '
                return SetParametersResult(successful=False, reason=reason + row.fixed_because)
            with contextlib.suppress(PaintError):  # what is invalid is refused as it is
                if row:
                    change = Parameter(name, row.ros_type, row.checked(name, change.value))
            changes.append(change)
        result = super().set_parameters_atomically(changes)
        if result.successful:
            self.values |= {change.name: change.value for change in changes}
            if self.configured:
                self._on_change({change.name for change in changes})
        return result

    def set_parameters(self, parameter_list: list[Parameter[Any]]) -> list[SetParametersResult]:
        """Set each parameter on its own."""
        return [self.set_parameters_atomically([parameter]) for parameter in parameter_list]

    def _on_set_parameters(self, changes: list[Parameter]) -> SetParametersResult:
        new = {change.name: change.value for change in changes}
        try:
            for name in new.keys() & self.PARAMETERS.keys():
                self.PARAMETERS[name].checked(name, new[name])
            for file in self._files_of(new):
                self.require_named_folder(file)
            self._validate(self.values | new, set(new) if self.configured else set())
        except Exception as error:  # no file that a peer names ends a node
            reason = str(error) or 'not enough memory'
            return SetParametersResult(successful=False, reason=reason)
        return SetParametersResult(successful=True)


def run_node(make_node: Callable[[], PaintNode], signals: list[int] | None = None) -> int:
    """Run one node until it finishes or the process gets a signal; return the exit code.

    SIGINT, which `ros2 launch` sends twice, and SIGTERM stop the node between callbacks with exit
    code 0. A PaintError, or a file without access, is one line on stderr and exit code 2, any
    other exception a traceback and exit code 1. The node is closed in every case. ``signals``
    were received before the call.
    """
    node: PaintNode | None = None
    received = [] if signals is None else signals

    def on_signal(number: int, _frame: object) -> None:
        received.append(number)
        PaintNode.signalled = True
        # Files are read for minutes with a new model, and nothing is lost. An exception instead
        # could be swallowed by a library or by the compiler.
        if PaintNode.loading:
            os._exit(0)

    try:
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, on_signal)
        if received:
            return 0
        node = _create_node(make_node)
        executor = SingleThreadedExecutor(context=node.context)
        executor.add_node(node)
        if not received:
            node.get_logger().info('ready')
        while not (received or node.finished.done()):
            # Signals do not reach the main thread while it waits in the middleware.
            executor.spin_once(timeout_sec=0.1)
        executor.remove_node(node)
        executor.shutdown(timeout_sec=5.0)
        if node.finished.done():
            node.finished.result()
        exit_code = 0
    except Exception as error:
        exit_code = _report_error(error)
    finally:
        # Python restores the default action of its own handlers while it exits, and a second
        # SIGINT would then kill it; an ignored signal stays ignored.
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.SIG_IGN)
    try:
        if node is not None:
            node.close()
            node.destroy_node()
    except Exception as error:
        exit_code = max(exit_code, _report_error(error))
    finally:
        rclpy.try_shutdown()
    return exit_code


def _create_node(make_node: Callable[[], PaintNode]) -> PaintNode:
    step = 'ROS arguments'
    try:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        step = 'ROS cannot make the node'
        return make_node()
    except RuntimeError as error:
        # RCLError is not public. Causes: security without keys or libraries, an invalid name.
        if step != 'ROS arguments' and type(error).__name__ != 'RCLError':
            raise
        reason = ' '.join(str(error).split(', at /')[0].split())
        raise PaintError(f'{step}: {reason}') from None


def _report_error(error: Exception) -> int:
    text = str(error) or 'not enough memory'
    if isinstance(error, OSError) and error.filename:  # a folder that is closed to this user
        text = f'{error.filename}: {error.strerror}'
    elif not isinstance(error, PaintError | MemoryError):
        traceback.print_exception(error)
        return 1
    sys.stderr.write(f'error: {text}\n')
    return 2

"""The base of every node: parameters, clock, threads, and what it says of its health."""

from __future__ import annotations

import concurrent.futures
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.task import Future
from rclpy.timer import Timer
from std_srvs.srv import Trigger

from paint_deposition.errors import PaintError
from paint_deposition.nodes.runtime import topics
from paint_deposition.nodes.runtime.parameters import (
    NodeParameter,
    ParameterTable,
    declare_parameters,
)

OK = DiagnosticStatus.OK
WARN = DiagnosticStatus.WARN
ERROR = DiagnosticStatus.ERROR


class PaintNode(Node):
    """A node with a parameter table that can end its process and has something to finish then.

    Keyword arguments are those of rclpy's Node (context, namespace, parameter_overrides, ...).

    Attributes:
        loading: whether a node of this process is reading its files.
        values: the parameters by name, as they are now.
        finished: completed when the process is to end, with its exit code or an exception.
    """

    PARAMETERS: ParameterTable = MappingProxyType({})
    loading = False

    def __init__(self, name: str, **kwargs: Any):
        super().__init__(name, **kwargs)
        self.finished: Future = Future()
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        try:
            self.values = declare_parameters(self, self.PARAMETERS)
            self._check(self.values)
            self._begin()
        except PaintError:
            # The subclass is not complete yet: it has nothing of its own to destroy.
            super().destroy_node()
            raise
        self.add_on_set_parameters_callback(self._check_changes)
        self.add_post_set_parameters_callback(self._apply_changes)

    def _begin(self) -> None:
        self._load()

    def _load(self) -> None:
        """Read the files; a signal breaks it off."""
        PaintNode.loading = True
        try:
            self._prepare()
        finally:
            PaintNode.loading = False

    # --- for the subclass

    def _check(self, values: Mapping[str, Any]) -> None:
        """Raise PaintError if these values do not go together."""

    def _prepare(self) -> None:
        """Read the files that ``self.values`` name; a PaintError ends the node."""

    def _check_change(self, values: Mapping[str, Any], names: set[str]) -> None:
        """Raise PaintError if the new values of these parameters cannot be taken up now."""

    def _changed(self, names: set[str]) -> None:
        """Take up the new values of these parameters, which are in ``self.values``."""

    def close(self) -> None:
        """Finish files and the like. Called once, after the last callback; signals are ignored."""

    # --- for everybody

    @property
    def configured(self) -> bool:
        """Whether its files have been read."""
        return True

    def create_steady_timer(self, period_s: float, callback: Callable[[], None]) -> Timer:
        """A timer that also runs while a simulated clock stands still."""
        return self.create_timer(period_s, callback, clock=self._steady)

    def offer(self, name: str, answer: Callable[[], tuple[bool, str]]) -> None:
        """A service std_srvs/Trigger; `answer` says whether all went well, and what happened."""

        def respond(_request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            response.success, response.message = answer()
            return response

        self.create_service(Trigger, name, respond)

    async def in_a_thread(self, work: concurrent.futures.Future) -> Any:
        """What a thread's work returns, or raises; other callbacks run meanwhile."""
        done: Future = Future(executor=self.executor)
        # Completed from another thread, a future does not wake the executor unless it has a
        # callback to run.
        done.add_done_callback(lambda _: None)
        work.add_done_callback(done.set_result)
        await done
        return work.result()

    def finish(self, exit_code: int = 0) -> None:
        """Ask the process to end; the callback that runs is completed first."""
        if not self.finished.done():
            self.finished.set_result(exit_code)

    def fail(self, error: Exception) -> None:
        """Ask the process to end with an error, from a thread or a callback that must return."""
        if not self.finished.done():
            self.finished.set_exception(error)

    # --- changes of parameters

    def set_parameters_atomically(
        self, parameter_list: list[Parameter[Any]]
    ) -> SetParametersResult:
        """Refuse to change what is fixed with the reason, which rclpy leaves out."""
        for name in (change.name for change in parameter_list):
            row = self.PARAMETERS.get(name)
            if row and row.fixed_because and self._is_fixed(name, row):
                reason = f'{name} cannot change while the node {row.fixed_while}: '
                return SetParametersResult(successful=False, reason=reason + row.fixed_because)
        return super().set_parameters_atomically(parameter_list)

    def set_parameters(self, parameter_list: list[Parameter[Any]]) -> list[SetParametersResult]:
        """As if each were set on its own."""
        return [self.set_parameters_atomically([parameter]) for parameter in parameter_list]

    def _is_fixed(self, name: str, row: NodeParameter) -> bool:
        if row.is_read_only:
            # While they are declared, parameters can still be set.
            return self.describe_parameter(name).read_only
        return self.configured

    def _check_changes(self, changes: list[Parameter]) -> SetParametersResult:
        new = {change.name: change.value for change in changes}
        try:
            self._check(self.values | new)
            if self.configured:
                self._check_change(self.values | new, set(new))
        except PaintError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _apply_changes(self, changes: list[Parameter]) -> None:
        self.values |= {change.name: change.value for change in changes}
        if self.configured:
            self._changed({change.name for change in changes})


@dataclass(frozen=True)
class Status:
    """One task's state: `level` is OK, WARN or ERROR (single bytes), values are printed as is."""

    level: bytes
    message: str
    values: Mapping[str, object] = field(default_factory=dict)


Task = Callable[[], Status]


class Diagnostics:
    """Publishes the status of every task of a node on /diagnostics.

    `tasks`, which may change, maps a task's name to the function that gives its `Status` each
    period of the steady clock: a simulated clock that stands still must not silence it.
    """

    def __init__(self, node: PaintNode, tasks: Mapping[str, Task], period_s: float = 1.0):
        self._node = node
        self.tasks = dict(tasks)
        self._publisher = node.create_publisher(
            DiagnosticArray, '/diagnostics', topics.DIAGNOSTICS
        )
        node.create_steady_timer(period_s, self.publish)

    def publish(self) -> None:
        message = DiagnosticArray()
        message.header.stamp = self._node.get_clock().now().to_msg()
        full_name = self._node.get_fully_qualified_name()
        for name, status_of in self.tasks.items():
            status = status_of()
            values = [KeyValue(key=key, value=str(value)) for key, value in status.values.items()]
            # With the namespace: an aggregator distinguishes two cells by it.
            task = f'{full_name.lstrip("/")}: {name}'
            message.status.append(
                DiagnosticStatus(
                    level=status.level, name=task, message=status.message,
                    hardware_id=full_name, values=values,
                )
            )  # fmt: skip
        self._publisher.publish(message)

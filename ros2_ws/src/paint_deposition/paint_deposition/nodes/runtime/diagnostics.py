"""What a node says of its own health: a DiagnosticArray once a second."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from paint_deposition.nodes.runtime import qos
from paint_deposition.nodes.runtime.paint_node import PaintNode

OK = DiagnosticStatus.OK
WARN = DiagnosticStatus.WARN
ERROR = DiagnosticStatus.ERROR


@dataclass(frozen=True)
class Status:
    """One task's state: `level` is OK, WARN or ERROR (single bytes), values are printed as is."""

    level: bytes
    message: str
    values: Mapping[str, object] = field(default_factory=dict)


Task = Callable[[], Status]


class Diagnostics:
    """Publishes the status of every task of a node on /diagnostics.

    `tasks` maps a task's name to the function that is asked for its `Status` each period. The
    period runs on the steady clock: a simulated clock that stands still must not silence it.
    """

    def __init__(self, node: PaintNode, tasks: Mapping[str, Task], period_s: float = 1.0):
        self._node = node
        self._tasks = dict(tasks)
        self._publisher = node.create_publisher(DiagnosticArray, '/diagnostics', qos.DIAGNOSTICS)
        self._timer = node.create_steady_timer(period_s, self.publish)

    def show(self, tasks: Mapping[str, Task]) -> None:
        """Tell of these tasks from now on."""
        self._tasks = dict(tasks)

    def show_only(self, name: str, why: str) -> None:
        """Tell of this task alone, and of the others why there is nothing to tell.

        An aggregator takes a status that is no longer sent for that of a node that is gone.
        """
        for other in self._tasks.keys() - {name}:
            self._tasks[other] = lambda: Status(OK, why)

    def publish(self) -> None:
        message = DiagnosticArray()
        message.header.stamp = self._node.get_clock().now().to_msg()
        full_name = self._node.get_fully_qualified_name()
        for name, task in self._tasks.items():
            status = task()
            values = [KeyValue(key=key, value=str(value)) for key, value in status.values.items()]
            message.status.append(
                DiagnosticStatus(
                    level=status.level,
                    # With the namespace: an aggregator tells two cells apart by it.
                    name=f'{full_name.lstrip("/")}: {name}',
                    message=status.message,
                    hardware_id=full_name,
                    values=values,
                )
            )
        self._publisher.publish(message)

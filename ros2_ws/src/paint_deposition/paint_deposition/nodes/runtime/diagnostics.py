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


class Diagnostics:
    """Publishes the status of every task of a node on /diagnostics.

    `tasks` maps a task's name to the function that is asked for its `Status` each period. The
    period runs on the steady clock: a simulated clock that stands still must not silence it.
    """

    def __init__(
        self, node: PaintNode, tasks: Mapping[str, Callable[[], Status]], period_s: float = 1.0
    ):
        self._node = node
        self._tasks = dict(tasks)
        self._publisher = node.create_publisher(DiagnosticArray, '/diagnostics', qos.DIAGNOSTICS)
        self._timer = node.create_steady_timer(period_s, self.publish)

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

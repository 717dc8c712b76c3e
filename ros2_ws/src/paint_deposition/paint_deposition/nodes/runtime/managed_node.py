"""A managed node: it is configured and activated by itself, or by a lifecycle manager."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from rclpy.lifecycle import LifecycleNodeMixin, LifecycleState, TransitionCallbackReturn

from paint_deposition.errors import PaintError
from paint_deposition.nodes.runtime.node import ERROR, OK, Diagnostics, PaintNode, Status, Task
from paint_deposition.nodes.runtime.parameters import NodeParameter, ParameterTable, fixed

MANAGED = fixed(
    'it counts when the node starts',
    autostart=NodeParameter(
        True,
        'Configure and activate the node when it starts; false: a lifecycle manager does '
        '[true/false]',
    ),
)
ENTITIES = ('publisher', 'subscription', 'service', 'client', 'timer')


class ManagedNode(LifecycleNodeMixin, PaintNode):
    """A node with the states of a managed node of ROS 2.

    To configure it reads its files and makes its topics and services; active, it works. What a
    transition makes on the node is destroyed by the one that leads back. Bad input, a PaintError,
    leaves the state as it was; any other error leads to `unconfigured`. Both are said in a line.
    """

    PARAMETERS: ParameterTable = MANAGED
    # Whether it is just being configured and activated by itself.
    starts_itself = False
    _failure: Exception | None = None

    def __init__(self, name: str, **kwargs: Any):
        # What was there before it was configured, and before it was activated.
        self._before: list[set[Any]] = []
        # The mixin does not pass arguments on; it is initialised when the node is there.
        PaintNode.__init__(self, name, **kwargs)

    def _begin(self) -> None:
        LifecycleNodeMixin.__init__(self)
        self._health = Diagnostics(self, {'state': self._state_status})
        self.starts_itself = self.values['autostart']
        if not self.starts_itself:
            self.get_logger().info('waits for a lifecycle manager to configure it')
            return
        for step in (self.trigger_configure, self.trigger_activate):
            step()
            if self._failure is not None:
                raise self._failure
        self.starts_itself = False

    # --- for the subclass

    def _configure(self) -> None:
        """Make what is there as long as the node is configured; its files have been read."""

    def _activate(self) -> None:
        """Begin to work."""

    def _deactivate(self) -> None:
        """Hold the work, all that came before included in it."""

    def _cleanup(self) -> None:
        """End threads and the like; what was made on the node goes by itself."""

    def _tasks(self) -> Mapping[str, Task]:
        """The health of the configured node by task, by name."""
        return {}

    @property
    def configured(self) -> bool:
        return len(self._before) > 0

    @property
    def active(self) -> bool:
        """Whether it works."""
        return len(self._before) > 1

    def close(self) -> None:
        """Hold the work and clean up, as far as it was begun."""
        if self.active:
            self._lead_back(self._deactivate)
        if self.configured:
            self._lead_back(self._clean_up)

    # --- transitions

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        return self._outcome('configured', lambda: self._lead_on(self._set_up))

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        return self._outcome('activated', lambda: self._lead_on(self._activate))

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        return self._outcome('deactivated', lambda: self._lead_back(self._deactivate))

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        return self._outcome('cleaned up', lambda: self._lead_back(self._clean_up))

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        return self._outcome('shut down', self.close)

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        self.close()
        return TransitionCallbackReturn.SUCCESS

    def _set_up(self) -> None:
        self._load()
        self._configure()
        self._health.tasks = {**self._tasks(), 'state': self._state_status}

    def _clean_up(self) -> None:
        try:
            self._cleanup()
        finally:
            # An aggregator takes a status that is no longer sent for that of a node that is gone.
            for task in self._health.tasks.keys() - {'state'}:
                self._health.tasks[task] = lambda: Status(OK, 'the node is not configured')

    def _outcome(self, done: str, transition: Callable[[], None]) -> TransitionCallbackReturn:
        self._failure = None
        try:
            transition()
        except Exception as error:
            self._failure = error
            if not self.starts_itself:  # else the process ends with it
                self.get_logger().error(f'not {done}: {_in_words(error)}')
            foreseen = isinstance(error, PaintError)
            return TransitionCallbackReturn.FAILURE if foreseen else TransitionCallbackReturn.ERROR
        if not self.starts_itself:
            self.get_logger().info(done)
        return TransitionCallbackReturn.SUCCESS

    def _lead_on(self, step: Callable[[], None]) -> None:
        kinds = (getattr(self, f'{kind}s') for kind in ENTITIES)
        self._before.append({entity for entities in kinds for entity in entities})
        try:
            step()
        except BaseException:
            self._destroy_new()
            raise

    def _lead_back(self, step: Callable[[], None]) -> None:
        try:
            step()
        finally:
            self._destroy_new()

    def _destroy_new(self) -> None:
        before = self._before.pop()
        for kind in ENTITIES:
            for entity in set(getattr(self, f'{kind}s')) - before:
                getattr(self, f'destroy_{kind}')(entity)

    def _state_status(self) -> Status:
        label = self._state_machine.current_state[1]
        if self._failure is not None:
            return Status(ERROR, f'{label}: {_in_words(self._failure)}')
        return Status(OK, label)


def _in_words(error: Exception) -> str:
    """The error in a line; of one that nobody foresaw its kind, too."""
    words = ' '.join(str(error).split())
    return words if isinstance(error, PaintError) else f'{type(error).__name__}: {words}'

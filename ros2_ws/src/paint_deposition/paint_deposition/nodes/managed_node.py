"""Managed (lifecycle) nodes, which can also configure and activate themselves."""

from contextlib import suppress
from functools import partialmethod
from typing import Any

from rclpy.lifecycle import LifecycleNodeMixin, LifecycleState, TransitionCallbackReturn

from paint_deposition.errors import PaintError
from paint_deposition.nodes.node import ERROR, OK, PaintNode, Status
from paint_deposition.nodes.parameters import NodeParameter, ParameterTable, fixed

MANAGED = fixed(
    'it is read when the node starts',
    autostart=NodeParameter(
        True,
        'Configure and activate the node when it starts; false: a lifecycle manager does '
        '[true/false]',
    ),
)
ENTITIES = ('publisher', 'subscription', 'service', 'client', 'timer')


class ManagedNode(PaintNode, LifecycleNodeMixin):
    """A node with the lifecycle of a managed node of ROS 2.

    `configure` reads its files and creates its topics and services; `activate` starts its work.
    The reverse transition destroys the publishers, timers and so on that a transition created,
    and `cleanup` also those that callbacks created since `configure`: a callback that creates one
    for the time of activity destroys it in `_deactivate`. A PaintError leaves the state as it
    was; any other error leads to `unconfigured`. Either is logged in one line. While a request is
    under way, whose answer needs its service, the node refuses to leave a state. Nothing keeps it
    from shutting down: it stops its work at once, and cleans up after that answer.
    """

    PARAMETERS: ParameterTable = MANAGED
    # Whether the node is configuring and activating itself right now.
    autostarting = False
    _failure: Exception | None = None

    def _start(self) -> None:
        # The entities that `configure` created, and those that `activate` created.
        self._created: list[set[Any]] = []
        LifecycleNodeMixin.__init__(self)  # now that the node exists
        self.report({'state': self._state_status})
        self.autostarting = self.values['autostart']
        if not self.autostarting:
            self.get_logger().info('waiting for a lifecycle manager to configure this node')
            return
        for step in (self.trigger_configure, self.trigger_activate):
            step()
            if self._failure is not None:
                raise self._failure
        self.autostarting = False

    # --- for the subclass

    def _activate(self) -> None:
        """Start working."""

    def _deactivate(self) -> None:
        """Pause the work, after processing everything received so far."""

    def _cleanup(self) -> None:
        """Stop threads and the like; publishers, timers and so on are destroyed anyway."""

    @property
    def configured(self) -> bool:  # type: ignore[override]
        """Whether the node is in the state `inactive` or `active`."""
        return len(self._created) > 0

    @property
    def active(self) -> bool:
        """Whether the node is in the state `active`."""
        return len(self._created) > 1

    def close(self) -> None:
        """Deactivate and clean up, if the node is active or configured, whatever fails."""
        try:
            if self.configured:
                self._leave(may_stay=False)
        finally:
            if self.configured:
                self.close()

    def destroy_node(self) -> None:
        super().destroy_node()
        # rclpy leaves the services of the lifecycle to the garbage collector. Meanwhile they are
        # counted by whoever looks for those of the next node of this name.
        if hasattr(self, '_state_machine'):
            self._state_machine.destroy_when_not_in_use()

    # --- transitions

    def _transition(self, done: str, step: str, state: LifecycleState) -> TransitionCallbackReturn:
        """Do the step of that name; `done` says what the node is then."""
        try:
            if step == '_leave' and self.awaiting:
                raise PaintError('a request is under way: call again after it')
            getattr(self, step)()
        except Exception as error:
            expected = isinstance(error, PaintError)
            # A node that refuses to leave its state is as well as before.
            if step != '_leave' or not expected:
                self._failure = error
            if not self.autostarting:  # else the process ends with this error
                self.get_logger().error(f'not {done}: {_error_text(error)}')
            return TransitionCallbackReturn.FAILURE if expected else TransitionCallbackReturn.ERROR
        self._failure = None
        if not self.autostarting:
            self.get_logger().info(done)
        return TransitionCallbackReturn.SUCCESS

    on_configure = partialmethod(_transition, 'configured', '_enter')
    on_activate = partialmethod(_transition, 'activated', '_enter')
    on_deactivate = partialmethod(_transition, 'deactivated', '_leave')
    on_cleanup = partialmethod(_transition, 'cleaned up', '_leave')

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        if not self.awaiting:
            return self._transition('shut down', 'close', state)
        # A shutdown that fails leads to `finalized`, too.
        if self.active:
            self._leave(may_stay=False)
        self.create_steady_timer(0.1, lambda: self.awaiting or self.on_shutdown(state))
        return TransitionCallbackReturn.SUCCESS

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        with suppress(PaintError):  # whoever could not save a film has said so
            self.close()
        return TransitionCallbackReturn.SUCCESS

    def _enter(self) -> None:
        """Configure the node, or activate it if it is configured."""
        before = self._entities
        self._created.append(set())
        try:
            if self.active:
                self._activate()
            else:
                self._lasting = before
                self.tasks = {**self._load(), 'state': self._state_status}
        except BaseException:
            self._created.pop()
            self._destroy(self._entities - before)
            raise
        self._created[-1] = self._entities - before

    def _leave(self, may_stay: bool = True) -> None:
        """Deactivate the node if it is active, else clean it up; a PaintError keeps its state."""
        stays = False
        try:
            if self.active:
                self._deactivate()
            else:
                self._cleanup()
        except PaintError:
            stays = may_stay
            raise
        finally:
            if not stays:
                created = self._created.pop()
                self._destroy(created if self.configured else self._entities - self._lasting)
            if not self.configured:
                # An aggregator would report a status that is no longer published as stale.
                for task in self.tasks.keys() - {'state'}:
                    self.tasks[task] = lambda: (OK, 'the node is not configured', {})

    @property
    def _entities(self) -> set[Any]:
        return {entity for kind in ENTITIES for entity in getattr(self, f'{kind}s')}

    def _destroy(self, entities: set[Any]) -> None:
        for kind in ENTITIES:
            for entity in entities.intersection(getattr(self, f'{kind}s')):
                getattr(self, f'destroy_{kind}')(entity)

    def _state_status(self) -> Status:
        label = self._state_machine.current_state[1]
        if self._failure is not None:
            return ERROR, f'{label}: {_error_text(self._failure)}', {}
        return OK, label, {}


def _error_text(error: Exception) -> str:
    """The error in one line, with its type unless it is a PaintError."""
    words = ' '.join(str(error).split())
    return words if isinstance(error, PaintError) else f'{type(error).__name__}: {words}'

"""The messages that are still valid when a run begins, and are repeated at its beginning."""

from collections.abc import Collection, Iterator

from rcl_interfaces.msg import ParameterEvent
from rclpy.serialization import deserialize_message

from paint_deposition.nodes.recording.recorder_parameters import PARAMETER_EVENTS, STATIC_TF


class InitialMessages:
    """Serialised messages that later runs need: newest state and part pose, tf, parameters.

    ``newest_topics`` are the topics whose newest message is valid until the next one.
    """

    def __init__(self, newest_topics: Collection[str]) -> None:
        self._newest_topics = newest_topics
        self._messages: dict[object, tuple[str, bytes, int]] = {}

    def __iter__(self) -> Iterator[tuple[str, bytes, int]]:
        """(topic, serialised message, time sent [ns]), the latest last."""
        return iter(self._messages.values())

    def add(self, topic: str, cdr: bytes, sent_ns: int) -> None:
        """Keep a message if it stays valid, instead of the one that it replaces."""
        key: object = topic
        if topic == PARAMETER_EVENTS:
            event = deserialize_message(cdr, ParameterEvent)
            changed = (*event.new_parameters, *event.changed_parameters)
            key = event.node, *(parameter.name for parameter in changed)
        elif topic == STATIC_TF:
            key = cdr
        elif topic not in self._newest_topics:
            return
        self._messages.pop(key, None)
        self._messages[key] = topic, cdr, sent_ns

"""Messages of the right type with whatever a peer may put into their fields."""

import math
import random
import re

from rclpy.qos import DurabilityPolicy, QoSProfile

from paint_deposition.nodes.topics import message_class

NUMBERS = (0.0, 1.0, -1.0, math.nan, math.inf, -math.inf, 1e308, -1e-308, 1e6, 0.5)
WORDS = ('', '/', 'part', 'cell', 'no such frame', '..', 'a' * 300, "it's\n=1+1", 'µ\u2028')
ARRAY = re.compile(r'(sequence<(?P<inner>.+?)(, \d+)?>|(?P<kind>.+)\[(?P<count>\d+)\])')


def odd_message(message: type, rng: random.Random) -> object:
    """A message of that type, each field of which is now and then left as it is."""
    made = message()
    for name, kind in message.get_fields_and_field_types().items():
        if rng.random() < 0.85:
            setattr(made, name, _odd(kind, rng))
    return made


def _odd(kind: str, rng: random.Random) -> object:
    if several := ARRAY.fullmatch(kind):
        count = int(several['count'] or rng.choice([0, 1, 3, 7]))
        return [_odd(several['inner'] or several['kind'], rng) for _ in range(count)]
    if kind in ('float', 'double'):
        value = rng.choice(NUMBERS)
        return value if kind == 'double' or abs(value) < 1e38 or math.isinf(value) else 0.0
    if kind.startswith(('string', 'wstring')):
        return rng.choice(WORDS)
    if kind == 'boolean':
        return rng.random() < 0.5
    if kind in ('octet', 'byte'):
        return bytes([rng.randrange(4)])
    if match := re.fullmatch(r'(u?)int(\d+)', kind):
        bits = int(match[2])
        low, high = (0, 2**bits - 1) if match[1] else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
        return rng.choice([low, high, 0, 1, max(low, -1), 999_999_999 % (high + 1)])
    package, name = kind.split('/')
    return odd_message(message_class(f'{package}/msg/{name}'), rng)


class Peer:
    """Publishes odd messages on every topic that a node subscribes to."""

    def __init__(self, node) -> None:
        self._node = node
        self._publishers = {}

    def send(self, subscribed, rng: random.Random) -> None:
        """An odd message on each of the topics of these nodes."""
        latched = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        for subscription in [each for node in subscribed for each in node.subscriptions]:
            topic, kind = subscription.topic_name, subscription.msg_type
            if topic not in self._publishers:
                self._publishers[topic] = self._node.create_publisher(kind, topic, latched)
            self._publishers[topic].publish(odd_message(kind, rng))

    @property
    def is_heard(self) -> bool:
        return all(publisher.get_subscription_count() for publisher in self._publishers.values())

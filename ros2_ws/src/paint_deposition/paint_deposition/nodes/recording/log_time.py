"""The log times of a recording, which go on where the clock of the machine is set back."""

# Messages of one topic come out of order by less.
LEAST_STEP_NS = 1_000_000_000


class LogTime:
    """Turns times of reception into log times.

    Readers order messages by their log times: those from after a step back of the clock would come
    before those from before it.

    Attributes:
        set_back_ns: by how much the clock has been set back in all.
    """

    def __init__(self) -> None:
        self.set_back_ns = 0
        self._newest_ns: dict[str, int] = {}

    def of(self, received_ns: int, topic: str = '') -> int:
        """The log time of a message of a topic, received at this time of the clock [ns].

        On a busy machine some topics wait longer than others until they are taken, so only the
        messages of one topic tell that the clock was set back.
        """
        time_ns = received_ns + self.set_back_ns
        newest_ns = self._newest_ns.get(topic, 0)
        if time_ns < newest_ns - LEAST_STEP_NS:
            self.set_back_ns += newest_ns - time_ns
            time_ns = newest_ns
        self._newest_ns[topic] = max(newest_ns, time_ns)
        return time_ns

"""The log times of a recording, which go on where the clock of the machine is set back."""

# Messages of different topics come out of order by less.
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
        self._newest_ns = 0

    def of(self, received_ns: int) -> int:
        """The log time of a message received at this time of the clock [ns]."""
        time_ns = received_ns + self.set_back_ns
        if time_ns < self._newest_ns - LEAST_STEP_NS:
            self.set_back_ns += self._newest_ns - time_ns
            time_ns = self._newest_ns
        self._newest_ns = max(self._newest_ns, time_ns)
        return time_ns

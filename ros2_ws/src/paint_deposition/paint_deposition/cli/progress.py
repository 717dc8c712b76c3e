"""Progress of work that lasts, on stderr: what is being done, how far it is, for how long."""

import sys
from threading import Event, Thread

from tqdm import tqdm

# A bar shows itself only for work that takes longer, and never when piped.
SHOW_PROGRESS_AFTER_S = 2.0
REDRAWN_EVERY_S = 0.5
BAR = '{desc}: {percentage:3.0f}%|{bar}| [{elapsed}]'
LINE = '{desc} [{elapsed}]'


class Progress:
    """A line that keeps counting the time, with a bar where the share of the work is known.

    Call it with what is being done and, where known, with the share of it that is done, 0 to 1.

    Args:
        command: its name, at the head of the line.
        after_s: work that takes no longer shows nothing [s].
    """

    def __init__(self, command: str, after_s: float = SHOW_PROGRESS_AFTER_S) -> None:
        self._command, self._after_s = command, after_s
        self._bar = tqdm(
            total=1.0, desc=command, bar_format=LINE, disable=None, leave=False, file=sys.stderr,
            delay=after_s,
        )  # fmt: skip
        self._done = Event()
        self._clock = Thread(target=self._redraw, daemon=True)

    def __enter__(self) -> 'Progress':
        if not self._bar.disable:
            self._clock.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._done.set()
        if self._clock.is_alive():
            self._clock.join()
        self._bar.close()

    def __call__(self, what: str, share: float | None = None) -> None:
        self._bar.bar_format = LINE if share is None else BAR
        self._bar.n = share or 0.0
        self._bar.set_description_str(f'{self._command}: {what}', refresh=False)

    def _redraw(self) -> None:
        """Show the newest line again and again, so that the clock runs within a step too."""
        pause_s = self._after_s
        while not self._done.wait(pause_s):
            self._bar.refresh()
            pause_s = REDRAWN_EVERY_S

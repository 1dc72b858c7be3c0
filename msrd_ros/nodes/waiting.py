"""What a node waits for, and since when: said when it changes, and again at growing intervals."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping

FIRST_REMINDER_S = 5.0
LONGEST_PAUSE_S = 600.0


class Waiting:
    """Remembers since when each thing has been waited for.

    Parameters
    ----------
    say
        Takes a line for the node's log.
    now_s
        Clock in seconds that never goes back.
    """

    def __init__(self, say: Callable[[str], None], now_s: Callable[[], float] = time.monotonic) -> None:
        self._say, self._now_s = say, now_s
        self._since_s: dict[str, float] = {}
        self._told: tuple[str, ...] = ()
        self._next_s = self._pause_s = 0.0

    def update(self, reasons: Iterable[str]) -> None:
        """Tell what keeps the node from its work now; nothing at all if it works.

        Parameters
        ----------
        reasons
            Each what is waited for and what to do about it; the same words as long as it is the same.
        """
        now_s = self._now_s()
        wanted = tuple(reasons)
        self._since_s = {reason: self._since_s.get(reason, now_s) for reason in wanted}
        if wanted != self._told:
            self._told = wanted
            self._pause_s = FIRST_REMINDER_S
            self._say(f"waits for {self.text}" if wanted else "waits for nothing more")
        elif wanted and now_s >= self._next_s:
            self._pause_s = min(2.0 * self._pause_s, LONGEST_PAUSE_S)
            self._say(f"still waits for {self.text} ({self.longest_s:.0f} s)")
        else:
            return
        self._next_s = now_s + self._pause_s

    @property
    def text(self) -> str:
        """All that is waited for, in one line; empty if nothing is."""
        return "; ".join(self._told)

    @property
    def longest_s(self) -> float:
        """Since when the oldest of it is waited for, in seconds before now."""
        return self._now_s() - min(self._since_s.values(), default=self._now_s())

    def figures(self) -> Mapping[str, object]:
        """What /diagnostics carries of it; nothing if nothing is waited for."""
        if not self._told:
            return {}
        return {"waits_for": self.text, "waits_s": round(self.longest_s, 1)}

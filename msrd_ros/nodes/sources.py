"""Who speaks on a topic: publishers told apart by the numbers of their messages."""

from __future__ import annotations

from collections import Counter, deque

INTERLEAVED = 3
"""So many messages of each of two publishers, in turns, tell that both go on."""
FORGET_S = 4.0
"""A publisher that is silent for so long has gone."""
FURTHEST = 100_000
"""A gap in a publisher's numbers is not longer than this."""


class Sources:
    """Tells whether a topic's messages come from one publisher or from several that go on side by side.

    Each publisher numbers its messages upwards. A number that does not go on from the last one is of another
    publisher: one that was started again, if the former is not heard any more, or else a second one.
    """

    def __init__(self) -> None:
        self._last: dict[int, int] = {}
        self._made = 0
        # Whose turns were the latest, and until when.
        self._turns: deque[tuple[int, float]] = deque(maxlen=16 * INTERLEAVED)

    def add(self, sequence: int, now_s: float) -> None:
        """Take the number of a message that came in now; 0 if the middleware does not tell."""
        if sequence <= 0:
            return
        before = {key: last for key, last in self._last.items() if last < sequence <= last + FURTHEST}
        if before:
            source = max(before, key=lambda key: before[key])
        else:
            self._made += 1
            source = self._made
        self._last[source] = sequence
        if self._turns and self._turns[-1][0] == source:
            self._turns.pop()
        self._turns.append((source, now_s))
        if len(self._last) > INTERLEAVED:
            alive = {key for key, _ in self._turns}
            self._last = {key: last for key, last in self._last.items() if key in alive}

    def count(self, now_s: float) -> int:
        """How many publishers go on side by side at present."""
        turns = Counter(source for source, heard_s in self._turns if now_s - heard_s <= FORGET_S)
        return max(sum(count >= INTERLEAVED for count in turns.values()), 1)

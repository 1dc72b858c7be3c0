"""Keeping what comes in until a stroke can be cut out of it."""

from __future__ import annotations

import bisect
from collections import deque
from collections.abc import Callable, Iterable

from msrd_ros.bags.cdr import read_stamp_ns
from msrd_ros.bags.strokes import (
    OTHER_JOINT_STATES,
    STATES,
    Arrival,
    CutSettings,
    Stroke,
    cut_stroke,
    is_simulated,
    only_arms,
    read_decision,
)
from msrd_ros.contract.topics import FEED, JOINT_STATES, OUTCOME, STRATEGY, BagMessage

_QUIET_TICKS = 3
_QUIET_TICKS_SIMULATED = 25
"""Where the order of sending tells when a stroke is whole, silence is only the last resort: on a starved
machine messages are under way for longer than a few ticks."""
_RESET_NS = 500_000_000


class StrokeBuffer:
    """Holds what came in until a stroke can be cut.

    Topics reach a process out of step: an outcome may come before joint states that were sent earlier. So
    a stroke counts as settled when every state topic has gone past the outcome, or nothing has come for
    some ticks of the caller's timer.

    Stamps of `joint_states` that are far from the wall clock tell of simulated time. The stroke's order is
    then the order of sending, and its clock those stamps: exact, however late the recorder got to run.

    Parameters
    ----------
    settings
        How strokes are cut.
    is_arms
        Whether a serialised joint state is the arm's own. Those of other devices have their own clocks and
        labels, and are no part of a stroke.
    """

    def __init__(self, settings: CutSettings, is_arms: Callable[[bytes], bool] = lambda _: True) -> None:
        self._settings = settings
        self._is_arms = is_arms
        self._arrivals: deque[Arrival] = deque()
        self._feeds: deque[Arrival] = deque()
        self._outcomes: deque[Arrival] = deque()
        self._strategy: Arrival | None = None
        self._newest: dict[str, Arrival] = {}
        self._simulated = False
        self._stamp_ns = 0
        self._quiet_ticks = 0
        self.expired_feeds = 0
        self._last_ball = -1

    @property
    def under_way(self) -> bool:
        """Whether a ball has been fed and is not decided, or is decided and not yet cut."""
        return bool(self._feeds) or bool(self._outcomes)

    @property
    def pending(self) -> bool:
        """Whether an outcome waits to be cut."""
        return bool(self._outcomes)

    def add(self, arrival: Arrival) -> None:
        """Take a message of a topic that is to be recorded."""
        self._quiet_ticks = 0
        if arrival.role == JOINT_STATES and not self._is_arms(arrival.data):
            arrival = arrival._replace(role=OTHER_JOINT_STATES)
        if arrival.role in STATES:
            self._newest[arrival.role] = arrival
        if arrival.role == JOINT_STATES:
            self._watch_clock(arrival)
        elif arrival.role == FEED:
            self._feeds.append(arrival)
        elif arrival.role == OUTCOME:
            self._outcomes.append(arrival)
        if arrival.role != FEED:
            self._arrivals.append(arrival)
        self._trim(arrival.received_ns)

    def tick(self) -> None:
        """Tell that time has passed; messages that were waiting have been taken in between."""
        self._quiet_ticks += 1

    def settled(self) -> bool:
        """Whether the oldest pending outcome can be cut."""
        if not self._outcomes:
            return False
        silence = _QUIET_TICKS_SIMULATED if self._simulated else _QUIET_TICKS
        if self._quiet_ticks >= silence:
            return True
        if len(self._outcomes) > 1 and not self._simulated:
            return True
        # A simulator sends all topics itself, so that their order of sending tells; on a starved machine the
        # order of receiving does not.
        patience_ns = 0 if self._simulated else int(self._settings.settle_s * 1e9)
        past_ns = self._key(self._outcomes[0]) + patience_ns
        return all(role in self._newest and self._key(self._newest[role]) > past_ns for role in STATES)

    def cut(self) -> Stroke:
        """Take the stroke of the oldest pending outcome out of the buffer."""
        outcome = self._outcomes.popleft()
        end = self._key(outcome)
        decision = read_decision(outcome.data)
        feed = self._feed_of(outcome, decision.ball_id)
        inside = sorted(
            (a for a in self._arrivals if self._key(a) <= end and a is not outcome), key=self._key
        )
        if feed is not None:
            bisect.insort(inside, feed, key=self._key)
        inside.append(outcome)
        inside = only_arms(inside)
        stroke = cut_stroke(inside, decision, self._strategy, self._simulated, self._settings)
        self._remember_strategy(inside)
        self._arrivals = deque(arrival for arrival in self._arrivals if self._key(arrival) > end)
        return stroke

    def _feed_of(self, outcome: Arrival, number: str) -> Arrival | None:
        """The feed that led to an outcome, taken out; balls are decided in the order in which they were fed.

        Where ball numbers leave some out, their outcomes were never heard: those feeds go as well. Kept, each
        would be taken for the next ball's, and a stroke would seem to be under way for good.
        """
        end = self._key(outcome)
        waiting = sum(self._key(feed) <= end for feed in self._feeds)
        if number.isdecimal():
            unheard = int(number) - self._last_ball - 1
            for _ in range(min(unheard, waiting - 1)):
                self._feeds.popleft()
            self._last_ball = int(number)
        return self._feeds.popleft() if waiting else None

    def discard(self) -> None:
        """Drop the stroke under way; the strategy stays."""
        self._remember_strategy(self._arrivals)
        self._arrivals.clear()
        self._feeds.clear()
        self._outcomes.clear()

    def _key(self, arrival: Arrival) -> int:
        return arrival.sent_ns if self._simulated else arrival.received_ns

    def _watch_clock(self, arrival: Arrival) -> None:
        try:
            stamp_ns = read_stamp_ns(arrival.data)
        except ValueError:
            return  # the inspection says what is wrong with it
        self._simulated = is_simulated(arrival)
        if self._simulated and stamp_ns < self._stamp_ns - _RESET_NS and not self._outcomes:
            # Simulated time that jumps back begins a new world, or another bag that is being played; a
            # stroke that is decided is whole already, and told from what follows by the order of sending.
            self._forget_before(self._key(arrival))
        self._stamp_ns = stamp_ns

    def _forget_before(self, key_ns: int) -> None:
        """Drop what was sent earlier; other topics may have run ahead into the new world."""
        self._remember_strategy(a for a in self._arrivals if self._key(a) < key_ns)
        self._arrivals = deque(a for a in self._arrivals if self._key(a) >= key_ns)
        self._feeds = deque(a for a in self._feeds if self._key(a) >= key_ns)

    def _remember_strategy(self, arrivals: Iterable[Arrival]) -> None:
        for arrival in arrivals:
            if arrival.role == STRATEGY:
                self._strategy = arrival

    def _trim(self, now_ns: int) -> None:
        if self._outcomes:
            return
        given_up_ns = now_ns - int(self._settings.longest_s * 1e9)
        while self._feeds and self._feeds[0].received_ns < given_up_ns:
            self._feeds.popleft()
            self.expired_feeds += 1
        oldest_ns = given_up_ns if self._feeds else now_ns - int(self._settings.unfed_s * 1e9)
        while self._arrivals and self._arrivals[0].received_ns < oldest_ns:
            self._remember_strategy([self._arrivals.popleft()])


def split_strokes(
    messages: Iterable[BagMessage],
    settings: CutSettings,
    is_arms: Callable[[bytes], bool] = lambda _: True,
) -> list[Stroke]:
    """Cut the strokes of a longer recording; topics are relative names, log times in order."""
    strokes: list[Stroke] = []
    buffer = StrokeBuffer(settings, is_arms)
    for message in messages:
        time_ns = message.log_time_ns
        buffer.add(Arrival(message.topic, message.data, time_ns, time_ns, message.sequence))
        if message.topic == OUTCOME:
            strokes.append(buffer.cut())
    return strokes

"""Cutting strokes out of a stream of messages: one ball, from its launch to the referee's decision."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from msrd_ros.bags.cdr import read_frame_id, read_stamp_ns
from msrd_ros.bags.schemas import deserialise
from msrd_ros.bags.topics import BALL_POSITION, CONTRACT, FEED, JOINT_STATES, OUTCOME, STRATEGY, BagMessage
from msrd_ros.facts.errors import UserError
from msrd_ros.facts.labels import StrategyLabel

_STATES = (JOINT_STATES, BALL_POSITION)
_QUIET_TICKS = 3
_RESET_NS = 500_000_000


class Arrival(NamedTuple):
    """A message as it came in.

    Attributes
    ----------
    role
        The contract's relative name of its topic, or the full name of another topic.
    data
        CDR as received.
    received_ns, sent_ns
        When the middleware received it and when the publisher sent it, in nanoseconds of wall time.
    sequence
        The publisher's number of it; 0 if unknown.
    lost_before
        How many messages of this publisher went missing right before it.
    """

    role: str
    data: bytes
    received_ns: int
    sent_ns: int
    sequence: int = 0
    lost_before: int = 0


@dataclass(frozen=True)
class CutSettings:
    """How strokes are cut.

    Attributes
    ----------
    pre_roll_s
        What is kept of the time before the launch, in log time.
    simulated_time
        Log times are the simulation's instead of the wall clock's. A bag's order is then the order of
        sending, and its clock the stamps of `joint_states`: exact, however late the recorder got to run.
    unfed_s
        How far back a stroke reaches that no `feed` began (a ball thrown by hand), in wall time.
    longest_s
        A feed without an outcome is given up after this wall time.
    settle_s
        How long after an outcome messages may still arrive that were sent before it, in wall time.
    """

    pre_roll_s: float = 0.2
    simulated_time: bool = False
    unfed_s: float = 5.0
    longest_s: float = 60.0
    settle_s: float = 0.01


@dataclass(frozen=True)
class Stroke:
    """One ball.

    Attributes
    ----------
    label
        From the outcome, else from the strategy in effect at the launch; None if neither has one.
    ball_id, outcome
        The ball's number and ``returned`` or the miss reason, as the referee wrote them.
    launch_ns, end_ns
        Log times of launch and outcome.
    messages
        In the order of their log times; topics are relative names. The strategy comes first.
    lost
        How many messages of the state topics went missing within it.
    """

    label: StrategyLabel | None
    ball_id: str
    outcome: str
    launch_ns: int
    end_ns: int
    messages: tuple[BagMessage, ...]
    lost: int


class StrokeBuffer:
    """Holds what came in until a stroke can be cut.

    Topics reach a process out of step: an outcome may come before joint states that were sent earlier. So
    a stroke counts as settled when every state topic has gone past the outcome, or nothing has come for
    some ticks of the caller's timer.
    """

    def __init__(self, settings: CutSettings) -> None:
        self._settings = settings
        self._arrivals: deque[Arrival] = deque()
        self._strategy: Arrival | None = None
        self._outcomes: deque[Arrival] = deque()
        self._newest_ns: dict[str, int] = {}
        self._fed_ns = 0
        self._stamp_ns = 0
        self._quiet_ticks = 0
        self.expired_feeds = 0

    @property
    def under_way(self) -> bool:
        """Whether a ball has been fed and is not decided, or is decided and not yet cut."""
        return self._fed_ns > 0 or bool(self._outcomes)

    @property
    def pending(self) -> bool:
        """Whether an outcome waits to be cut."""
        return bool(self._outcomes)

    def add(self, arrival: Arrival) -> None:
        """Take a message of a topic that is to be recorded."""
        self._drop_on_reset(arrival)
        self._arrivals.append(arrival)
        self._quiet_ticks = 0
        if arrival.role in _STATES:
            self._newest_ns[arrival.role] = arrival.received_ns
        elif arrival.role == FEED:
            self._fed_ns = arrival.received_ns
        elif arrival.role == OUTCOME:
            self._outcomes.append(arrival)
        self._trim(arrival.received_ns)

    def tick(self) -> None:
        """Tell that time has passed; messages that were waiting have been taken in between."""
        self._quiet_ticks += 1

    def settled(self) -> bool:
        """Whether the oldest pending outcome can be cut."""
        if not self._outcomes:
            return False
        if len(self._outcomes) > 1 or self._quiet_ticks >= _QUIET_TICKS:
            return True
        past_ns = self._outcomes[0].received_ns + int(self._settings.settle_s * 1e9)
        return all(self._newest_ns.get(role, 0) >= past_ns for role in _STATES)

    def cut(self) -> Stroke:
        """Take the stroke of the oldest pending outcome out of the buffer."""
        outcome = self._outcomes.popleft()
        ordered = sorted(self._arrivals, key=self._key)
        end = self._key(outcome)
        inside = [arrival for arrival in ordered if self._key(arrival) <= end]
        stroke = cut_stroke(inside, outcome, self._strategy, self._settings)
        self._forget(inside)
        self._arrivals = deque(arrival for arrival in self._arrivals if self._key(arrival) > end)
        self._fed_ns = max((a.received_ns for a in self._arrivals if a.role == FEED), default=0)
        return stroke

    def discard(self) -> None:
        """Drop the stroke under way; the strategy stays."""
        self._forget(sorted(self._arrivals, key=self._key))
        self._arrivals.clear()
        self._outcomes.clear()
        self._fed_ns = 0

    def _key(self, arrival: Arrival) -> int:
        return arrival.sent_ns if self._settings.simulated_time else arrival.received_ns

    def _drop_on_reset(self, arrival: Arrival) -> None:
        """Simulated time that jumps back begins a new world: nothing of the old one is in its strokes."""
        if self._settings.simulated_time and arrival.role == JOINT_STATES:
            stamp_ns = read_stamp_ns(arrival.data)
            if stamp_ns < self._stamp_ns - _RESET_NS:
                self.discard()
            self._stamp_ns = stamp_ns

    def _forget(self, arrivals: Sequence[Arrival]) -> None:
        for arrival in arrivals:
            if arrival.role == STRATEGY:
                self._strategy = arrival

    def _trim(self, now_ns: int) -> None:
        if self._outcomes:
            return
        keep_s = self._settings.longest_s if self._fed_ns else self._settings.unfed_s
        oldest_ns = now_ns - int(keep_s * 1e9)
        while self._arrivals and self._arrivals[0].received_ns < oldest_ns:
            dropped = self._arrivals.popleft()
            self._forget([dropped])
            if dropped.role == FEED and dropped.received_ns == self._fed_ns:
                self._fed_ns = 0
                self.expired_feeds += 1


def cut_stroke(
    arrivals: Sequence[Arrival], outcome: Arrival, strategy: Arrival | None, settings: CutSettings
) -> Stroke:
    """Make a stroke of the messages since the last one.

    Parameters
    ----------
    arrivals
        In order, ending with `outcome`.
    strategy
        The strategy in effect before the first of them.
    """
    times = _log_times(arrivals, settings.simulated_time)
    begin = _launch_index(arrivals)
    launch_ns = times[begin]
    first_ns = max(launch_ns - int(settings.pre_roll_s * 1e9), times[0])
    strategy = _strategy_in_effect(arrivals, begin, strategy, _label_of(outcome))
    label = _label_of(outcome) or (_label_of(strategy) if strategy else None)
    messages: list[BagMessage] = []
    if strategy is not None:
        messages.append(_message(strategy, first_ns, settings))
    previous: dict[str, bytes] = {}
    lost = 0
    for time_ns, arrival in zip(times, arrivals, strict=True):
        if time_ns < first_ns or arrival.role == STRATEGY:
            continue  # a strategy set in mid-flight is that of the next ball
        lost += arrival.lost_before if arrival.role in _STATES else 0
        if arrival.role in _STATES and previous.get(arrival.role) == arrival.data:
            continue  # lockstep repeats unanswered ticks, and the ball while there is no new camera frame
        previous[arrival.role] = arrival.data
        messages.append(_message(arrival, time_ns, settings))
    ball_id, text = read_outcome(outcome.data)
    return Stroke(label, ball_id, text, launch_ns, times[-1], tuple(messages), lost)


def read_outcome(data: bytes) -> tuple[str, str]:
    """Ball number and message of a serialised `rally/outcome`; empty if it holds no status ``rally``."""
    for status in deserialise(data, CONTRACT[OUTCOME].type_name).status:
        if status.name == "rally":
            return {item.key: item.value for item in status.values}.get("ball_id", ""), status.message
    return "", ""


def split_strokes(messages: Iterable[BagMessage], settings: CutSettings) -> list[Stroke]:
    """Cut the strokes of a longer recording; topics are relative names, log times in order."""
    strokes: list[Stroke] = []
    buffer = StrokeBuffer(settings)
    for message in messages:
        time_ns = message.log_time_ns
        buffer.add(Arrival(message.topic, message.data, time_ns, time_ns, message.sequence))
        if message.topic == OUTCOME:
            strokes.append(buffer.cut())
    return strokes


def _launch_index(arrivals: Sequence[Arrival]) -> int:
    for role in (FEED, STRATEGY):
        indices = [index for index, arrival in enumerate(arrivals) if arrival.role == role]
        if indices:
            return indices[-1] if role == FEED else indices[0]
    return 0


def _strategy_in_effect(
    arrivals: Sequence[Arrival], begin: int, earlier: Arrival | None, label: StrategyLabel | None
) -> Arrival | None:
    """The newest strategy up to the launch; one that came in just after it, if only that fits the outcome."""
    newest = earlier
    for arrival in arrivals[: begin + 1]:
        if arrival.role == STRATEGY:
            newest = arrival
    if newest is None or (label is not None and _label_of(newest) != label):
        for arrival in arrivals[begin + 1 :]:
            if arrival.role == STRATEGY and label in (None, _label_of(arrival)):
                return arrival
    return newest


def _log_times(arrivals: Sequence[Arrival], simulated_time: bool) -> list[int]:
    if not simulated_time:
        return [arrival.received_ns for arrival in arrivals]
    stamps = [read_stamp_ns(a.data) if a.role == JOINT_STATES else -1 for a in arrivals]
    now_ns = next((stamp for stamp in stamps if stamp >= 0), 0)
    times = []
    for stamp in stamps:
        now_ns = max(now_ns, stamp)
        times.append(now_ns)
    return times


def _label_of(arrival: Arrival) -> StrategyLabel | None:
    try:
        return StrategyLabel.parse_optional(read_frame_id(arrival.data))
    except (ValueError, UserError):
        return None


def _message(arrival: Arrival, time_ns: int, settings: CutSettings) -> BagMessage:
    # One time base in a bag: under simulated time the wall time of sending means nothing to a reader.
    sent_ns = time_ns if settings.simulated_time else arrival.sent_ns
    return BagMessage(arrival.role, arrival.data, time_ns, sent_ns, arrival.sequence)

"""Cutting strokes out of a stream of messages: one ball, from its launch to the referee's decision."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence, Set
from dataclasses import dataclass, field
from typing import NamedTuple

from msrd_ros.bags.cdr import read_frame_id, read_stamp_ns
from msrd_ros.bags.schemas import deserialise
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.contract.stamps import stamp_to_ns
from msrd_ros.contract.topics import (
    BALL_POSITION,
    CONTRACT,
    FEED,
    JOINT_STATES,
    OUTCOME,
    STRATEGY,
    BagMessage,
)
from msrd_ros.contract.translation import RALLY_STATUS, BallTracker, read_ball_position
from msrd_ros.core.errors import UserError

_SIMULATED_NS = 10_000_000_000

STATES = (JOINT_STATES, BALL_POSITION)
"""The topics of which every message counts."""
OTHER_JOINT_STATES = "joint_states of another device"
"""Takes the place of the topic for those that are not the arm's."""


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
    unfed_s
        How far back a stroke reaches that no `feed` began (a ball thrown by hand), in wall time.
    longest_s
        A feed without an outcome is given up after this wall time.
    settle_s
        How long after an outcome messages may still arrive that were sent before it, in wall time.
    """

    pre_roll_s: float = 0.2
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
    ball_id, outcome, flight_s
        The ball's number, ``returned`` or the miss reason, and how many seconds after its launch it was
        decided, as the referee wrote them; NaN where it does not say when. An outcome of None: nobody said.
    launch_ns, end_ns
        Log times of launch and outcome.
    messages
        In the order of their log times; topics are relative names. The strategy comes first.
    received_ns
        When each of them was received: its log time, unless that is simulated time.
    lost
        How many messages of the state topics went missing within it.
    """

    label: StrategyLabel | None
    ball_id: str
    outcome: str | None
    flight_s: float
    launch_ns: int
    end_ns: int
    messages: tuple[BagMessage, ...]
    received_ns: tuple[int, ...] = field(compare=False)
    lost: int


class Decision(NamedTuple):
    """What a `Stroke` takes from the referee's words; fields as there."""

    ball_id: str = ""
    outcome: str | None = ""
    flight_s: float = math.nan


def cut_stroke(
    arrivals: Sequence[Arrival],
    decision: Decision,
    strategy: Arrival | None,
    simulated: bool,
    settings: CutSettings,
) -> Stroke:
    """Make a stroke of the messages since the last one.

    Parameters
    ----------
    arrivals
        In order, ending with the outcome.
    decision
        What that outcome says.
    strategy
        The strategy in effect before the first of them.
    simulated
        Log times are the stamps of `joint_states`, not the wall clock's.
    """
    outcome = arrivals[-1]
    times = _log_times(arrivals, simulated)
    said = _said(arrivals, strategy)
    begin = _launch_index(arrivals, said)
    launch_ns = times[begin]
    first_ns = max(launch_ns - int(settings.pre_roll_s * 1e9), times[0])
    strategy = _strategy_in_effect(arrivals, begin, strategy, _label_of(outcome))
    label = _label_of(outcome) or (_label_of(strategy) if strategy else None)
    rows: list[tuple[BagMessage, int]] = []
    if strategy is not None:
        rows.append((_message(strategy, first_ns, simulated), strategy.received_ns))
    previous: dict[str, bytes] = {}
    lost = 0
    for index, (time_ns, arrival) in enumerate(zip(times, arrivals, strict=True)):
        # What was asked for long before the launch is told at the beginning. A strategy set in mid-flight
        # is that of the next ball.
        time_ns = max(time_ns, first_ns) if arrival.role == FEED else time_ns
        if time_ns < first_ns or arrival.role == STRATEGY:
            continue
        if index < begin and arrival.role == JOINT_STATES and _label_of(arrival) in said - {label}:
            continue  # the tail of the stroke before
        lost += arrival.lost_before if arrival.role in STATES else 0
        if arrival.role in STATES and previous.get(arrival.role) == arrival.data:
            continue  # lockstep repeats unanswered ticks, and the ball while there is no new camera frame
        previous[arrival.role] = arrival.data
        rows.append((_message(arrival, time_ns, simulated), arrival.received_ns))
    rows.sort(key=lambda row: row[0].log_time_ns)
    messages, received_ns = zip(*rows, strict=True)
    return Stroke(label, *decision, launch_ns, times[-1], messages, received_ns, lost)


def only_arms(arrivals: Sequence[Arrival]) -> list[Arrival]:
    """The arrivals without other devices' joint states; with them as the arm's where it has none itself."""
    if any(arrival.role == JOINT_STATES for arrival in arrivals):
        return [arrival for arrival in arrivals if arrival.role != OTHER_JOINT_STATES]
    return [a._replace(role=JOINT_STATES) if a.role == OTHER_JOINT_STATES else a for a in arrivals]


def whole_stroke(
    messages: Sequence[BagMessage], label: StrategyLabel | None, is_arms: Callable[[bytes], bool]
) -> Stroke:
    """Make a stroke of a recording of one ball, with all its messages; topics are relative names.

    Without labels in the joint states the launch is where the ball begins to fly: a feed may have been asked
    for long before.
    """
    arrivals = only_arms(
        [
            Arrival(
                OTHER_JOINT_STATES if m.topic == JOINT_STATES and not is_arms(m.data) else m.topic,
                m.data,
                m.log_time_ns,
                m.log_time_ns,
                m.sequence,
            )
            for m in messages
        ]
    )
    joints = [arrival for arrival in arrivals if arrival.role == JOINT_STATES]
    simulated = 2 * sum(is_simulated(arrival) for arrival in joints) > len(joints)
    times = _log_times(arrivals, simulated)
    begin = _labels_begin(arrivals, _said(arrivals, None))
    begin = _flight_index(arrivals) if begin is None else begin
    begin = _launch_index(arrivals, set()) if begin is None else begin
    ends = [index for index, arrival in enumerate(arrivals) if arrival.role == OUTCOME]
    decision = read_decision(arrivals[ends[-1]].data) if ends else Decision(outcome=None)
    rows = [_message(arrival, time, simulated) for arrival, time in zip(arrivals, times, strict=True)]
    received_ns = tuple(arrival.received_ns for arrival in arrivals)
    return Stroke(
        label, *decision, times[begin], times[ends[-1] if ends else -1], tuple(rows), received_ns, lost=0
    )


def read_decision(data: bytes) -> Decision:
    """What a serialised `rally/outcome` says; nothing if it cannot be read or holds no status ``rally``."""
    try:
        array = deserialise(data, CONTRACT[OUTCOME].type_name)
    except UserError:
        return Decision()
    for status in array.status:
        if status.name == RALLY_STATUS:
            values = {item.key: item.value for item in status.values}
            try:
                flight_s = float(values["decision_time_s"])
            except (KeyError, ValueError):
                flight_s = math.nan
            return Decision(values.get("ball_id", ""), status.message, flight_s)
    return Decision()


def _said(arrivals: Sequence[Arrival], earlier: Arrival | None) -> set[StrategyLabel]:
    """What `strategy` and `rally/outcome` say: in a joint state any other name is a driver's frame."""
    saying = [arrival for arrival in arrivals if arrival.role in (STRATEGY, OUTCOME)]
    labels = {_label_of(arrival) for arrival in (*saying, *([earlier] if earlier else []))}
    return {label for label in labels if label is not None}


def is_simulated(arrival: Arrival) -> bool:
    """Whether a stamp is far from the wall clock: it tells of simulated time. One of zero tells nothing."""
    stamp_ns = _stamp_ns(arrival)
    return stamp_ns > 0 and abs(stamp_ns - arrival.received_ns) > _SIMULATED_NS


def _launch_index(arrivals: Sequence[Arrival], said: Set[StrategyLabel]) -> int:
    """Where the launch is: joint states begin to carry a label; else the feed; else the strategy's setting.

    A feed may be asked for long before its launch: the arm has to be ready first.
    """
    begin = _labels_begin(arrivals, said)
    if begin is not None:
        return begin
    for role in (FEED, STRATEGY):
        for index, arrival in enumerate(arrivals):
            if arrival.role == role:
                return index
    return 0


def _labels_begin(arrivals: Sequence[Arrival], said: Set[StrategyLabel]) -> int | None:
    joints = [index for index, arrival in enumerate(arrivals) if arrival.role == JOINT_STATES]
    labelled = [_label_of(arrivals[index]) in said for index in joints]
    begins = [joints[i] for i in range(1, len(joints)) if labelled[i] and not labelled[i - 1]]
    return begins[-1] if begins else None


def _flight_index(arrivals: Sequence[Arrival]) -> int | None:
    """The last ball position before the ball is seen flying towards the robot."""
    tracker = BallTracker()
    before = None
    for index, arrival in enumerate(arrivals):
        if arrival.role != BALL_POSITION:
            continue
        try:
            message = deserialise(arrival.data, CONTRACT[BALL_POSITION].type_name)
            tracker.add(read_ball_position(message), stamp_to_ns(message.header.stamp))
        except UserError:
            continue
        if tracker.fed:
            return before
        before = index
    return None


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


def _log_times(arrivals: Sequence[Arrival], simulated: bool) -> list[int]:
    if not simulated:
        return [arrival.received_ns for arrival in arrivals]
    stamps = [_stamp_ns(a) if a.role in (JOINT_STATES, OUTCOME) else -1 for a in arrivals]
    now_ns = next((stamp for stamp in stamps if stamp >= 0), 0)
    times = []
    for stamp in stamps:
        now_ns = max(now_ns, stamp)
        times.append(now_ns)
    return times


def _stamp_ns(arrival: Arrival) -> int:
    try:
        return read_stamp_ns(arrival.data)
    except ValueError:
        return -1


def _label_of(arrival: Arrival) -> StrategyLabel | None:
    try:
        return StrategyLabel.parse_optional(read_frame_id(arrival.data))
    except (ValueError, UserError):
        return None


def _message(arrival: Arrival, time_ns: int, simulated: bool) -> BagMessage:
    # One time base in a bag: under simulated time the wall time of sending means nothing to a reader.
    sent_ns = time_ns if simulated else arrival.sent_ns
    return BagMessage(arrival.role, arrival.data, time_ns, sent_ns, arrival.sequence)

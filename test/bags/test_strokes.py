"""Cutting a stream of messages into strokes, and judging them."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable

import pytest

from msrd_ros.bags.cdr import read_frame_id, read_header, read_stamp_ns
from msrd_ros.bags.stroke_buffer import StrokeBuffer, split_strokes
from msrd_ros.bags.strokes import Arrival, CutSettings, Stroke
from msrd_ros.contract.outcome import MissReason
from msrd_ros.contract.topics import BagMessage
from msrd_ros.nodes.adaptive import LossCounter
from msrd_ros.recordings.inspection import inspect, label_joint_states
from msrd_ros.recordings.limits import InspectionLimits
from msrd_ros.recordings.verdict import Refusal, Verdict
from sawyer import ROBOT
from synthetic_strokes import (
    LAUNCH_S,
    RALLY_S,
    START_NS,
    ball_position,
    joint_state,
    outcome,
    strategy,
    stroke_messages,
)

LIMITS = InspectionLimits()
SIMULATED_NS = 2_000_000_000


def arrivals(messages: Iterable[BagMessage], delay_ns: int = 0) -> list[Arrival]:
    """As they come in on the wall clock, at the times that they carry."""
    return [Arrival(m.topic, m.data, m.log_time_ns + delay_ns, m.log_time_ns, m.sequence) for m in messages]


def in_simulated_time(messages: Iterable[BagMessage]) -> list[Arrival]:
    """As they come in at some wall time, one after the other, about five times as fast as stamped."""
    wall_ns = [START_NS + index * 400_000 for index in range(5000)]
    return [Arrival(m.topic, m.data, now, now - 1000) for m, now in zip(messages, wall_ns, strict=False)]


def cut(items: Iterable[Arrival], settings: CutSettings | None = None) -> list[Stroke]:
    """All strokes of a stream, each cut as soon as its outcome is there."""
    buffer = StrokeBuffer(settings or CutSettings())
    strokes = []
    for item in items:
        buffer.add(item)
        if item.role == "rally/outcome":
            strokes.append(buffer.cut())
    return strokes


def judge(messages: Iterable[BagMessage]) -> Verdict:
    (stroke,) = cut(arrivals(messages))
    return inspect(stroke, ROBOT, LIMITS)


def test_a_header_is_read_from_the_bytes_alone() -> None:
    data = joint_state(START_NS + 5, "backhand-topspin")
    assert read_header(data) == (START_NS + 5, "backhand-topspin")
    assert read_frame_id(outcome(START_NS, "")) == ""
    big_endian = (
        b"\0\0\0\0" + (7).to_bytes(4, "big") + (9).to_bytes(4, "big") + (2).to_bytes(4, "big") + b"a\0"
    )
    assert read_header(big_endian) == (7_000_000_009, "a")
    for broken in (b"", data[:10], b"\0\7" + data[2:], data[:18]):
        with pytest.raises(ValueError):
            read_header(broken)


def test_a_stroke_begins_before_the_launch_and_ends_with_the_outcome() -> None:
    (stroke,) = cut(arrivals(stroke_messages()), CutSettings(pre_roll_s=0.1))
    assert str(stroke.label) == "forehand-push"
    assert (stroke.ball_id, stroke.outcome, stroke.lost) == ("1", "returned", 0)
    assert stroke.launch_ns == START_NS + int(LAUNCH_S * 1e9)
    first, last = stroke.messages[0], stroke.messages[-1]
    assert (first.topic, first.log_time_ns) == ("strategy", stroke.launch_ns - 100_000_000)
    assert (last.topic, last.log_time_ns) == ("rally/outcome", stroke.end_ns)
    assert stroke.end_ns - stroke.launch_ns == int(RALLY_S * 1e9)
    times = [message.log_time_ns for message in stroke.messages]
    assert times == sorted(times)


def test_simulated_time_comes_from_the_joint_states_however_late_they_are_taken() -> None:
    messages = stroke_messages(start_ns=SIMULATED_NS)
    items = in_simulated_time(messages)
    # The recorder was held up: by topic, not by time, and the clock of reception stands still.
    stalled = [item._replace(received_ns=items[-1].received_ns) for item in items]
    by_topic = sorted(stalled, key=lambda item: (item.role == "rally/outcome", item.role))
    (prompt,), (late,) = cut(items), cut(by_topic)
    assert prompt == late
    assert prompt.launch_ns == SIMULATED_NS + int(LAUNCH_S * 1e9)
    for message in prompt.messages:
        if message.topic == "joint_states":
            assert message.log_time_ns == message.publish_time_ns == read_stamp_ns(message.data)


def test_a_launch_long_after_its_feed_is_found_by_the_labels_of_the_joint_states() -> None:
    messages = stroke_messages()
    early = [
        m._replace(log_time_ns=m.log_time_ns - 200_000_000) if m.topic == "feed" else m for m in messages
    ]
    (stroke,) = cut(arrivals(sorted(early, key=lambda m: m.log_time_ns)), CutSettings(pre_roll_s=0.05))
    assert stroke.launch_ns == START_NS + int(LAUNCH_S * 1e9)
    (feed,) = [message for message in stroke.messages if message.topic == "feed"]
    assert feed.log_time_ns == stroke.messages[0].log_time_ns
    assert inspect(stroke, ROBOT, LIMITS).accepted


def test_feeds_given_in_advance_go_to_their_own_balls() -> None:
    session = [
        message
        for number in range(3)
        for message in stroke_messages(start_ns=START_NS + number * 3_000_000_000, ball_id=number)
    ]
    feeds = [message for message in session if message.topic == "feed"]
    ahead = [message._replace(log_time_ns=START_NS) for message in feeds]
    rest = [message for message in session if message.topic != "feed"]
    strokes = cut(arrivals([*ahead, *rest]))
    assert [[m.data for m in stroke.messages if m.topic == "feed"] for stroke in strokes] == [
        [feed.data] for feed in feeds
    ]
    assert all(inspect(stroke, ROBOT, LIMITS).accepted for stroke in strokes)


def test_a_strategy_set_in_mid_flight_is_that_of_the_next_ball() -> None:
    first = stroke_messages("forehand-push")
    second = stroke_messages("backhand-slice", START_NS + 3_000_000_000, ball_id=2)
    change = next(message for message in second if message.topic == "strategy")
    middle = len(first) // 2
    early = change._replace(log_time_ns=first[middle].log_time_ns)
    session = [*first[:middle], early, *first[middle:], *(m for m in second if m is not change)]
    strokes = cut(arrivals(session))
    assert [str(stroke.label) for stroke in strokes] == ["forehand-push", "backhand-slice"]
    for stroke in strokes:
        (told,) = [message for message in stroke.messages if message.topic == "strategy"]
        assert read_frame_id(told.data) == str(stroke.label)
        assert inspect(stroke, ROBOT, LIMITS).accepted


def test_a_strategy_that_is_heard_just_after_its_ball_counts() -> None:
    messages = stroke_messages("backhand-push")
    late = [m for m in messages if m.topic != "strategy"]
    at = next(index for index, m in enumerate(late) if m.topic == "feed") + 3
    told = BagMessage("strategy", strategy(START_NS, "backhand-push"), late[at].log_time_ns, START_NS)
    before = BagMessage("strategy", strategy(START_NS, "forehand-push"), START_NS, START_NS)
    assert judge([before, *late[:at], told, *late[at:]]).accepted


def test_a_ball_thrown_by_hand_needs_no_feed() -> None:
    messages = [m for m in stroke_messages(joint_frame="base_link") if m.topic != "feed"]
    (stroke,) = cut(arrivals(messages))
    assert inspect(stroke, ROBOT, LIMITS).accepted
    assert len([m for m in stroke.messages if m.topic == "joint_states"]) == 563


def test_repeated_ticks_and_frames_are_stored_once() -> None:
    messages = stroke_messages(start_ns=SIMULATED_NS)
    doubled = [m for message in messages for m in ([message] * (2 if "s" in message.topic[-6:] else 1))]
    (once,) = cut(in_simulated_time(messages))
    (twice,) = cut(in_simulated_time(doubled))
    states = [m for m in twice.messages if m.topic in ("joint_states", "ball/position")]
    assert states == [m for m in once.messages if m.topic in ("joint_states", "ball/position")]


def test_a_stroke_settles_when_the_states_have_gone_past_its_outcome_or_all_is_quiet() -> None:
    buffer = StrokeBuffer(CutSettings(settle_s=0.01))
    items = arrivals(stroke_messages())
    for item in items:
        buffer.add(item)
    end = items[-1].received_ns
    assert buffer.pending
    assert not buffer.settled()
    buffer.add(Arrival("joint_states", joint_state(end, ""), end + 11_000_000, end))
    assert not buffer.settled()
    buffer.add(Arrival("ball/position", ball_position(end, 2.0), end + 11_000_000, end))
    assert buffer.settled()
    quiet = StrokeBuffer(CutSettings())
    for item in items:
        quiet.add(item)
    for _ in range(3):
        assert not quiet.settled()
        quiet.tick()
    assert quiet.settled()
    assert quiet.cut().outcome == "returned"
    assert not quiet.under_way


def test_memory_is_bounded_and_a_feed_without_an_outcome_is_given_up() -> None:
    buffer = StrokeBuffer(CutSettings(unfed_s=1.0, longest_s=3.0))
    messages = [m for m in stroke_messages() if m.topic != "rally/outcome"]
    for item in arrivals(messages):
        buffer.add(item)
    assert buffer.under_way
    later = START_NS + 10_000_000_000
    buffer.add(Arrival("joint_states", joint_state(later, ""), later, later))
    assert not buffer.under_way
    assert buffer.expired_feeds == 1
    # The strategy outlives what came with it.
    buffer.add(Arrival("rally/outcome", outcome(later, ""), later + 1, later + 1))
    assert str(buffer.cut().label) == "forehand-push"


@pytest.mark.parametrize("unheard", [0, 1])
def test_a_feed_whose_outcome_was_never_heard_is_not_taken_for_the_next_strokes(unheard: int) -> None:
    labels = ("forehand-push", "backhand-slice", "forehand-topspin")
    balls = [
        stroke_messages(label, START_NS + number * 3_000_000_000, ball_id=number)
        for number, label in enumerate(labels)
    ]
    heard = [m for n, ball in enumerate(balls) for m in ball if n != unheard or m.topic != "rally/outcome"]
    strokes = cut(arrivals(heard))
    assert [stroke.ball_id for stroke in strokes] == [str(n) for n in range(3) if n != unheard]
    for stroke in strokes:
        own = [m.data for m in balls[int(stroke.ball_id)] if m.topic == "feed"]
        assert [m.data for m in stroke.messages if m.topic == "feed"] == own != []
    buffer = StrokeBuffer(CutSettings())
    for item in arrivals(heard):
        buffer.add(item)
    while buffer.pending:
        buffer.cut()
    assert not buffer.under_way


def test_simulated_time_that_jumps_back_begins_a_new_world() -> None:
    buffer = StrokeBuffer(CutSettings())
    for item in in_simulated_time(stroke_messages(start_ns=SIMULATED_NS * 10)[:700]):
        buffer.add(item)
    assert buffer.under_way
    wall = START_NS + SIMULATED_NS * 3
    again = [item._replace(received_ns=wall + k, sent_ns=wall + k) for k, item in
             enumerate(in_simulated_time(stroke_messages(start_ns=SIMULATED_NS)))]  # fmt: skip
    for item in again:
        buffer.add(item)
    stroke = buffer.cut()
    assert stroke.messages[0].log_time_ns == SIMULATED_NS + 100_000_000
    assert inspect(stroke, ROBOT, LIMITS).accepted


def test_a_recording_is_split_at_its_outcomes() -> None:
    session = [
        message
        for number, label in enumerate(("forehand-push", "backhand-slice"))
        for message in stroke_messages(label, START_NS + number * 3_000_000_000)
    ]
    strokes = split_strokes(session, CutSettings())
    assert [str(stroke.label) for stroke in strokes] == ["forehand-push", "backhand-slice"]


def test_what_is_refused_says_why() -> None:
    good = stroke_messages()
    assert judge(good) == Verdict()
    assert judge(stroke_messages(miss=MissReason.LONG)).reason == "long"
    assert judge([m for m in good if m.topic != "ball/position"]).reason == Refusal.NO_BALL
    assert judge([m for m in good if m.topic != "joint_states"]).reason == Refusal.NO_JOINT_STATES
    conflict = [
        m._replace(data=outcome(m.log_time_ns, "forehand-slice")) if m.topic == "rally/outcome" else m
        for m in good
    ]
    verdict = judge(conflict)
    assert verdict.reason == Refusal.LABEL_CONFLICT
    assert "forehand-slice" in verdict.detail
    for topic in ("strategy", "rally/outcome"):
        # Where one alone says something, and that is no label, the stroke has none that could be meant.
        write = {"strategy": strategy, "rally/outcome": outcome}[topic]
        odd = [
            m._replace(data=write(m.log_time_ns, "My Smash")) if m.topic == topic else m
            for m in stroke_messages(label="")
        ]
        verdict = judge(odd)
        assert verdict.reason == Refusal.LABEL_CONFLICT
        assert f"{topic} says 'My Smash', the stroke is unlabelled" in verdict.detail
    (stroke,) = cut(arrivals(good))
    assert inspect(dataclasses.replace(stroke, lost=3), ROBOT, LIMITS).reason == Refusal.MESSAGES_LOST
    assert inspect(dataclasses.replace(stroke, outcome=""), ROBOT, LIMITS).reason == Refusal.BAD_OUTCOME


def test_a_joint_one_percent_over_its_limit_is_refused_by_name() -> None:
    assert judge(stroke_messages(velocity_scale=1.0099)).accepted
    verdict = judge(stroke_messages(velocity_scale=1.0101))
    assert verdict.reason == Refusal.JOINT_SPEED
    assert "right_j" in verdict.detail
    assert "101.0 %" in verdict.detail


@pytest.mark.parametrize(
    ("topic", "reason"), [("joint_states", Refusal.JOINT_GAP), ("ball/position", Refusal.BALL_STALE)]
)
def test_pauses_are_refused_wherever_they_are(topic: str, reason: Refusal) -> None:
    good = stroke_messages()
    times = [m.log_time_ns for m in good if m.topic == topic]
    launch, end = START_NS + int(LAUNCH_S * 1e9), times[-1]
    for begin, stop in (
        (launch - 1_000_000, launch + 300_000_000),
        (launch + 900_000_000, launch + 1_200_000_000),
        (end - 300_000_000, end),
    ):
        paused = [m for m in good if m.topic != topic or not begin <= m.log_time_ns <= stop]
        assert judge(paused).reason == reason


@pytest.mark.parametrize("come_in", [arrivals, in_simulated_time])
def test_a_stroke_that_is_first_heard_in_mid_flight_is_refused(
    come_in: Callable[[Iterable[BagMessage]], list[Arrival]],
) -> None:
    early, late = (
        [
            message
            for message in stroke_messages(start_ns=SIMULATED_NS)
            if message.topic in ("strategy", "feed")
            or message.log_time_ns >= SIMULATED_NS + int((LAUNCH_S + heard_s) * 1e9)
        ]
        for heard_s in (-0.1, 0.3)
    )
    (whole,) = cut(come_in(early))
    assert inspect(whole, ROBOT, LIMITS).accepted
    (torn,) = cut(come_in(late))
    verdict = inspect(torn, ROBOT, LIMITS)
    assert verdict.reason == (Refusal.LAUNCH_MISSED if come_in is in_simulated_time else Refusal.JOINT_GAP)
    (told_nothing,) = cut(come_in([m for m in late if m.topic not in ("strategy", "feed")]))
    verdict = inspect(dataclasses.replace(told_nothing, label=whole.label), ROBOT, LIMITS)
    assert verdict.reason == Refusal.LAUNCH_MISSED
    assert "0.300 s after the launch" in verdict.detail


def test_a_camera_that_freezes_is_refused() -> None:
    frozen = []
    last = b""
    for index, message in enumerate(stroke_messages()):
        if message.topic == "ball/position":
            last = message.data if not 500 < index < 700 else last
            message = message._replace(data=last)
        frozen.append(message)
    assert judge(frozen).reason == Refusal.BALL_STALE


def test_joint_states_without_labels_get_one_in_the_stored_copy_only() -> None:
    (labelled,) = cut(arrivals(stroke_messages()))
    assert label_joint_states(labelled) == labelled.messages
    (bare,) = cut(arrivals(stroke_messages(joint_frame="base_link")))
    (nameless,) = cut(arrivals(stroke_messages(label="", joint_frame="base_link")))
    assert nameless.label is None
    assert label_joint_states(nameless) == nameless.messages
    stored = label_joint_states(bare)
    assert len(stored) == len(bare.messages)
    for message, original in zip(stored, bare.messages, strict=True):
        if message.topic == "joint_states":
            assert read_header(message.data) == (read_stamp_ns(original.data), "forehand-push")
            assert message._replace(data=b"") == original._replace(data=b"")
        else:
            assert message == original


def test_gaps_in_sequence_numbers_are_counted() -> None:
    counter = LossCounter()
    gaps = [counter.add(number) for number in (5, 6, 9, 10, 1, 2, 4)]
    assert gaps == [0, 0, 2, 0, 0, 0, 1]
    assert counter.lost == 3
    counter.forget()
    assert counter.add(100) == 0


def test_a_launch_missed_by_less_than_the_referees_delay_is_seen_by_where_the_ball_is() -> None:
    """The outcome comes some .3 s after the decision that it tells of, so times alone do not show it."""
    late = [
        message
        for message in stroke_messages(start_ns=SIMULATED_NS)
        if message.topic in ("strategy", "feed")
        or message.log_time_ns >= SIMULATED_NS + int((LAUNCH_S + 0.2) * 1e9)
    ]
    (torn,) = cut(in_simulated_time(late))
    verdict = inspect(torn, ROBOT, dataclasses.replace(LIMITS, joint_gap_s=0.5))
    assert verdict.reason == Refusal.LAUNCH_MISSED
    assert "from where it was fed" in verdict.detail

"""What strangers' bags hold: read where the meaning is certain, else refused with reason and place."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from edited_bags import LABEL, Edit, edited, messages_of, shipped, write, write_edited, write_mcap
from msrd_ros.bags.reader import Bag
from msrd_ros.core.resources import shipped_bags
from msrd_ros.recordings.check import CheckedBag, check
from msrd_ros.recordings.command import main
from msrd_ros.recordings.episodes import read_episodes
from sawyer import ROBOT

EARLIER = Path(__file__).parents[1] / "data" / "0.1.0" / "bags" / "subject_01" / "backhand-slice_001"

SOMEWHERE = 300
"""Number of the message at which faults are put, in mid-flight."""


def only(path: Path) -> CheckedBag:
    (one,) = check(path, ROBOT)
    return one


def place_of(number: int, topic: str = "/joint_states") -> float:
    """When a message of the shipped bag was recorded, in s from its start."""
    messages = messages_of()
    found = [message for message in messages if message.topic == topic]
    return (found[number].log_time_ns - messages[0].log_time_ns) / 1e9


def test_all_shipped_bags_are_accepted() -> None:
    checked = check(shipped_bags(), ROBOT)
    assert len(checked) == 54
    assert [one for one in checked if one.refused or one.strokes != 1 or one.notes] == []


# -- read, and told -----------------------------------------------------------------------------------------


def as_gripper(message: Any) -> Any:
    message.name = ["gripper_finger"]
    message.header.frame_id = ""
    message.position, message.velocity, message.effort = np.array([0.02]), np.zeros(1), np.zeros(1)
    return message


def between_gripper(message: Any, number: int) -> Any:
    return as_gripper(message) if number % 2 else message


def empty_first(message: Any, number: int) -> Any:
    if number == 0:
        message.name = []
        message.position = message.velocity = message.effort = np.zeros(0)
    return message


def without_velocity(message: Any, _: int) -> Any:
    message.velocity = message.effort = np.zeros(0)
    return message


def velocity_nan(message: Any, _: int) -> Any:
    message.velocity = np.full(7, np.nan)
    return message


def without_stamps(message: Any, _: int) -> Any:
    message.header.stamp.sec = message.header.stamp.nanosec = 0
    return message


@pytest.mark.parametrize(
    ("edits", "note"),
    [
        ({"joint_states": between_gripper}, "messages with gripper_finger are passed over"),
        ({"joint_states": empty_first}, "messages with no joints are passed over"),
        ({"joint_states": without_velocity}, "velocities; they are taken from positions and stamps"),
        ({"joint_states": velocity_nan}, "velocities; they are taken from positions and stamps"),
        ({"joint_states": without_stamps}, "joint_states without stamps"),
        ({"ball": without_stamps}, "ball/position without stamps"),
        (
            {"joint_states": without_stamps, "ball": without_stamps},
            "joint_states and ball/position without stamps",
        ),
    ],
)
def test_what_is_certain_is_read_and_noted(tmp_path: Path, edits: dict[str, Edit], note: str) -> None:
    path = write_edited(tmp_path / f"{LABEL}_001", **edits)
    one = only(path)
    assert (one.strokes, one.refused) == (1, None)
    (told,) = one.notes
    assert note in told
    (episode,), (original,) = read_episodes(Bag(path)), read_episodes(Bag(shipped()))
    np.testing.assert_allclose(episode.joint_position, original.joint_position, atol=0.02)
    np.testing.assert_allclose(episode.joint_velocity, original.joint_velocity, atol=0.3)
    np.testing.assert_allclose(episode.ball_position, original.ball_position, atol=0.05)


def test_positions_that_are_too_sparse_say_how_dense_they_must_be(tmp_path: Path) -> None:
    def sparse(message: Any, number: int) -> Any:
        return without_velocity(message, number) if number % 20 == 0 else None

    refused = only(write_edited(tmp_path / f"{LABEL}_001", joint_states=sparse)).refused
    assert refused is not None
    assert "too sparse" in refused
    assert "22 Hz or more" in refused


# -- refused ------------------------------------------------------------------------------------------------


def at(number: int, change: Callable[[Any], None], until: int | None = None) -> Edit:
    """Change the messages of some numbers."""

    def edit(message: Any, index: int) -> Any:
        if number <= index < (number + 1 if until is None else until):
            change(message)
        return message

    return edit


def everywhere(change: Callable[[Any], None]) -> Edit:
    return at(0, change, 10**9)


def degrees(message: Any) -> None:
    message.position, message.velocity = np.degrees(message.position), np.degrees(message.velocity)


def reads_ten(message: Any) -> None:
    message.position[3] = 10.0


def leaps(message: Any) -> None:
    message.position[2] += 0.6


def reversed_names(message: Any) -> None:
    message.name = message.name[::-1]


def swapped(message: Any) -> None:
    message.name[1], message.name[3] = message.name[3], message.name[1]


def jumbled_velocities(message: Any) -> None:
    message.velocity = message.velocity[::-1].copy()


def zero_velocities(message: Any) -> None:
    message.velocity = np.zeros(7)


def too_fast(message: Any) -> None:
    message.velocity *= 1.3


def not_finite(message: Any) -> None:
    message.position[4] = np.inf


def half_filled(message: Any) -> None:
    message.velocity = message.velocity[:3]


def in_future(message: Any) -> None:
    message.header.stamp.sec += 10_000


def hour_ahead(message: Any) -> None:
    message.header.stamp.sec += 3600


def in_past(message: Any) -> None:
    message.header.stamp.sec -= min(3, message.header.stamp.sec)


def same_stamp(message: Any) -> None:
    message.header.stamp.sec, message.header.stamp.nanosec = 7, 0


def in_millimetres(message: Any) -> None:
    for axis in "xyz":
        setattr(message.point, axis, 1000.0 * getattr(message.point, axis))


def elsewhere(message: Any) -> None:
    message.point.y += 2.0


def rises(message: Any) -> None:
    message.point.z = 2.0 - message.point.z


def hovers(message: Any) -> None:
    message.point.x, message.point.y, message.point.z = 0.5, 0.1, 1.2


def nowhere(message: Any) -> None:
    message.point.z = float("nan")


class Frozen:
    """A joint, or all, that stays where it was at a message."""

    def __init__(self, number: int, joints: slice) -> None:
        self.number, self.joints = number, joints
        self.position = np.zeros(0)

    def __call__(self, message: Any, number: int) -> Any:
        if number == self.number:
            self.position = message.position.copy()
        if number >= self.number:
            message.position[self.joints] = self.position[self.joints]
        return message


REFUSED: dict[str, tuple[dict[str, Edit], str, float | None]] = {
    "degrees": ({"joint_states": everywhere(degrees)}, "are these degrees?", None),
    "reads_ten": (
        {"joint_states": at(SOMEWHERE, reads_ten, SOMEWHERE + 10)},
        "joint right_j3 is at 10 rad, beyond its limit of 3.044 rad",
        place_of(SOMEWHERE),
    ),
    "leaps": ({"joint_states": at(SOMEWHERE, leaps)}, "joint right_j2 jumps by 0.6", place_of(SOMEWHERE)),
    "order_changes": (
        {"joint_states": at(SOMEWHERE, reversed_names, 10**9)},
        "joint_jump",
        place_of(SOMEWHERE),
    ),
    "reversed": ({"joint_states": everywhere(reversed_names)}, "joint", None),
    "swapped": ({"joint_states": everywhere(swapped)}, "joint", None),
    "jumbled_velocities": ({"joint_states": everywhere(jumbled_velocities)}, "joint", None),
    "zero_velocities": (
        {"joint_states": everywhere(zero_velocities)},
        "does the driver fill in zeros?",
        None,
    ),
    "frozen_joint": ({"joint_states": Frozen(0, slice(1, 2))}, "is the joint frozen?", None),
    "frozen_arm": ({"joint_states": Frozen(100, slice(None))}, "is the joint frozen?", None),
    "too_fast": ({"joint_states": everywhere(too_fast)}, "% of its speed limit", None),
    "not_finite": (
        {"joint_states": at(SOMEWHERE, not_finite)},
        "position of joint right_j4 is not finite",
        place_of(SOMEWHERE),
    ),
    "half_filled": (
        {"joint_states": at(SOMEWHERE, half_filled)},
        "3 velocity values for 7 joints",
        place_of(SOMEWHERE),
    ),
    "future": (
        {"joint_states": at(SOMEWHERE, in_future)},
        "the stamp of joint_states jumps by 10000.0",
        place_of(SOMEWHERE),
    ),
    "past": (
        {"joint_states": at(SOMEWHERE, in_past)},
        "the stamp of joint_states goes back by",
        place_of(SOMEWHERE),
    ),
    "still": (
        {"joint_states": everywhere(same_stamp)},
        "the stamps of joint_states stand still",
        None,
    ),
    "hour_ahead": (
        {"ball": everywhere(hour_ahead)},
        "the stamps of ball/position are at least 3600.00",
        None,
    ),
    "clock_set": (
        {"joint_states": at(SOMEWHERE, hour_ahead, 10**9), "ball": at(SOMEWHERE, hour_ahead, 10**9)},
        "jumps by 3600.0",
        place_of(SOMEWHERE),
    ),
    "millimetres": ({"ball": everywhere(in_millimetres)}, "are these millimetres?", None),
    "false_detection": (
        {"ball": at(SOMEWHERE, elsewhere)},
        "the ball jumps by 2.",
        place_of(SOMEWHERE, "/ball/position"),
    ),
    "rises": ({"ball": everywhere(rises)}, "the ball", None),
    "hovers": ({"ball": at(100, hovers, 10**9)}, "ball", None),
    "nowhere": (
        {"ball": at(SOMEWHERE, nowhere)},
        "is not finite",
        place_of(SOMEWHERE, "/ball/position"),
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_is_refused_with_its_place(tmp_path: Path, name: str) -> None:
    edits, words, place_s = REFUSED[name]
    one = only(write_edited(tmp_path / f"{LABEL}_001", **edits))
    assert one.strokes == 0
    assert one.refused is not None
    assert words in one.refused
    assert "\n" not in one.refused
    if place_s is not None:
        assert f"at {place_s:.2f} s" in one.refused


def test_joints_in_another_order_are_refused(tmp_path: Path) -> None:
    """Two whose change leaves the paddle nearly where it was make no difference."""
    accepted = []
    for first, second in combinations(range(7), 2):

        def swap(message: Any, _: int, one: int = first, other: int = second) -> Any:
            message.name[one], message.name[other] = message.name[other], message.name[one]
            return message

        bag = write_edited(tmp_path / f"{LABEL}_{first}{second}0", joint_states=swap)
        if not only(bag).refused:
            accepted.append((first, second))
    assert len(accepted) <= 4, accepted


def test_a_bag_of_another_arm_says_so_or_which_joints_are_missing(capsys: pytest.CaptureFixture[str]) -> None:
    # Bags of 0.1.0 do not say which arm was led.
    for bag, said in ((EARLIER, "shoulder_pan_joint"), (shipped(), "sawyer, not ur10e")):
        assert main(["check", str(bag), "--robot", "ur10e", "--json"]) == 1
        captured = capsys.readouterr()
        (one,) = json.loads(captured.out)
        assert said in one["refused"]
        assert "--robot" in one["refused"]


def test_all_reasons_are_told(tmp_path: Path) -> None:
    path = write_edited(
        tmp_path / f"{LABEL}_001",
        joint_states=at(SOMEWHERE, reads_ten),
        ball=at(SOMEWHERE, elsewhere),
    )
    refused = only(path).refused
    assert refused is not None
    assert "beyond its limit" in refused
    assert "the ball jumps" in refused


# -- the command --------------------------------------------------------------------------------------------


def test_a_folder_is_told_bag_by_bag(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    good = tmp_path / "b" / f"{LABEL}_001"
    shutil.copytree(shipped(), good)
    write_edited(tmp_path / "a" / f"{LABEL}_002", joint_states=everywhere(degrees))
    write_mcap(tmp_path / "c.mcap", messages_of())
    assert main(["check", str(tmp_path), "--json"]) == 1
    captured = capsys.readouterr()
    assert captured.err == ""
    told = json.loads(captured.out)
    assert [(one["bag"], one["strokes"]) for one in told] == [
        (f"a/{LABEL}_002", 0),
        (f"b/{LABEL}_001", 1),
        ("c.mcap", 1),
    ]
    assert [set(one) for one in told] == [{"bag", "strokes", "refused", "notes"}] * 3
    assert "degrees" in told[0]["refused"]
    assert told[1]["refused"] is None
    assert main(["check", str(tmp_path)]) == 1
    text = capsys.readouterr().out
    assert "3 bags, 2 strokes accepted, 1 bags refused" in text
    assert main(["check", str(good), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == [{"bag": ".", "strokes": 1, "refused": None, "notes": []}]


def test_wrong_calls_and_empty_folders(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", str(tmp_path), "--json"]) == 1
    assert json.loads(capsys.readouterr().out) == []
    (tmp_path / "text").touch()
    for arguments in (
        [str(tmp_path / "nowhere")],
        [str(tmp_path / "text")],
        [str(tmp_path), "--robot", "nobody"],
        [str(tmp_path), "--topics", "joints"],
    ):
        assert main(["check", *arguments, "--json"]) == 2
        captured = capsys.readouterr()
        assert captured.out == ""
        assert captured.err.startswith("check: error: ")
    with pytest.raises(SystemExit) as ended:
        main(["chek"])
    assert ended.value.code == 2


def test_a_session_tells_of_each_of_its_strokes(tmp_path: Path) -> None:
    session = []
    for number, edits in enumerate([{}, {"joint_states": at(SOMEWHERE, reads_ten)}, {}]):
        shift_ns = number * 10_000_000_000

        def later(message: Any, _: int, shift_ns: int = shift_ns) -> Any:
            message.header.stamp.sec += shift_ns // 1_000_000_000
            return message

        stroke = edited(edited(messages_of(), edits), {"joint_states": later, "ball/position": later})
        session += [message._replace(log_time_ns=message.log_time_ns + shift_ns) for message in stroke]
    one = only(write(tmp_path / "session", session))
    assert one.strokes == 2
    assert one.refused is not None
    assert f"at {10.0 + place_of(SOMEWHERE):.2f} s joint right_j3 is at 10 rad" in one.refused


def test_topics_of_other_names_are_said_as_the_error_says(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    renamed = {"/joint_states": "/arm/joints"}
    messages = [m._replace(topic=renamed.get(m.topic, m.topic)) for m in messages_of()]
    path = tmp_path / f"{LABEL}_001"
    topics = dict.fromkeys(renamed.values(), "sensor_msgs/msg/JointState")
    write(path, messages, topics)
    assert main(["check", str(path), "--json"]) == 1
    (one,) = json.loads(capsys.readouterr().out)
    assert "--topics joint_states:=NAME" in one["refused"]
    assert main(["check", str(path), "--json", "--topics", "joint_states:=/arm/joints"]) == 0

"""Joint states that others share, that start empty, and that come without velocities."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from sensor_msgs.msg import JointState

from msrd_ros.contract.joint_states import JointStateTranslator
from msrd_ros.contract.translation import EpisodeAssembler
from msrd_ros.core.errors import UserError
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS
from sawyer import JOINT_NAMES, ROBOT

MS = 1_000_000


def joint_state(names: Any = JOINT_NAMES, time_ms: float = 0.0, **fields: list[float]) -> JointState:
    values = [0.1 * index for index in range(len(names))]
    message = JointState(name=list(names), **{"position": values, "velocity": values, **fields})
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(round(time_ms * MS), 10**9)
    return message


GRIPPER = joint_state(["gripper_finger"])
EMPTY = joint_state([])


@pytest.fixture
def translator() -> JointStateTranslator:
    return JointStateTranslator(ROBOT, "topic joint_states")


def test_other_devices_messages_are_passed_over_counted_and_said_once(
    translator: JointStateTranslator,
) -> None:
    assert translator.sample(EMPTY) is None
    for _ in range(3):
        assert translator.sample(GRIPPER) is None
        sample = translator.sample(joint_state())
        assert sample is not None
        np.testing.assert_allclose(sample.position, 0.1 * np.arange(7))
    assert translator.passed_over == 4
    empty, gripper = translator.news()
    assert "topic joint_states: messages with no joints are passed over" in empty
    assert "gripper_finger" in gripper
    assert "right_j0, right_j1" in gripper
    assert translator.news() == []
    assert translator.remarks()[1] == f"{gripper} (3 messages)"


def test_part_of_the_arm_is_none_of_it(translator: JointStateTranslator) -> None:
    assert translator.sample(joint_state(JOINT_NAMES[:6])) is None
    with pytest.raises(UserError, match=r"joint right_j6 is missing \(there is right_j0, right_j1"):
        translator.read(joint_state(JOINT_NAMES[:6]))


@pytest.mark.parametrize("velocity", [[], [np.nan] * 7])
def test_velocities_that_are_not_told_follow_from_positions_and_stamps(
    translator: JointStateTranslator, velocity: list[float]
) -> None:
    assert translator.sample(joint_state(time_ms=0, position=[1.0] * 7, velocity=velocity)) is None
    sample = translator.sample(joint_state(time_ms=20, position=[1.01] * 7, velocity=velocity))
    assert sample is not None
    np.testing.assert_allclose(sample.velocity, 0.5)
    # A message that comes again tells nothing new.
    assert translator.sample(joint_state(time_ms=20, position=[1.01] * 7, velocity=velocity)) is None
    assert translator.derived == 1
    (said,) = translator.news()
    assert "no velocities; they are taken from positions and stamps" in said


def test_positions_too_far_apart_say_how_dense_they_must_be(translator: JointStateTranslator) -> None:
    translator.sample(joint_state(time_ms=0, velocity=[]))
    with pytest.raises(UserError, match=r"positions 0\.1 s apart are too sparse .* 22 Hz or more"):
        translator.sample(joint_state(time_ms=100, velocity=[]))
    with_velocities = JointStateTranslator(ROBOT)
    assert all(with_velocities.sample(joint_state(time_ms=time)) for time in (0, 100))


def test_one_message_without_velocities_is_bridged_from_the_last(translator: JointStateTranslator) -> None:
    translator.sample(joint_state(time_ms=0, position=[1.0] * 7))
    sample = translator.sample(joint_state(time_ms=10, position=[1.01] * 7, velocity=[]))
    assert sample is not None
    np.testing.assert_allclose(sample.velocity, 1.0)


def test_time_may_be_another_than_the_stamp(translator: JointStateTranslator) -> None:
    translator.sample(joint_state(position=[1.0] * 7, velocity=[]), 0)
    sample = translator.sample(joint_state(position=[1.02] * 7, velocity=[]), 20 * MS)
    assert sample is not None
    np.testing.assert_allclose(sample.velocity, 1.0)


@pytest.mark.parametrize(
    ("message", "words"),
    [
        (joint_state([*JOINT_NAMES, "right_j0"]), "joint right_j0 is named twice"),
        (joint_state(position=[0.0] * 8), "8 position values for 7 joints"),
        (joint_state(velocity=[0.0] * 3), "3 velocity values for 7 joints"),
        (joint_state(velocity=[0.0] * 6 + [np.nan]), "velocity of joint right_j6 is not finite"),
        (joint_state(position=[np.nan] * 7, velocity=[]), "position of joint right_j0 is not finite"),
    ],
)
def test_what_is_neither_empty_nor_whole_is_refused(
    translator: JointStateTranslator, message: JointState, words: str
) -> None:
    with pytest.raises(UserError, match=f"topic joint_states: .*{words}"):
        translator.sample(message)


def test_new_names_without_end_do_not_fill_the_memory(translator: JointStateTranslator) -> None:
    for number in range(1000):
        assert translator.sample(joint_state([f"finger_{number}" * 1000, "line\nbreak"])) is None
    assert translator.passed_over == 1000
    assert len(translator.remarks()) < 20
    assert all(len(line) < 500 and "\n" not in line for line in translator.remarks())


def test_a_stroke_is_assembled_among_another_devices_messages() -> None:
    plain, shared = EpisodeAssembler(ALL_LABELS[0], robot=ROBOT), EpisodeAssembler(ALL_LABELS[0], robot=ROBOT)
    shared.add_joint_state(EMPTY)
    for step in range(100):
        message = joint_state(time_ms=20 * step, position=[0.01 * step] * 7, velocity=[0.5] * 7)
        for assembler in (plain, shared):
            assembler.add_joint_state(message)
            assembler.add_ball(20 * MS * step, np.array([1.5 - 0.1 * step, 0.0, 1.0]))
        shared.add_joint_state(GRIPPER)
    np.testing.assert_array_equal(shared.assemble().observations, plain.assemble().observations)

"""Bags as learners want them: episodes sampled at the control rate, through the one translation."""

from __future__ import annotations

from collections.abc import Iterable

from msrd_ros.bags.reader import Bag
from msrd_ros.bags.schemas import deserialise
from msrd_ros.bags.stroke_buffer import split_strokes
from msrd_ros.bags.strokes import CutSettings
from msrd_ros.contract.episode import Episode
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.contract.topics import BALL_POSITION, CONTRACT, JOINT_STATES, OUTCOME, BagMessage
from msrd_ros.contract.translation import EpisodeAssembler
from msrd_ros.core.errors import UserError
from msrd_ros.recordings.inspection import InspectionLimits, inspect
from msrd_ros.robots.loading import default_robot
from msrd_ros.robots.robot import Robot

ROBOT_KEY = "robot"
"""In a bag's `custom_data`: `Robot.identity` of the arm that was led. 0.1.0 and others do not say."""


def read_episodes(bag: Bag, robot: Robot | None = None) -> list[Episode]:
    """The strokes of a bag as arrays, of an arm (the default one if None).

    A bag of one stroke gives one episode. A longer recording, as `ros2 bag record` makes it, is cut at its
    outcomes, and its strokes pass the inspection that the recorder makes; those that fail are left out.

    Raises
    ------
    UserError
        If the bag cannot be read, is of another robot or does not hold what a stroke needs; names the bag.
    """
    original = bag.raw()
    subject, source = bag.info.subject, f"bag {bag.info.path}"
    arm = robot or default_robot()
    if ROBOT_KEY in bag.info.custom_data:
        arm.require(bag.info.custom_data[ROBOT_KEY], source)
    labels = bag.labels(original)
    messages = [message._replace(topic=bag.role(message.topic)) for message in original]
    if sum(message.topic == OUTCOME for message in messages) > 1:
        return [
            assemble_stroke(stroke.messages, stroke.label, subject, source, arm)
            for stroke in split_strokes(messages, CutSettings())
            if stroke.label and inspect(stroke, arm, InspectionLimits()).accepted
        ]
    if len(labels) > 1:
        names = ", ".join(sorted(str(label) for label in labels))
        raise UserError(
            f"bag {bag.info.path}: shows several strategies ({names}) and no rally/outcome to part them; "
            f"record rally/outcome too, or one bag a stroke"
        )
    return [assemble_stroke(messages, next(iter(labels)), subject, source, arm)]


def assemble_stroke(
    messages: Iterable[BagMessage],
    label: StrategyLabel,
    subject: str,
    source: str,
    robot: Robot | None = None,
) -> Episode:
    """One stroke as arrays.

    Parameters
    ----------
    messages
        Topics are relative names; other topics than the stroke's own are passed over.
    label, subject
        What was shown, and by whom.
    source
        What to blame in errors.
    robot
        Whose joints; the default arm's if None.

    Raises
    ------
    UserError
        If the messages do not make up a stroke.
    """
    assembler = EpisodeAssembler(label, subject, source, robot)
    for message in messages:
        if message.topic == JOINT_STATES:
            assembler.add_joint_state(deserialise(message.data, CONTRACT[JOINT_STATES].type_name))
        elif message.topic == BALL_POSITION:
            assembler.add_ball_position(deserialise(message.data, CONTRACT[BALL_POSITION].type_name))
        elif message.topic == OUTCOME:
            assembler.add_outcome(deserialise(message.data, CONTRACT[OUTCOME].type_name))
    return assembler.assemble()

"""Bags as learners want them: inspected, and sampled at the control rate through the one translation."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

from msrd_ros.bags.devices import ArmMessages
from msrd_ros.bags.info import BagInfo
from msrd_ros.bags.reader import Bag
from msrd_ros.bags.stroke_buffer import split_strokes
from msrd_ros.bags.strokes import CutSettings, Stroke, whole_stroke
from msrd_ros.contract.episode import Episode
from msrd_ros.contract.labels import WITHOUT_LABEL, say_label
from msrd_ros.contract.topics import OUTCOME, BagMessage
from msrd_ros.core.errors import UserError
from msrd_ros.recordings.inspection import Origin, judge
from msrd_ros.recordings.limits import InspectionLimits
from msrd_ros.recordings.verdict import Refusal, Verdict
from msrd_ros.robots.loading import default_robot
from msrd_ros.robots.robot import Robot

ROBOT_KEY = "robot"
"""In a bag's `custom_data`: `Robot.identity` of the arm that was led. 0.1.0 and others do not say."""


@dataclass(frozen=True)
class BagReading:
    """What a bag gives to learn from.

    Attributes
    ----------
    info
        Which bag.
    episodes
        Its accepted strokes.
    refused
        One line for every stroke that is not, or for the whole bag: all reasons, with their places in s from
        the bag's start.
    notes
        What is no fault, but should be known.
    """

    info: BagInfo
    episodes: tuple[Episode, ...] = ()
    refused: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


def read_bag(
    bag: Bag, robot: Robot | None = None, demonstrations_only: bool = True, unlabelled: bool = False
) -> BagReading:
    """Inspect the strokes of a bag of an arm (the default one if None), and read those that are accepted.

    A longer recording, as `ros2 bag record` makes it, is cut at its outcomes.

    Parameters
    ----------
    bag, robot
        What is read, and whose joints.
    demonstrations_only
        Refuse a bag of one stroke whose ball was not returned, or that its recorder refused.
    unlabelled
        Read strokes without a label as well, with None for it; else they are refused.

    Raises
    ------
    UserError
        If the bag cannot be read, or is of another robot; names the bag.
    """
    arm, info = robot or default_robot(), bag.info
    strokes, origin, remarks = cut_bag(bag, arm)
    if not demonstrations_only and len(strokes) == 1:
        strokes = [replace(stroke, outcome=None) for stroke in strokes]
    elif not info.kept:
        return BagReading(info, refused=(f"its recorder refused it: {info.custom_data.get('reason', '?')}",))
    limits = InspectionLimits.of(info.custom_data)
    episodes, refused = [], []
    notes = dict.fromkeys(remarks)
    for stroke in strokes:
        verdict, episode = judge(stroke, arm, limits, origin)
        notes.update(dict.fromkeys(verdict.notes))
        if episode is not None and episode.label is None and not unlabelled:
            verdict, episode = Verdict(Refusal.NO_LABEL, WITHOUT_LABEL), None
        if episode is not None:
            episodes.append(episode)
            continue
        which = f"ball {stroke.ball_id or '?'} ({say_label(stroke.label)}): " if len(strokes) > 1 else ""
        refused.append(f"{which}{verdict.reason}, {verdict.detail}")
    if any(stroke.outcome is None for stroke in strokes):
        notes[f"no {OUTCOME}: whether the ball came back is not known"] = None
    for name, setting in limits.settings().items():
        notes[f"inspected with {name} {setting}, as its recorder was set"] = None
    return BagReading(info, tuple(episodes), tuple(refused), tuple(notes))


class CutBag(NamedTuple):
    """The strokes of a bag, not yet inspected.

    Attributes
    ----------
    strokes
        In their order; one recording of one ball is one stroke.
    origin
        What to inspect them with.
    remarks
        What was passed over.
    """

    strokes: list[Stroke]
    origin: Origin
    remarks: list[str]


def cut_bag(bag: Bag, robot: Robot) -> CutBag:
    """Cut a bag of an arm at its outcomes.

    Raises
    ------
    UserError
        If the bag cannot be read, or is of another robot; names the bag.
    """
    original = bag.raw()
    info, source = bag.info, f"bag {bag.info.path}"
    if ROBOT_KEY in info.custom_data:
        robot.require(info.custom_data[ROBOT_KEY], source)
    is_arms = ArmMessages(robot)
    messages = [message._replace(topic=bag.role(message.topic)) for message in original]
    strokes = _strokes(bag, original, messages, is_arms)
    origin = Origin(info.subject, source, original[0].log_time_ns if original else 0)
    return CutBag(strokes, origin, is_arms.remarks())


def read_bags(
    infos: Iterable[BagInfo],
    robot: Robot | None = None,
    names: Mapping[str, str] | None = None,
    unlabelled: bool = False,
) -> Iterator[BagReading]:
    """The same of many bags; one that cannot be read is refused like any other, and does not end the work.

    Parameters
    ----------
    infos
        Which bags, as `BagLibrary.select` gives them.
    robot
        The arm that was led; the default one if None.
    names
        Full topic name in the bags by relative name, where it is neither at the root nor unmistakable.
    unlabelled
        Read strokes without a label as well, with None for it; else they are refused.
    """
    for info in infos:
        try:
            yield read_bag(Bag(info.path, names), robot, unlabelled=unlabelled)
        except UserError as error:
            yield BagReading(info, refused=(str(error).removeprefix(f"bag {info.path}: "),))


def read_episodes(bag: Bag, robot: Robot | None = None, demonstrations_only: bool = False) -> list[Episode]:
    """The accepted strokes of a bag as arrays, of an arm (the default one if None), labelled or not.

    A bag of one stroke may be of a ball that was not returned: it is no demonstration, but can be looked at.
    With `demonstrations_only` it is refused, as by `read_bag`.

    Raises
    ------
    UserError
        If the bag cannot be read, is of another robot, or none of its strokes is accepted; names the bag and
        says why.
    """
    reading = read_bag(bag, robot, demonstrations_only, unlabelled=True)
    if not reading.episodes:
        raise UserError(f"bag {bag.info.path}: {'; '.join(reading.refused) or 'holds no stroke'}")
    return list(reading.episodes)


def _strokes(
    bag: Bag, original: list[BagMessage], messages: list[BagMessage], is_arms: ArmMessages
) -> list[Stroke]:
    labels = bag.labels(original)
    if sum(message.topic == OUTCOME for message in messages) > 1:
        # What the bag itself states holds for all that do not say anything else.
        return [
            replace(stroke, label=stroke.label or bag.info.label)
            for stroke in split_strokes(messages, CutSettings(), is_arms)
        ]
    if len(labels) > 1:
        names = ", ".join(sorted(str(label) for label in labels))
        raise UserError(
            f"bag {bag.info.path}: shows several strategies ({names}) and no rally/outcome to part them; "
            f"record rally/outcome too, or one bag a stroke"
        )
    return [whole_stroke(messages, next(iter(labels), None), is_arms)]

"""What an edit changes in a bag's messages, and whether what is left is a stroke."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from msrd_ros.bags.cdr import read_frame_id
from msrd_ros.bags.reader import Bag
from msrd_ros.bags.rewriting import Change
from msrd_ros.bags.schemas import with_frame
from msrd_ros.contract.interface import TOPICS
from msrd_ros.contract.topics import FEED, JOINT_STATES, LATCHED_TOPICS, OUTCOME, STRATEGY, BagMessage
from msrd_ros.core.errors import UserError
from msrd_ros.recordings.episodes import read_bag
from msrd_ros.robots.robot import Robot

_LABELLED = (JOINT_STATES, STRATEGY, OUTCOME, "joint_command", "recorder/verdict")
"""Topics whose `header.frame_id` is the label, where it is one."""
_EARLIER = (*LATCHED_TOPICS, FEED)
"""Topics of which what was said before a stroke's beginning still counts."""


def relabelling(bag: Bag, old: str, new: str) -> Change:
    """Another label wherever the old one stands, empty for none; any other text is a driver's frame."""
    types = bag.info.types
    labelled = {
        topic
        for topic, kind in types.items()
        for name in _LABELLED
        if kind == TOPICS[name].type_name and (bag.role(topic) == name or topic.endswith(f"/{name}"))
    }

    def change(message: BagMessage) -> BagMessage:
        if message.topic not in labelled or read_frame_id(message.data) != old:
            return message
        return message._replace(data=with_frame(message.data, types[message.topic], new))

    return change


def trimming(bag: Bag, begin_ns: int, end_ns: int) -> Change:
    """Log times from `begin_ns` to `end_ns`; what was said before and still counts moves to the beginning."""

    def change(message: BagMessage) -> BagMessage | None:
        if message.log_time_ns > end_ns:
            return None
        if message.log_time_ns >= begin_ns:
            return message
        return message._replace(log_time_ns=begin_ns) if bag.role(message.topic) in _EARLIER else None

    return change


def require_stroke(
    trimmed: Path, original: Bag, robot: Robot | None = None, names: Mapping[str, str] | None = None
) -> None:
    """Refuse what is left of a bag if it is no stroke any more.

    Parameters
    ----------
    trimmed
        Directory of what is left.
    original
        The bag that was trimmed, for errors.
    robot
        The arm that was led; the default one if None.
    names
        Full topic name in the bags by relative name, where it is neither at the root nor unmistakable.

    Raises
    ------
    UserError
        Says what the inspection finds.
    """
    where = f"bag {original.info.path}: cut so, it would be no stroke"
    try:
        bag = Bag(trimmed, names)
        if OUTCOME in original.topics and not any(
            bag.role(message.topic) == OUTCOME for message in bag.raw()
        ):
            raise UserError(f"{where}: its {OUTCOME} would be cut off; end later")
        reading = read_bag(bag, robot, demonstrations_only=False, unlabelled=True)
    except UserError as error:
        raise UserError(str(error).replace(str(trimmed), str(original.info.path))) from None
    if not reading.episodes:
        raise UserError(f"{where}: {'; '.join(reading.refused)}; leave more of it")

"""Reading any rosbag2 bag that carries the contract's topics, whoever recorded it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from rosbags.rosbag2 import Reader

from msrd_ros.bags.cdr import read_frame_id
from msrd_ros.bags.info import BagInfo, read_info
from msrd_ros.bags.lone_mcap import bag_message, read_mcap_messages, repair_command
from msrd_ros.bags.schemas import deserialise
from msrd_ros.contract.labels import StrategyLabel, say_label
from msrd_ros.contract.topics import (
    BALL_POSITION,
    CONTRACT,
    JOINT_STATES,
    OUTCOME,
    STRATEGY,
    BagMessage,
    find_topics,
    say_topic,
)
from msrd_ros.core.errors import UserError

_NEEDED = (JOINT_STATES, BALL_POSITION)
_LABELLED = (STRATEGY, OUTCOME)
"""Joint states carry labels as well, but only repeat what these say: any other name is a driver's frame."""


class BagEntry(NamedTuple):
    """A message of a bag.

    Attributes
    ----------
    topic
        Relative name of the contract (``joint_states``), or the full name of any other topic.
    message
        With the field names of its ROS type.
    log_time_ns
        When it was recorded.
    """

    topic: str
    message: Any
    log_time_ns: int


class Bag:
    """A bag whose metadata is sound; its messages are read, and checked, when they are asked for.

    Parameters
    ----------
    path
        The bag's directory, or an MCAP file.
    names
        Full topic name in the bag by relative name, where it is neither at the root nor unmistakable.

    Raises
    ------
    UserError
        If it is no sound bag, lacks a topic that a stroke needs, or its name and metadata disagree.
    """

    def __init__(self, path: Path | str, names: Mapping[str, str] | None = None) -> None:
        self.info: BagInfo = read_info(Path(path))
        self.topics: dict[str, str] = find_topics(self.info.types, names or {}, f"bag {path}")
        self._roles = {name: role for role, name in self.topics.items()}
        missing = [role for role in _NEEDED if role not in self.topics]
        if missing:
            raise UserError(
                f"bag {path}: has no topic {' and no '.join(missing)} (it has "
                f"{', '.join(sorted(self.info.types)) or 'none'}); record it, or {say_topic(missing[0])}"
            )

    def raw(self) -> list[BagMessage]:
        """All messages as they were sent, in the order of their log times; labels are checked.

        Raises
        ------
        UserError
            If the files are damaged, or labels in the headers are ill-formed or contradict the bag.
        """
        where = f"bag {self.info.path}"
        try:
            messages = list(_read_storage(self.info))
        except Exception as error:  # a damaged file makes the storage readers stumble in many ways
            reason = (str(error).splitlines() or [""])[0]
            raise UserError(
                f"{where}: is cut off or damaged ({type(error).__name__}: {reason}); {self._how_to_mend()}"
            ) from None
        if len(messages) < self.info.message_count:
            raise UserError(
                f"{where}: holds {len(messages)} of the {self.info.message_count} messages that its metadata "
                f"tells of; {self._how_to_mend()}"
            )
        self.labels(messages)
        return messages

    def _how_to_mend(self) -> str:
        if self.info.storage == "mcap" and not self.info.packed:
            return f"recover what is there with: {repair_command(self.info.path)}"
        return "copy it again or leave it out"

    def entries(self) -> Iterator[BagEntry]:
        """The messages of the contract's topics, in the order of their log times.

        Raises
        ------
        UserError
            As `raw`, before the first message.
        """
        for message in self.raw():
            role = self._roles.get(message.topic)
            if role is not None:
                content = deserialise(message.data, CONTRACT[role].type_name)
                yield BagEntry(role, content, message.log_time_ns)

    def role(self, topic: str) -> str:
        """Relative name of the contract for a full topic name; the full name itself for any other topic."""
        return self._roles.get(topic, topic)

    def labels(self, messages: Iterable[BagMessage]) -> set[StrategyLabel]:
        """All strategies that messages from `raw`, the metadata and the name tell of; none: it has no label.

        Raises
        ------
        UserError
            If a label is no well-formed name, or one contradicts the bag's metadata or name.
        """
        where = f"bag {self.info.path}"
        stated = self.info.label
        labelled = {self.topics[role]: role for role in _LABELLED if role in self.topics}
        seen = {
            (labelled[message.topic], _frame_id(message, where))
            for message in messages
            if message.topic in labelled
        }
        found = set() if stated is None else {stated}
        for role, text in sorted(seen):
            if not text:
                continue
            label = StrategyLabel.parse(text, f"{where}: topic {self.topics[role]}")
            if label != stated and (stated is not None or self.info.unlabelled):
                raise UserError(
                    f"{where}: topic {self.topics[role]} says {label}, the bag's metadata or name "
                    f"{say_label(stated)}; "
                    f"correct them or leave the bag out"
                )
            found.add(label)
        return found


def _frame_id(message: BagMessage, where: str) -> str:
    try:
        return read_frame_id(message.data)
    except ValueError as error:
        raise UserError(
            f"{where}: topic {message.topic}: a message is not readable ({error}); record it again"
        ) from None


def _read_storage(info: BagInfo) -> Iterator[BagMessage]:
    """All messages, in the order of their log times."""
    if info.storage == "mcap" and not info.packed:
        # mcap's reader also knows send times and sequence numbers, checks sums, and opens faster.
        for name in info.files:
            with (info.folder / name).open("rb") as stream:
                for _, channel, message in read_mcap_messages(stream):
                    yield bag_message(channel, message)
        return
    with Reader(info.path) as reader:
        for connection, time_ns, data in reader.messages():
            yield BagMessage(connection.topic, bytes(data), time_ns, time_ns)

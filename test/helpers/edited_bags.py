"""Bags as others record them: one of the package's own with its messages changed."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from mcap.writer import Writer

from msrd_ros.bags.reader import Bag
from msrd_ros.bags.schemas import describe_type, deserialise, serialise
from msrd_ros.bags.writer import write_bag
from msrd_ros.contract.topics import CONTRACT, BagMessage, BagTopic
from msrd_ros.core.resources import shipped_bags

LABEL = "forehand-push"

Edit = Callable[[Any, int], Any]
"""Takes a message and its number on its topic; gives the changed message, or None to leave it out."""


def shipped() -> Path:
    """The bag that is changed."""
    return shipped_bags() / "subject_01" / f"{LABEL}_001"


def messages_of(path: Path | None = None) -> list[BagMessage]:
    """Its messages, on full topic names."""
    return Bag(path or shipped()).raw()


def edited(messages: Iterable[BagMessage], edits: dict[str, Edit]) -> list[BagMessage]:
    """The messages with those of some topics, by relative name, changed."""
    found = []
    numbers = dict.fromkeys(edits, 0)
    for message in messages:
        role = message.topic.lstrip("/")
        if role in edits:
            content = deserialise(message.data, CONTRACT[role].type_name)
            if role == "joint_states":
                # What is read lies in the message's own bytes.
                content.position, content.velocity = content.position.copy(), content.velocity.copy()
            content = edits[role](content, numbers[role])
            numbers[role] += 1
            if content is None:
                continue
            message = message._replace(data=serialise(content, CONTRACT[role].type_name))
        found.append(message)
    return found


def write(path: Path, messages: list[BagMessage], types: Mapping[str, str] | None = None) -> Path:
    """A rosbag2 directory; `types` are those of topics that are not called as the contract calls them."""
    names = dict.fromkeys(message.topic for message in messages)
    topics = [BagTopic(name, (types or {}).get(name) or _type_of(name)) for name in names]
    write_bag(path, topics, messages, {})
    return path


def write_edited(path: Path, **edits: Edit) -> Path:
    """The shipped bag with changed `joint_states` and `ball` positions."""
    roles = {"joint_states": "joint_states", "ball": "ball/position"}
    return write(path, edited(messages_of(), {roles[name]: edit for name, edit in edits.items()}))


def write_mcap(file: Path, messages: list[BagMessage], summary: bool = True) -> Path:
    """A single MCAP file, as tools beside rosbag2 write it."""
    file.parent.mkdir(parents=True, exist_ok=True)
    with file.open("wb") as stream:
        writer = Writer(stream, use_statistics=summary, use_summary_offsets=summary, use_chunking=summary)
        writer.start("ros2", "test")
        channels: dict[str, int] = {}
        for message in messages:
            if message.topic not in channels:
                kind = _type_of(message.topic)
                schema = writer.register_schema(kind, "ros2msg", describe_type(kind)[0])
                channels[message.topic] = writer.register_channel(message.topic, "cdr", schema)
            writer.add_message(
                channels[message.topic], message.log_time_ns, message.data, message.publish_time_ns
            )
        writer.finish()
    return file


def _type_of(topic: str) -> str:
    return CONTRACT[topic if topic in CONTRACT else topic.lstrip("/")].type_name

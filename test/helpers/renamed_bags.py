"""Copies of recorded strokes under another strategy's name, as if that had been said while recording."""

from __future__ import annotations

from pathlib import Path

from msrd_ros.bags.reader import Bag
from msrd_ros.bags.schemas import deserialise, serialise
from msrd_ros.bags.writer import keep_stroke
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.contract.topics import CONTRACT, JOINT_STATES, OUTCOME, STRATEGY, BagMessage, BagTopic
from msrd_ros.recordings.library import BagLibrary


def rename_strokes(source: Path, label: str, target: Path, name: str) -> list[Path]:
    """Copy all bags of a label from `source` to `target` under a new name; their directories."""
    bags = [Bag(info.path) for info in BagLibrary.scan(source).select([StrategyLabel.parse(label)])]
    copies = []
    for bag in bags:
        topics = [BagTopic(topic, type_name) for topic, type_name in bag.info.types.items()]
        messages = [_renamed(message, bag.role(message.topic), label, name) for message in bag.raw()]
        facts = {key: value for key, value in bag.info.custom_data.items() if key not in ("label", "subject")}
        copies.append(
            keep_stroke(target, bag.info.subject, StrategyLabel.parse(name), topics, messages, facts)
        )
    return copies


def _renamed(message: BagMessage, role: str, label: str, name: str) -> BagMessage:
    if role not in (STRATEGY, OUTCOME, JOINT_STATES):
        return message
    content = deserialise(message.data, CONTRACT[role].type_name)
    header = content if role == STRATEGY else content.header
    if header.frame_id == label:
        header.frame_id = name
    return message._replace(data=serialise(content, CONTRACT[role].type_name))

"""Folders of bags to edit, and what is in them to the last byte."""

from __future__ import annotations

import shutil
from pathlib import Path

from mcap.writer import Writer

from msrd_ros.bags.metadata import METADATA_FILE, ROOT_KEY, build_metadata, dump_yaml
from msrd_ros.bags.schemas import describe_type
from msrd_ros.contract.topics import BagMessage, BagTopic
from msrd_ros.core.resources import shipped_bags


def copy_of(subject: str, *bags: str, target: Path) -> Path:
    """Some shipped bags of a subject in a folder of their own; the folder."""
    for bag in bags:
        shutil.copytree(shipped_bags() / subject / bag, target / subject / bag)
    return target


def contents(folder: Path) -> dict[str, bytes]:
    """All files below a folder that a library reads, by path."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and not any(part.startswith(".") for part in path.relative_to(folder).parts)
    }


def write_split(path: Path, topics: list[BagTopic], messages: list[BagMessage], parts: int = 2) -> Path:
    """A bag as `ros2 bag record --max-bag-size` splits it: several files, numbered channels in each."""
    path.mkdir(parents=True)
    size = -(-len(messages) // parts)
    names = []
    for number in range(parts):
        names.append(f"{path.name}_{number}.mcap")
        with (path / names[-1]).open("wb") as stream:
            writer = Writer(stream)
            writer.start("ros2", "test")
            channels: dict[str, int] = {}
            for message in messages[number * size : (number + 1) * size]:
                if message.topic not in channels:
                    kind = next(topic.type_name for topic in topics if topic.name == message.topic)
                    schema = writer.register_schema(kind, "ros2msg", describe_type(kind)[0])
                    channels[message.topic] = writer.register_channel(message.topic, "cdr", schema)
                writer.add_message(
                    channels[message.topic], message.log_time_ns, message.data, message.publish_time_ns
                )
            writer.finish()
    metadata = build_metadata(names[0], topics, messages, {})
    metadata["relative_file_paths"] = names
    metadata["files"] = [{**metadata["files"][0], "path": name} for name in names]
    (path / METADATA_FILE).write_text(dump_yaml({ROOT_KEY: metadata}), encoding="utf-8")
    return path

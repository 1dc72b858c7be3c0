"""A bag written anew with some of its messages changed, and all else as it was, whoever recorded it.

Schemas, channels, quality of service, attachments and metadata are taken over as they are, so that also
messages of types that are unknown here stay whole.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path, PurePath
from typing import Any

from mcap.reader import make_reader
from mcap.records import Attachment, Channel, Metadata, Schema
from mcap.writer import IndexType, Writer

from msrd_ros.bags.info import BagInfo, load_metadata
from msrd_ros.bags.lone_mcap import (
    MCAP_SUFFIX,
    METADATA_RECORD,
    bag_message,
    read_mcap_messages,
    repair_command,
)
from msrd_ros.bags.metadata import METADATA_FILE, ROOT_KEY, dump_yaml
from msrd_ros.bags.writer import SUMMARY, appearing
from msrd_ros.contract.topics import BagMessage
from msrd_ros.core.errors import UserError
from msrd_ros.core.files import write_synced

Change = Callable[[BagMessage], BagMessage | None]
"""Takes a message on its full topic name; gives it back, changed or not, or None to leave it out."""


def require_rewritable(info: BagInfo) -> None:
    """Refuse a bag that cannot be written anew: only rosbag2 directories of MCAP files can.

    Raises
    ------
    UserError
        Says what to make of it first.
    """
    where = f"bag {info.path}"
    if info.path.is_file() or not (info.path / METADATA_FILE).is_file():
        raise UserError(
            f"{where}: has no {METADATA_FILE}, and only a rosbag2 directory can be changed; make one of it "
            f"with: {repair_command(info.path)}"
        )
    if info.storage != "mcap" or info.packed:
        stored = f"{info.storage} storage" if info.storage != "mcap" else "compressed files or messages"
        raise UserError(f"{where}: has {stored}; make plain MCAP of it with ros2 bag convert, then change it")


def rewrite_bag(info: BagInfo, target: Path, change: Change, custom_data: Mapping[str, str]) -> None:
    """Write a bag anew as `target`, in one MCAP file, which appears whole or not at all.

    Parameters
    ----------
    info
        The bag; it is left as it is.
    target
        The new bag's directory.
    change
        Applied to every message.
    custom_data
        All of the new bag's.

    Raises
    ------
    UserError
        If the bag cannot be written anew, or nothing of it is left.
    OSError
        If `target` exists or cannot be written; then nothing has appeared.
    """
    require_rewritable(info)
    with appearing(target) as aside:
        copy = _Copy(info)
        copy.read(change)
        if not copy.messages:
            raise UserError(f"bag {info.path}: nothing of it would be left; leave more of it, or discard it")
        name = f"{target.name}_0{MCAP_SUFFIX}"
        root = _described(load_metadata(info.path), name, target.name, copy.messages, custom_data)
        copy.write(aside / name, dump_yaml(root))
        write_synced(aside / METADATA_FILE, dump_yaml({ROOT_KEY: root}).encode())


class _Copy:
    """What the files of a bag hold, and what becomes of it."""

    def __init__(self, info: BagInfo) -> None:
        self._info = info
        self._channels: dict[str, tuple[Channel, Schema | None]] = {}
        self._attachments: list[Attachment] = []
        self._metadata: list[Metadata] = []
        self.messages: list[BagMessage] = []

    def read(self, change: Change) -> None:
        """Take all files, with their messages changed."""
        for name in self._info.files:
            with (self._info.folder / name).open("rb") as stream:
                for schema, channel, message in read_mcap_messages(stream):
                    self._channels.setdefault(channel.topic, (channel, schema))
                    changed = change(bag_message(channel, message))
                    if changed is not None:
                        self.messages.append(changed)
                stream.seek(0)
                reader = make_reader(stream)
                self._attachments += reader.iter_attachments()
                self._metadata += [item for item in reader.iter_metadata() if item.name != METADATA_RECORD]
        self.messages.sort(key=lambda message: message.log_time_ns)

    def write(self, file: Path, metadata: str) -> None:
        """Write one MCAP file."""
        kinds = SUMMARY | IndexType.ATTACHMENT if self._attachments else SUMMARY
        with file.open("xb") as stream:
            writer = Writer(stream, index_types=kinds)
            writer.start(profile="ros2", library="msrd_ros")
            schemas: dict[tuple[str, str, bytes], int] = {}
            numbers: dict[str, int] = {}
            for topic, (channel, schema) in self._channels.items():
                number = 0
                if schema is not None:
                    key = (schema.name, schema.encoding, schema.data)
                    number = schemas.get(key) or writer.register_schema(*key)
                    schemas[key] = number
                numbers[topic] = writer.register_channel(
                    topic, channel.message_encoding, number, channel.metadata
                )
            for message in self.messages:
                writer.add_message(
                    numbers[message.topic],
                    message.log_time_ns,
                    message.data,
                    message.publish_time_ns,
                    message.sequence,
                )
            for item in self._attachments:
                writer.add_attachment(item.create_time, item.log_time, item.name, item.media_type, item.data)
            for record in self._metadata:
                writer.add_metadata(record.name, record.metadata)
            writer.add_metadata(METADATA_RECORD, {"serialized_metadata": metadata})
            writer.finish()
            stream.flush()
            os.fsync(stream.fileno())


def _described(
    root: dict[str, Any],
    file: str,
    folder: str,
    messages: Sequence[BagMessage],
    custom_data: Mapping[str, str],
) -> dict[str, Any]:
    """The metadata with another file and other numbers; of any version, so only what is there is changed."""
    counts = Counter(message.topic for message in messages)
    start_ns, end_ns = messages[0].log_time_ns, messages[-1].log_time_ns
    span = {
        "duration": {"nanoseconds": end_ns - start_ns},
        "starting_time": {"nanoseconds_since_epoch": start_ns},
        "message_count": len(messages),
    }
    # Bags of the first versions hold paths relative to the directory above.
    above = any(PurePath(name).parent.parts for name in root["relative_file_paths"])
    changed = {
        **root,
        **span,
        "topics_with_message_count": [
            {**entry, "message_count": counts[str(entry["topic_metadata"]["name"])]}
            for entry in root["topics_with_message_count"]
        ],
        "relative_file_paths": [f"{folder}/{file}" if above else file],
        "custom_data": dict(custom_data),
    }
    if "files" in root:
        changed["files"] = [{"path": file, **span}]
    return changed

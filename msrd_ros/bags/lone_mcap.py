"""MCAP files without ``metadata.yaml``, as Foxglove and MCAP's own tools write them."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import IO, NamedTuple

import yaml
from mcap.reader import NonSeekingReader, make_reader
from mcap.records import Channel, Message, Schema

from msrd_ros.contract.topics import BagMessage
from msrd_ros.core.errors import UserError

REPAIR_COMMAND = "python -m msrd_ros.bags repair"
MCAP_SUFFIX = ".mcap"
METADATA_RECORD = "rosbag2"
"""Under this name rosbag2 keeps a copy of a bag's metadata within the file."""
MAGIC = b"\x89MCAP0\r\n"
_LFS_POINTER = b"version https://git-lfs"


class McapFacts(NamedTuple):
    """What an MCAP file says without a message being read.

    Attributes
    ----------
    types
        Type name by full topic name.
    message_count, start_ns, end_ns
        Over all topics, by log times.
    custom_data
        Of the metadata that rosbag2 keeps within the file; empty in files of others.
    """

    types: Mapping[str, str]
    message_count: int
    start_ns: int
    end_ns: int
    custom_data: Mapping[str, str]


def repair_command(path: Path) -> str:
    """What to type to recover what is left of a recording."""
    return f"{REPAIR_COMMAND} {shlex.quote(str(path))}"


def read_mcap_facts(file: Path, bag: Path) -> McapFacts:
    """Ask a whole MCAP file for its topics.

    Parameters
    ----------
    file
        The MCAP file.
    bag
        Of which it is part, for errors: the file itself or its directory.

    Raises
    ------
    UserError
        If it cannot be read, is no MCAP file, or is torn or damaged; says which of these, and what to do.
    """
    where = f"bag {bag}"
    try:
        with file.open("rb") as stream:
            _require_whole(stream, where, file, bag)
            return _facts(stream)
    except UserError:
        raise
    except OSError as error:
        link = "leads nowhere; fetch what it points to" if file.is_symlink() else "copy the bag again"
        raise UserError(f"{where}: its file {file.name} cannot be read ({error.strerror}); {link}") from None
    except Exception as error:  # a damaged file makes the reader stumble in many ways
        reason = (str(error).splitlines() or [""])[0]
        raise UserError(
            f"{where}: is damaged ({type(error).__name__}: {reason}); recover what is there with: "
            f"{repair_command(bag)}"
        ) from None


def read_custom_data(text: str) -> dict[str, str]:
    """The `custom_data` of a metadata record within a file; empty where there is none."""
    try:
        custom = yaml.safe_load(text)["custom_data"]
        return {str(key): str(value) for key, value in custom.items()}
    except Exception:  # text from elsewhere; it only adds to what the messages say
        return {}


def _require_whole(stream: IO[bytes], where: str, file: Path, bag: Path) -> None:
    head = stream.read(len(_LFS_POINTER))
    if not head:
        raise UserError(f"{where}: its file {file.name} is empty; copy the bag again or leave it out")
    if head == _LFS_POINTER:
        raise UserError(f"{where}: {file.name} is a pointer of Git LFS, not the file; run: git lfs pull")
    if not head.startswith(MAGIC):
        raise UserError(f"{where}: {file.name} is no MCAP file; copy the bag again or leave it out")
    stream.seek(0, 2)
    if stream.tell() >= 2 * len(MAGIC):
        stream.seek(-len(MAGIC), 2)
        if stream.read() == MAGIC:
            stream.seek(0)
            return
    raise UserError(
        f"{where}: its recording was cut off, the end of {file.name} is missing; recover what is there with: "
        f"{repair_command(bag)}"
    )


def read_mcap_messages(stream: IO[bytes]) -> Iterator[tuple[Schema | None, Channel, Message]]:
    """All messages of an MCAP file, in the order of their log times; sums are checked."""
    reader = make_reader(stream, validate_crcs=True)
    summary = reader.get_summary()
    if summary is None or not summary.channels:
        stream.seek(0)
        reader = NonSeekingReader(stream, validate_crcs=True)
    yield from reader.iter_messages()


def bag_message(channel: Channel, message: Message) -> BagMessage:
    """A record of an MCAP file as a message of a bag."""
    return BagMessage(channel.topic, message.data, message.log_time, message.publish_time, message.sequence)


def _facts(stream: IO[bytes]) -> McapFacts:
    reader = make_reader(stream, validate_crcs=True)
    summary = reader.get_summary()
    if summary is None or summary.statistics is None or not summary.channels:
        return _count(stream)
    told = summary.statistics
    types = {
        channel.topic: summary.schemas[channel.schema_id].name if channel.schema_id else ""
        for channel in summary.channels.values()
    }
    records = [record.metadata for record in reader.iter_metadata() if record.name == METADATA_RECORD]
    custom = read_custom_data(records[-1].get("serialized_metadata", "")) if records else {}
    return McapFacts(types, told.message_count, told.message_start_time, told.message_end_time, custom)


def _count(stream: IO[bytes]) -> McapFacts:
    """Of a file without a summary: read it through."""
    types: dict[str, str] = {}
    times: list[int] = []
    for schema, channel, message in read_mcap_messages(stream):
        types[channel.topic] = schema.name if schema else ""
        times.append(message.log_time)
    return McapFacts(types, len(times), min(times, default=0), max(times, default=0), {})

"""Recovering what is left of an MCAP bag whose recording or copying was cut off."""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import lz4.frame
import yaml
import zstandard

from msrd_ros.bags.lone_mcap import MAGIC, MCAP_SUFFIX
from msrd_ros.bags.metadata import METADATA_FILE, ROOT_KEY, split_name
from msrd_ros.bags.schemas import is_known_type
from msrd_ros.bags.strokes import STATES
from msrd_ros.bags.writer import write_bag
from msrd_ros.contract.topics import CONTRACT, LATCHED_TOPICS, BagMessage, BagTopic
from msrd_ros.core.errors import UserError

_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK = 0x03, 0x04, 0x05, 0x06
_RECORD_HEAD = struct.Struct("<BQ")
_CHUNK_HEAD = struct.Struct("<QQQI")
_MESSAGE_HEAD = struct.Struct("<HIQQ")
_PARTIAL_STEP = 1024
_MOST_LISTED = 10


_LATCHED = tuple(f"/{name.lstrip('/')}" for name in LATCHED_TOPICS)


class _Channel(NamedTuple):
    topic: str
    type_name: str


class Recovery(NamedTuple):
    """What was recovered.

    Attributes
    ----------
    path
        The new bag's directory.
    held
        What the broken bag holds, for a person.
    is_stroke
        Whether it holds what a stroke needs.
    """

    path: Path
    held: str
    is_stroke: bool

    def __str__(self) -> str:
        none = "" if self.is_stroke else f"; none of it is a stroke: it holds {self.held}"
        return f"recovered to {self.path}{none}"


def repair(path: Path, target: Path | None = None) -> Recovery:
    """Recover the messages of a bag that was cut off, and write them as a new bag.

    All records up to the cut are taken, also those of a chunk that is there only in part, as far as its
    compression lets them be unpacked. Topics of types that are not the distribution's own are left out and
    named in `custom_data`. The broken bag is left as it is.

    Parameters
    ----------
    path
        Directory or MCAP file of the broken bag.
    target
        Directory of the new bag; ``<path>_repaired`` when None.

    Raises
    ------
    UserError
        If there is no MCAP file, nothing can be recovered, or the new directory exists.
    """
    files = [path] if path.is_file() else sorted(path.glob(f"*{MCAP_SUFFIX}"))
    if not files:
        raise UserError(
            f"bag {path}: holds no {MCAP_SUFFIX} file, and only such can be recovered; name a bag's directory"
        )
    if target is None:
        name = path.resolve().stem if path.is_file() else path.resolve().name
        target = path.with_name(f"{name}_repaired")
    held: Counter[_Channel] = Counter()
    topics: dict[str, BagTopic] = {}
    messages: list[BagMessage] = []
    left_out: set[str] = set()
    for file in files:
        for channel, message in _recover(_read(file, path)):
            held[channel] += 1
            if is_known_type(channel.type_name):
                topics[channel.topic] = BagTopic(
                    channel.topic, channel.type_name, latched=channel.topic.endswith(_LATCHED)
                )
                messages.append(message)
            else:
                left_out.add(channel.topic)
    listed = _listed(held)
    if not held:
        raise UserError(f"bag {path}: no message can be read in it; it is left as it is, so record it again")
    if not messages:
        raise UserError(
            f"bag {path}: holds {listed}, of types that are not known here: none of it is a stroke; "
            f"it is left as it is"
        )
    messages.sort(key=lambda message: message.log_time_ns)
    custom = {**_custom_data(path), "repaired": "true"}
    if left_out:
        custom["left_out"] = " ".join(sorted(left_out))
    try:
        write_bag(target, list(topics.values()), messages, custom)
    except FileExistsError:
        raise UserError(f"bag {target}: exists already; move it away or name another target") from None
    except OSError as error:
        raise UserError(f"bag {target}: cannot be written ({error.strerror}); name another target") from None
    kinds = {channel.type_name for channel in held}
    return Recovery(target, listed, {CONTRACT[role].type_name for role in STATES} <= kinds)


def _read(file: Path, path: Path) -> bytes:
    try:
        return file.read_bytes()
    except OSError as error:
        raise UserError(f"bag {path}: its file {file.name} cannot be read ({error.strerror})") from None


def _listed(held: Counter[_Channel]) -> str:
    """How many messages of which topics and types."""
    parts = [f"{count} on {channel.topic} ({channel.type_name})" for channel, count in held.most_common()]
    more = f" and {len(parts) - _MOST_LISTED} more topics" if len(parts) > _MOST_LISTED else ""
    return f"{held.total()} messages, {', '.join(parts[:_MOST_LISTED])}{more}"


def _custom_data(path: Path) -> dict[str, str]:
    """What the metadata said, if any is left; else the label that the directory's name tells of."""
    try:
        root = yaml.safe_load((path / METADATA_FILE).read_text(encoding="utf-8"))[ROOT_KEY]
        return {str(key): str(value) for key, value in (root["custom_data"] or {}).items()}
    except Exception:  # damaged text makes the parser stumble in many ways
        named = split_name(path.resolve().name)
        return {"label": named[0]} if named else {}


def _recover(data: bytes) -> Iterator[tuple[_Channel, BagMessage]]:
    if not data.startswith(MAGIC):
        return
    schemas: dict[int, str] = {}
    channels: dict[int, _Channel] = {}
    for opcode, body in _records(data[len(MAGIC) :]):
        records = _records(_unpack_chunk(body)) if opcode == _CHUNK else [(opcode, body)]
        for inner, content in records:
            try:
                if inner == _SCHEMA:
                    schemas[struct.unpack_from("<H", content)[0]] = _text(content, 2)[0]
                elif inner == _CHANNEL:
                    identity, schema = struct.unpack_from("<HH", content)
                    channels[identity] = _Channel(_text(content, 4)[0], schemas.get(schema, ""))
                elif inner == _MESSAGE:
                    identity, sequence, log_ns, publish_ns = _MESSAGE_HEAD.unpack_from(content)
                    channel = channels[identity]
                    payload = content[_MESSAGE_HEAD.size :]
                    yield channel, BagMessage(channel.topic, payload, log_ns, publish_ns, sequence)
            except (struct.error, KeyError, UnicodeDecodeError):
                continue  # a damaged record: the next may be whole


def _records(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Whole records, and a last chunk of which a part is there."""
    offset = 0
    while offset + _RECORD_HEAD.size <= len(data):
        opcode, length = _RECORD_HEAD.unpack_from(data, offset)
        begin = offset + _RECORD_HEAD.size
        if opcode == 0 or (begin + length > len(data) and opcode != _CHUNK):
            return
        yield opcode, data[begin : begin + length]
        offset = begin + length


def _unpack_chunk(body: bytes) -> bytes:
    """The records of a chunk, as many as its compressed data still give."""
    try:
        size = _CHUNK_HEAD.unpack_from(body)[2]
        compression, offset = _text(body, _CHUNK_HEAD.size)
    except (struct.error, UnicodeDecodeError):
        return b""
    packed = body[offset + 8 :]
    if compression == "":
        return packed
    unpacker = (
        lz4.frame.LZ4FrameDecompressor()
        if compression == "lz4"
        else zstandard.ZstdDecompressor().decompressobj()
    )
    records = bytearray()
    # In small steps: what was unpacked before the damage is kept.
    with suppress(zstandard.ZstdError, RuntimeError, EOFError):
        for step in range(0, len(packed), _PARTIAL_STEP):
            records += unpacker.decompress(packed[step : step + _PARTIAL_STEP])
    return bytes(records[:size])


def _text(data: bytes, offset: int) -> tuple[str, int]:
    (length,) = struct.unpack_from("<I", data, offset)
    end = offset + 4 + length
    if end > len(data):
        raise struct.error("text is cut off")
    return data[offset + 4 : end].decode(), end

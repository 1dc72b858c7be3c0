"""Recovering what is left of an MCAP bag whose recording or copying was cut off."""

from __future__ import annotations

import argparse
import struct
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import lz4.frame
import yaml
import zstandard

from msrd_ros.bags.metadata import METADATA_FILE, ROOT_KEY, split_name
from msrd_ros.bags.schemas import is_known_type
from msrd_ros.bags.writer import write_bag
from msrd_ros.contract.topics import CONTRACT, BagMessage, BagTopic
from msrd_ros.core.errors import UserError

_MAGIC = b"\x89MCAP0\r\n"
_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK = 0x03, 0x04, 0x05, 0x06
_RECORD_HEAD = struct.Struct("<BQ")
_CHUNK_HEAD = struct.Struct("<QQQI")
_MESSAGE_HEAD = struct.Struct("<HIQQ")
_PARTIAL_STEP = 1024


_LATCHED = tuple(f"/{facts.name.lstrip('/')}" for facts in CONTRACT.values() if facts.latched)


class _Channel(NamedTuple):
    topic: str
    type_name: str


def repair(path: Path, target: Path | None = None) -> Path:
    """Recover the messages of a bag that was cut off, and write them as a new bag.

    All records up to the cut are taken, also those of a chunk that is there only in part, as far as its
    compression lets them be unpacked. Topics of types that are not the distribution's own are left out and
    named in `custom_data`. The broken bag is left as it is.

    Parameters
    ----------
    path
        Directory of the broken bag.
    target
        Directory of the new bag; ``<path>_repaired`` when None.

    Returns
    -------
    The new bag's directory.

    Raises
    ------
    UserError
        If there is no MCAP file, nothing can be recovered, or the new directory exists.
    """
    files = sorted(path.glob("*.mcap"))
    if not files:
        raise UserError(
            f"bag {path}: holds no .mcap file, so nothing can be recovered; name a bag's directory"
        )
    if target is None:
        target = path.with_name(f"{path.resolve().name}_repaired")
    topics: dict[str, BagTopic] = {}
    messages: list[BagMessage] = []
    left_out: set[str] = set()
    for file in files:
        for channel, message in _recover(file.read_bytes()):
            if is_known_type(channel.type_name):
                topics[channel.topic] = BagTopic(
                    channel.topic, channel.type_name, latched=channel.topic.endswith(_LATCHED)
                )
                messages.append(message)
            else:
                left_out.add(channel.topic)
    if not messages:
        raise UserError(f"bag {path}: no message is left in it; delete it and record it again")
    messages.sort(key=lambda message: message.log_time_ns)
    custom = {**_custom_data(path), "repaired": "true"}
    if left_out:
        custom["left_out"] = " ".join(sorted(left_out))
    try:
        write_bag(target, list(topics.values()), messages, custom)
    except FileExistsError:
        raise UserError(f"bag {target}: exists already; move it away or name another target") from None
    return target


def _custom_data(path: Path) -> dict[str, str]:
    """What the metadata said, if any is left; else the label that the directory's name tells of."""
    try:
        root = yaml.safe_load((path / METADATA_FILE).read_text(encoding="utf-8"))[ROOT_KEY]
        return {str(key): str(value) for key, value in (root["custom_data"] or {}).items()}
    except (OSError, ValueError, KeyError, TypeError, AttributeError, yaml.YAMLError):
        named = split_name(path.resolve().name)
        return {"label": named[0]} if named else {}


def _recover(data: bytes) -> Iterator[tuple[_Channel, BagMessage]]:
    if not data.startswith(_MAGIC):
        return
    schemas: dict[int, str] = {}
    channels: dict[int, _Channel] = {}
    for opcode, body in _records(data[len(_MAGIC) :]):
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


def main(arguments: list[str] | None = None) -> int:
    """``python -m msrd_ros.bags.repair BAG [TARGET]``."""
    parser = argparse.ArgumentParser(prog="repair", description=__doc__)
    parser.add_argument("bag", type=Path, help="directory of the broken bag")
    parser.add_argument(
        "target", type=Path, nargs="?", help="directory of the new bag; BAG_repaired if left out"
    )
    options = parser.parse_args(arguments)
    try:
        print(f"recovered to {repair(options.bag, options.target)}")
    except UserError as error:
        print(f"repair: error: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())

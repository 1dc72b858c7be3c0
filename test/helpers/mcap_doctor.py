"""What MCAP's own doctor checks of a file, for tests: structure, checksums, indexes, summary, statistics."""

from __future__ import annotations

import struct
import zlib
from collections import Counter
from io import BytesIO
from pathlib import Path

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Message,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.stream_reader import StreamReader, get_chunk_data_stream

# Where a record stands, the record, and its length in bytes.
Entry = tuple[int, McapRecord, int]

MAGIC = b"\x89MCAP0\r\n"
FOOTER_LENGTH = 9 + 20 + len(MAGIC)


def examine(path: Path) -> list[str]:
    """Problems of an MCAP file; none if it is sound."""
    data = path.read_bytes()
    if not (data.startswith(MAGIC) and data.endswith(MAGIC)):
        return ["magic missing at the beginning or the end"]
    problems: list[str] = []
    records = _records(data)
    types = [type(record) for _, record, _ in records]
    if types[0] is not Header or types[-1] is not Footer or types.count(DataEnd) != 1:
        problems.append(f"order of records: {[kind.__name__ for kind in types]}")
    header, footer = records[0][1], records[-1][1]
    assert isinstance(header, Header)
    assert isinstance(footer, Footer)
    if header.profile != "ros2" or not header.library:
        problems.append(f"header {header}")
    split = types.index(DataEnd)
    body, summary = records[:split], records[split + 1 : -1]
    problems += _check_chunks(body, summary)
    problems += _check_summary(data, footer, summary, records)
    return problems


def _records(data: bytes) -> list[tuple[int, McapRecord, int]]:
    """Offset, record and length of all top-level records."""
    found = []
    offset = len(MAGIC)
    while offset < len(data) - len(MAGIC):
        length = 9 + struct.unpack_from("<Q", data, offset + 1)[0]
        reader = StreamReader(BytesIO(data[offset : offset + length]), skip_magic=True, emit_chunks=True)
        record = reader._read_record(*_head(reader))
        assert record is not None, f"unknown record at {offset}"
        found.append((offset, record, length))
        offset += length
    return found


def _head(reader: StreamReader) -> tuple[int, int]:
    return reader._stream.read1(), reader._stream.read8()


def _check_chunks(body: list[Entry], summary: list[Entry]) -> list[str]:
    problems: list[str] = []
    schemas: dict[int, Schema] = {}
    channels: dict[int, Channel] = {}
    indexes = {
        record.chunk_start_offset: record for _, record, _ in summary if isinstance(record, ChunkIndex)
    }
    chunks = [(place, record, size) for place, record, size in body if isinstance(record, Chunk)]
    if len(indexes) != len(chunks):
        problems.append(f"{len(chunks)} chunks, {len(indexes)} chunk indexes")
    counts: Counter[int] = Counter()
    times: list[int] = []
    for offset, chunk, length in chunks:
        stream, size = get_chunk_data_stream(chunk, validate_crc=True)
        if not chunk.uncompressed_crc or size != chunk.uncompressed_size or chunk.compression != "zstd":
            problems.append(f"chunk at {offset}: crc, size or compression")
        inner, places = _chunk_records(stream, size)
        messages = [record for record in inner if isinstance(record, Message)]
        for record in inner:
            if isinstance(record, Schema):
                schemas[record.id] = record
                if record.encoding != "ros2msg" or not record.data:
                    problems.append(f"schema {record.name}")
            elif isinstance(record, Channel):
                channels[record.id] = record
                if record.schema_id not in schemas or record.message_encoding != "cdr":
                    problems.append(f"channel {record.topic}")
            elif isinstance(record, Message):
                counts[record.channel_id] += 1
                if record.channel_id not in channels or (times and record.log_time < times[-1]):
                    problems.append(f"message of channel {record.channel_id} at {record.log_time}")
                times.append(record.log_time)
        problems += _check_chunk_index(indexes.get(offset), chunk, offset, length, messages)
        problems += _check_message_indexes(body, offset, length, messages, places)
    listed_channels = {record.id: record for _, record, _ in summary if isinstance(record, Channel)}
    listed_schemas = {record.id: record for _, record, _ in summary if isinstance(record, Schema)}
    if listed_channels != channels or listed_schemas != schemas:
        problems.append("channels or schemas of the summary differ from those of the data")
    statistics = [record for _, record, _ in summary if isinstance(record, Statistics)]
    expected = (sum(counts.values()), min(times), max(times), len(channels), len(schemas), len(chunks))
    for record in statistics:
        told = (
            record.message_count,
            record.message_start_time,
            record.message_end_time,
            record.channel_count,
            record.schema_count,
            record.chunk_count,
        )
        if told != expected or dict(record.channel_message_counts) != dict(counts):
            problems.append(f"statistics {told}, counted {expected}")
    if len(statistics) != 1:
        problems.append(f"{len(statistics)} statistics")
    return problems


def _chunk_records(stream: ReadDataStream, size: int) -> tuple[list[McapRecord], dict[int, Message]]:
    inner: list[McapRecord] = []
    places: dict[int, Message] = {}
    while stream.count < size:
        start = stream.count
        opcode, length = stream.read1(), stream.read8()
        if opcode == Opcode.SCHEMA:
            inner.append(Schema.read(stream))
        elif opcode == Opcode.CHANNEL:
            inner.append(Channel.read(stream))
        else:
            assert opcode == Opcode.MESSAGE, f"record {opcode} in a chunk"
            places[start] = Message.read(stream, length)
            inner.append(places[start])
    return inner, places


def _check_chunk_index(
    index: ChunkIndex | None, chunk: Chunk, offset: int, length: int, messages: list[Message]
) -> list[str]:
    log_times = [message.log_time for message in messages]
    expected = (length, min(log_times), max(log_times), chunk.compression, len(chunk.data))
    if index is None or expected != (
        index.chunk_length,
        index.message_start_time,
        index.message_end_time,
        index.compression,
        index.compressed_size,
    ):
        return [f"chunk index of {offset}: {index}"]
    if (chunk.message_start_time, chunk.message_end_time) != expected[1:3]:
        return [f"times of chunk at {offset}"]
    return []


def _check_message_indexes(
    body: list[Entry], offset: int, length: int, messages: list[Message], places: dict[int, Message]
) -> list[str]:
    indexed = 0
    for place, record, _ in body:
        if isinstance(record, MessageIndex) and place >= offset + length:
            for log_time, start in record.records:
                message = places.get(start)
                indexed += 1
                if message is None or (message.log_time, message.channel_id) != (log_time, record.channel_id):
                    return [f"message index of channel {record.channel_id} points to {start}"]
            if indexed == len(messages):
                break
    return [] if indexed == len(messages) else [f"{indexed} of {len(messages)} messages indexed"]


def _check_summary(data: bytes, footer: Footer, summary: list[Entry], records: list[Entry]) -> list[str]:
    problems: list[str] = []
    if zlib.crc32(data[footer.summary_start : -FOOTER_LENGTH + 9 + 16]) != footer.summary_crc:
        problems.append("summary crc")
    if summary[0][0] != footer.summary_start:
        problems.append("summary start")
    groups: dict[int, tuple[int, int]] = {}
    opcodes = {Schema: 3, Channel: 4, Statistics: 11, ChunkIndex: 8, MetadataIndex: 13}
    for offset, record, length in summary:
        opcode = opcodes.get(type(record))
        if opcode is not None:
            start, total = groups.get(opcode, (offset, 0))
            groups[opcode] = (start, total + length)
    offsets = [(place, record) for place, record, _ in summary if isinstance(record, SummaryOffset)]
    told = {int(record.group_opcode): (record.group_start, record.group_length) for _, record in offsets}
    if told != groups or not offsets or offsets[0][0] != footer.summary_offset_start:
        problems.append(f"summary offsets {told}, groups {groups}")
    metadata = {
        offset: (record, length) for offset, record, length in records if isinstance(record, Metadata)
    }
    for _, record, _ in summary:
        if isinstance(record, MetadataIndex):
            entry = metadata.get(record.offset)
            if entry is None or (entry[0].name, entry[1]) != (record.name, record.length):
                problems.append(f"metadata index {record.name}")
    return problems

"""Writing bags that appear whole or not at all, under names that are never used twice."""

from __future__ import annotations

import os
import re
import secrets
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from mcap.writer import CompressionType, IndexType, Writer

from msrd_ros.bags.metadata import (
    METADATA_FILE,
    ROOT_KEY,
    build_metadata,
    check_subject,
    dump_yaml,
    qos_profiles,
    split_name,
)
from msrd_ros.bags.schemas import describe_type
from msrd_ros.contract.labels import StrategyLabel, say_label
from msrd_ros.contract.topics import BagMessage, BagTopic
from msrd_ros.core.files import make_folder, sync_folder, write_synced

_ASIDE = re.compile(r"\.writing-(?P<pid>\d+)-[0-9a-f]+")
SUMMARY = IndexType.CHUNK | IndexType.MESSAGE | IndexType.METADATA
"""All but attachments: an index without entries would be an error to MCAP's doctor."""


def keep_stroke(
    root: Path,
    subject: str,
    label: StrategyLabel | None,
    topics: Sequence[BagTopic],
    messages: Sequence[BagMessage],
    custom_data: Mapping[str, str],
) -> Path:
    """Write a stroke as ``<root>/<subject>/<label>_<nnn>/`` with the next free number.

    Parameters
    ----------
    label
        None for a stroke without one: empty in the metadata, and ``unlabelled`` in the name.
    topics
        The topics of `messages`, each once.
    messages
        In the order of their log times.
    custom_data
        Further facts for the metadata; label and subject are added here.

    Returns
    -------
    The bag's directory.

    Raises
    ------
    UserError
        If the subject's name is no name.
    OSError
        If it cannot be written; then nothing has appeared.
    """
    folder = root / check_subject(subject)
    custom = {"label": str(label or ""), "subject": subject, **custom_data}
    while True:
        path = folder / f"{say_label(label)}_{next_number(folder, label):03d}"
        try:
            write_bag(path, topics, messages, custom)
        except FileExistsError:
            continue  # another recorder took the number first
        return path


def write_bag(
    path: Path,
    topics: Sequence[BagTopic],
    messages: Sequence[BagMessage],
    custom_data: Mapping[str, str],
) -> None:
    """Write a rosbag2 directory with one MCAP file.

    The directory is built aside, in a hidden directory next to `path`, synced to the disk and renamed: at
    every moment `path` is either absent or whole, even if the process or the machine dies.

    Raises
    ------
    FileExistsError
        If `path` exists; it is left alone.
    OSError
        If it cannot be written; then nothing has appeared.
    """
    with appearing(path) as aside:
        name = f"{path.name}_0.mcap"
        metadata = build_metadata(name, topics, messages, custom_data)
        _write_mcap(aside / name, topics, messages, dump_yaml(metadata))
        write_synced(aside / METADATA_FILE, dump_yaml({ROOT_KEY: metadata}).encode())


@contextmanager
def appearing(path: Path) -> Iterator[Path]:
    """A hidden directory next to `path` to write into, which becomes `path` when all of it is on the disk.

    Raises
    ------
    FileExistsError
        If `path` exists; it is left alone.
    OSError
        If it cannot be written; then nothing has appeared.
    """
    if path.exists():
        raise FileExistsError(f"{path} exists")
    make_folder(path.parent)
    aside = path.parent / f".writing-{os.getpid()}-{secrets.token_hex(4)}"
    aside.mkdir()
    try:
        yield aside
        sync_folder(aside)
        if path.exists():
            raise FileExistsError(f"{path} exists")
        try:
            aside.rename(path)
        except OSError as error:
            # A directory that appeared meanwhile is not empty, so rename refuses to replace it.
            raise (FileExistsError(f"{path} exists") if path.exists() else error) from None
    except BaseException:
        shutil.rmtree(aside, ignore_errors=True)
        raise
    sync_folder(path.parent)


def remove_leftovers(root: Path) -> int:
    """Remove what recorders that were killed had begun; returns how many. None of it was a bag yet."""
    removed = 0
    for folder in [root, *(entry for entry in root.glob("*") if entry.is_dir())]:
        for entry in folder.glob(".writing-*"):
            match = _ASIDE.fullmatch(entry.name)
            if match and not _is_running(int(match["pid"])):
                shutil.rmtree(entry, ignore_errors=True)
                removed += 1
    return removed


def set_aside(root: Path, path: Path) -> Path:
    """Move a bag to ``<root>/.discarded/<subject>/``, where no library looks; returns its new directory."""
    folder = root / ".discarded" / path.parent.name
    make_folder(folder)
    target = folder / path.name
    while target.exists():
        target = folder / f"{path.name}-{secrets.token_hex(4)}"
    path.rename(target)
    sync_folder(path.parent)
    return target


def _is_running(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True


def next_number(folder: Path, label: StrategyLabel | None) -> int:
    """The number of a subject's next bag with this label, or without: above any that lies in its folder."""
    if not folder.is_dir():
        return 1
    split = [split_name(entry.name) for entry in folder.iterdir()]
    return 1 + max((item[1] for item in split if item and item[0] == say_label(label)), default=0)


def _write_mcap(
    file: Path, topics: Sequence[BagTopic], messages: Sequence[BagMessage], metadata: str
) -> None:
    with file.open("xb") as stream:
        writer = Writer(stream, compression=CompressionType.ZSTD, index_types=SUMMARY)
        writer.start(profile="ros2", library="msrd_ros")
        schemas: dict[str, int] = {}
        channels: dict[str, int] = {}
        for topic in topics:
            definition, digest = describe_type(topic.type_name)
            if topic.type_name not in schemas:
                schemas[topic.type_name] = writer.register_schema(topic.type_name, "ros2msg", definition)
            facts = {"offered_qos_profiles": dump_yaml(qos_profiles(topic)), "topic_type_hash": digest}
            channels[topic.name] = writer.register_channel(topic.name, "cdr", schemas[topic.type_name], facts)
        for message in messages:
            writer.add_message(
                channels[message.topic],
                message.log_time_ns,
                message.data,
                message.publish_time_ns,
                message.sequence,
            )
        writer.add_metadata("rosbag2", {"serialized_metadata": metadata})
        writer.finish()
        stream.flush()
        os.fsync(stream.fileno())

"""``metadata.yaml`` of a rosbag2 directory: written as version 9, read in any version."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from msrd_ros.bags.schemas import describe_type
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.contract.topics import BagMessage, BagTopic
from msrd_ros.core.errors import UserError

METADATA_FILE = "metadata.yaml"
ROOT_KEY = "rosbag2_bagfile_information"
VERSION = 9
ROS_DISTRO = "jazzy"

REPAIR_COMMAND = "python -m msrd_ros.bags.repair"

_LAYOUT = re.compile(r"(?P<label>[^_]+)_(?P<number>\d{3,})")
_SUBJECT = re.compile(r"[a-z0-9_]+")
# Longer than any line, so that no hash is folded onto a line of its own.
_YAML_WIDTH = 4096
_INFINITE = {"sec": 9223372036, "nsec": 854775807}

_Loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_Dumper = getattr(yaml, "CSafeDumper", yaml.SafeDumper)


@dataclass(frozen=True)
class BagInfo:
    """What a bag's metadata says, without reading a message.

    Attributes
    ----------
    path
        The bag's directory.
    label
        The strategy that it says it shows, in `custom_data` or by its name; None if it does not say.
    subject, outcome
        Who showed the stroke and what became of the ball; empty if it does not say.
    kept
        Whether the recorder accepted the stroke; foreign bags count as accepted.
    message_count, duration_ns, start_ns
        As in the metadata.
    types
        Type name by full topic name.
    files
        Names of the storage files.
    storage
        ``mcap`` or ``sqlite3``.
    packed
        Whether rosbag2 compressed whole files or single messages; MCAP's own chunks do not count.
    custom_data
        All that the metadata carries besides.
    """

    path: Path
    label: StrategyLabel | None
    subject: str
    outcome: str
    kept: bool
    message_count: int
    duration_ns: int
    start_ns: int
    types: Mapping[str, str]
    files: tuple[str, ...]
    storage: str
    packed: bool
    custom_data: Mapping[str, str]


def check_subject(subject: str, where: str = "subject") -> str:
    """The subject's name, if it may become part of a path.

    Raises
    ------
    UserError
        If it holds anything but a-z, 0-9 and _.
    """
    if not _SUBJECT.fullmatch(subject):
        raise UserError(f"{where}: {subject!r} is no subject's name; use a-z, 0-9 and _ only")
    return subject


def split_name(name: str) -> tuple[str, int] | None:
    """Label text and number of a directory named ``<label>_<nnn>``; None for any other name."""
    match = _LAYOUT.fullmatch(name)
    return (match["label"], int(match["number"])) if match else None


def qos_profiles(topic: BagTopic) -> list[dict[str, Any]]:
    """The quality of service a topic's publishers offered, as version 9 writes it."""
    return [
        {
            "history": "keep_last",
            "depth": topic.depth,
            "reliability": "reliable" if topic.reliable else "best_effort",
            "durability": "transient_local" if topic.latched else "volatile",
            "deadline": dict(_INFINITE),
            "lifespan": dict(_INFINITE),
            "liveliness": "automatic",
            "liveliness_lease_duration": dict(_INFINITE),
            "avoid_ros_namespace_conventions": False,
        }
    ]


def dump_yaml(value: object) -> str:
    """Block-style YAML in the order given."""
    text: str = yaml.dump(value, Dumper=_Dumper, sort_keys=False, width=_YAML_WIDTH, allow_unicode=True)
    return text


def build_metadata(
    file_name: str,
    topics: Sequence[BagTopic],
    messages: Sequence[BagMessage],
    custom_data: Mapping[str, str],
) -> dict[str, Any]:
    """The metadata of a bag of one MCAP file, without its root key."""
    counts = Counter(message.topic for message in messages)
    start = min((message.log_time_ns for message in messages), default=0)
    end = max((message.log_time_ns for message in messages), default=0)
    return {
        "version": VERSION,
        "storage_identifier": "mcap",
        "duration": {"nanoseconds": end - start},
        "starting_time": {"nanoseconds_since_epoch": start},
        "message_count": len(messages),
        "topics_with_message_count": [
            {
                "topic_metadata": {
                    "name": topic.name,
                    "type": topic.type_name,
                    "serialization_format": "cdr",
                    "offered_qos_profiles": qos_profiles(topic),
                    "type_description_hash": describe_type(topic.type_name)[1],
                },
                "message_count": counts[topic.name],
            }
            for topic in topics
        ],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file_name],
        "files": [
            {
                "path": file_name,
                "starting_time": {"nanoseconds_since_epoch": start},
                "duration": {"nanoseconds": end - start},
                "message_count": len(messages),
            }
        ],
        "custom_data": {str(key): str(value) for key, value in custom_data.items()},
        "ros_distro": ROS_DISTRO,
    }


def read_info(path: Path) -> BagInfo:
    """Read a bag's metadata.

    Raises
    ------
    UserError
        If `path` is no bag, its metadata is missing or broken, its files are missing or empty, or its
        name and `custom_data` disagree on the label. Names the bag and says what to do.
    """
    root = _load(path)
    try:
        custom = {str(key): str(value) for key, value in (root.get("custom_data") or {}).items()}
        types = {
            str(entry["topic_metadata"]["name"]): str(entry["topic_metadata"]["type"])
            for entry in root["topics_with_message_count"]
        }
        # Bags of the first versions hold paths relative to the directory above.
        files = tuple(Path(name).name for name in root["relative_file_paths"])
        message_count = int(root["message_count"])
        duration_ns = int(root["duration"]["nanoseconds"])
        start_ns = int(root["starting_time"]["nanoseconds_since_epoch"])
        storage = str(root["storage_identifier"])
        packed = str(root.get("compression_mode") or "").lower() not in ("", "none")
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise UserError(
            f"bag {path}: {METADATA_FILE} is broken ({type(error).__name__}: {error}); "
            f"delete it and rebuild the bag with: {REPAIR_COMMAND} {path}"
        ) from None
    for name in files:
        file = path / name
        if not file.is_file() or not file.stat().st_size:
            state = "is empty" if file.is_file() else "is missing"
            raise UserError(f"bag {path}: its file {name} {state}; copy the bag again or delete it")
    if not message_count:
        raise UserError(f"bag {path}: holds no messages; record it again or delete it")
    return BagInfo(
        path=path,
        label=_stated_label(path, custom),
        subject=custom.get("subject", ""),
        outcome=custom.get("outcome", ""),
        kept=custom.get("kept", "true") == "true",
        message_count=message_count,
        duration_ns=duration_ns,
        start_ns=start_ns,
        types=types,
        files=files,
        storage=storage,
        packed=packed,
        custom_data=custom,
    )


def _load(path: Path) -> dict[str, Any]:
    file = path / METADATA_FILE
    if not path.is_dir():
        state = "is a file" if path.exists() else "does not exist"
        raise UserError(f"bag {path}: {state}; name the bag's directory")
    if not file.is_file():
        if any(path.glob("*.mcap")):
            raise UserError(
                f"bag {path}: has no {METADATA_FILE}, so its recording was cut off; "
                f"recover what is there with: {REPAIR_COMMAND} {path}"
            )
        raise UserError(f"bag {path}: has no {METADATA_FILE}, so it is no bag; name a rosbag2 directory")
    try:
        root = yaml.load(file.read_text(encoding="utf-8"), Loader=_Loader)[ROOT_KEY]
        if not isinstance(root, dict):
            raise TypeError(f"{ROOT_KEY} is {type(root).__name__}")
    except (yaml.YAMLError, OSError, UnicodeDecodeError, TypeError, KeyError) as error:
        reason = (str(error).splitlines() or [""])[0]
        raise UserError(
            f"bag {path}: {METADATA_FILE} is not readable ({type(error).__name__}: {reason}); "
            f"delete it and rebuild the bag with: {REPAIR_COMMAND} {path}"
        ) from None
    return root


def _stated_label(path: Path, custom: Mapping[str, str]) -> StrategyLabel | None:
    """The label that custom_data and the directory's name agree on."""
    named = split_name(path.resolve().name)
    if "label" not in custom:
        return StrategyLabel.parse_optional(named[0]) if named else None
    label = StrategyLabel.parse(custom["label"], f"bag {path}: custom_data")
    if named and named[0] != str(label):
        raise UserError(
            f"bag {path}: custom_data says {label}, the directory's name {named[0]}; "
            f"rename the directory or leave the bag out"
        )
    return label

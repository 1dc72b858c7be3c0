"""``metadata.yaml`` of a rosbag2 directory as it is written, in version 9; `bags.info` reads it."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import yaml

from msrd_ros.bags.schemas import describe_type
from msrd_ros.contract.topics import BagMessage, BagTopic
from msrd_ros.core.errors import UserError

METADATA_FILE = "metadata.yaml"
ROOT_KEY = "rosbag2_bagfile_information"
VERSION = 9
FORMAT_KEY = "msrd_ros_format"
STROKE_FORMAT = 1
"""What a stroke's bag says of itself in `custom_data`; one that says nothing is of the first, or foreign."""
NOTE_KEY = "note"
"""What was said of a stroke when it was recorded, such as how it came about."""
ROS_DISTRO = "jazzy"

_LAYOUT = re.compile(r"(?P<label>[^_]+)_(?P<number>\d{3,})")
_SUBJECT = re.compile(r"[a-z0-9_]+")
# Longer than any line, so that no hash is folded onto a line of its own.
_YAML_WIDTH = 4096
_INFINITE = {"sec": 9223372036, "nsec": 854775807}

_Loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_Dumper = getattr(yaml, "CSafeDumper", yaml.SafeDumper)


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

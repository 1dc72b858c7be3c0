"""A bag that is written anew holds what the old one held, whoever recorded it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml
from mcap.reader import make_reader
from mcap.writer import Writer

from edited_bags import messages_of, shipped, write_mcap
from libraries import write_split
from mcap_doctor import examine
from msrd_ros.bags.info import read_info
from msrd_ros.bags.metadata import METADATA_FILE, ROOT_KEY, build_metadata, dump_yaml
from msrd_ros.bags.reader import Bag
from msrd_ros.bags.rewriting import rewrite_bag
from msrd_ros.contract.topics import BagMessage
from msrd_ros.core.errors import UserError
from synthetic_strokes import at_root, stroke_messages, topics_of


def same(message: BagMessage) -> BagMessage:
    return message


def test_all_but_the_name_is_as_it_was(tmp_path: Path) -> None:
    info, target = read_info(shipped()), tmp_path / "forehand-push_009"
    rewrite_bag(info, target, same, info.custom_data)
    assert Bag(target).raw() == Bag(shipped()).raw()
    old, new = (
        yaml.safe_load((path / METADATA_FILE).read_text(encoding="utf-8"))[ROOT_KEY]
        for path in (shipped(), target)
    )
    for root in (old, new):
        assert [part.pop("path") for part in root["files"]] == root.pop("relative_file_paths")
    assert new == old
    examine(target / "forehand-push_009_0.mcap")


def test_a_split_bag_becomes_one_file(tmp_path: Path) -> None:
    messages = stroke_messages()
    path = write_split(tmp_path / "forehand-push_001", topics_of(messages), at_root(messages), parts=3)
    before = Bag(path).raw()
    rewrite_bag(read_info(path), tmp_path / "forehand-push_002", same, {"label": "forehand-push"})
    assert Bag(tmp_path / "forehand-push_002").raw() == before
    assert read_info(tmp_path / "forehand-push_002").files == ("forehand-push_002_0.mcap",)


def test_unknown_types_attachments_and_metadata_come_along(tmp_path: Path) -> None:
    path = tmp_path / "session"
    path.mkdir()
    with (path / "session_0.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2", "test")
        schema = writer.register_schema("lab_msgs/msg/Odd", "ros2msg", b"uint8 x")
        channel = writer.register_channel("/odd", "cdr", schema, {"offered_qos_profiles": "- depth: 7"})
        writer.add_message(channel, 5, b"\x00\x01\x00\x00\x07", 4, 3)
        writer.add_attachment(1, 2, "note.txt", "text/plain", b"kept")
        writer.add_metadata("lab", {"room": "12"})
        writer.finish()
    metadata = build_metadata("session_0.mcap", [], [], {})
    metadata["message_count"] = 1
    metadata["topics_with_message_count"] = [
        {"topic_metadata": {"name": "/odd", "type": "lab_msgs/msg/Odd"}, "message_count": 1}
    ]
    (path / METADATA_FILE).write_text(dump_yaml({ROOT_KEY: metadata}), encoding="utf-8")
    rewrite_bag(read_info(path), tmp_path / "copy", same, {})
    with (tmp_path / "copy" / "copy_0.mcap").open("rb") as stream:
        reader = make_reader(stream)
        ((kind, channel_of, message),) = reader.iter_messages()
        assert kind is not None
        assert (kind.name, kind.data, channel_of.metadata) == (
            "lab_msgs/msg/Odd", b"uint8 x", {"offered_qos_profiles": "- depth: 7"}
        )  # fmt: skip
        assert (message.data, message.log_time, message.publish_time, message.sequence) == (
            b"\x00\x01\x00\x00\x07", 5, 4, 3
        )  # fmt: skip
        assert [item.data for item in reader.iter_attachments()] == [b"kept"]
        assert {item.name: item.metadata for item in reader.iter_metadata()}["lab"] == {"room": "12"}


def test_what_cannot_be_written_anew_is_refused_with_what_to_do(tmp_path: Path) -> None:
    alone = write_mcap(tmp_path / "alone.mcap", messages_of())
    with pytest.raises(UserError, match=r"make one of it with: python -m msrd_ros.bags repair .*alone.mcap"):
        rewrite_bag(read_info(alone), tmp_path / "target", same, {})
    told: list[dict[str, Any]] = [{"storage": "sqlite3"}, {"packed": True}]
    for stored in told:
        with pytest.raises(UserError, match="make plain MCAP of it with ros2 bag convert"):
            rewrite_bag(replace(read_info(shipped()), **stored), tmp_path / "target", same, {})
    with pytest.raises(UserError, match="nothing of it would be left"):
        rewrite_bag(read_info(shipped()), tmp_path / "target", lambda message: None, {})
    assert not (tmp_path / "target").exists()
    assert [entry.name for entry in tmp_path.iterdir()] == ["alone.mcap"]

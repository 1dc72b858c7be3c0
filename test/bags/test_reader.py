"""Bags of whatever origin as messages and episodes; broken or contradictory ones refused by name."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.rosbag2.enums import CompressionFormat, CompressionMode

from msrd_ros.bags.info import read_info
from msrd_ros.bags.reader import Bag
from msrd_ros.bags.schemas import deserialise, typestore
from msrd_ros.bags.writer import keep_stroke, write_bag
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.contract.topics import CONTRACT, BagMessage, parse_topic_names
from msrd_ros.contract.translation import EpisodeAssembler
from msrd_ros.core.errors import UserError
from msrd_ros.recordings.episodes import read_episodes
from synthetic_strokes import (
    START_NS,
    at_root,
    ball_position,
    described,
    joint_state,
    stroke_messages,
    topics_of,
)

LABEL = StrategyLabel.parse("forehand-push")


def keep(root: Path, messages: list[BagMessage] | None = None) -> Path:
    stroke = messages or [described(), *stroke_messages()]
    return keep_stroke(root, "s01", LABEL, topics_of(stroke), at_root(stroke), {"outcome": "returned"})


def foreign(
    path: Path,
    messages: list[BagMessage],
    storage: StoragePlugin = StoragePlugin.MCAP,
    mode: CompressionMode = CompressionMode.NONE,
    prefix: str = "",
    version: int = 9,
) -> Path:
    """A bag of another recorder: no custom_data, its own layout."""
    writer = Writer(path, version=version, storage_plugin=storage)  # type: ignore[arg-type]
    writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        connections = {
            topic.name: writer.add_connection(topic.name, topic.type_name, typestore=typestore())
            for topic in topics_of(messages, prefix)
        }
        for message in at_root(messages, prefix):
            writer.write(connections[message.topic], message.log_time_ns, message.data)
    return path


def assert_refused(path: Path, *words: str) -> None:
    """One line that names the bag and says what to do, and nothing else."""
    with pytest.raises(UserError) as caught:
        read_episodes(Bag(path))
    text = str(caught.value)
    assert "\n" not in text
    assert str(path) in text
    for word in words:
        assert word in text


def test_entries_come_in_order_with_the_fields_of_ros(tmp_path: Path) -> None:
    stroke = [described(), *stroke_messages()]
    entries = list(Bag(keep(tmp_path, stroke)).entries())
    assert [(entry.topic, entry.log_time_ns) for entry in entries] == [
        (message.topic, message.log_time_ns) for message in stroke
    ]
    first = next(entry.message for entry in entries if entry.topic == "joint_states")
    assert list(first.name) == [f"right_j{index}" for index in range(7)]
    assert (first.header.stamp.sec, first.header.stamp.nanosec) == divmod(START_NS, 10**9)
    assert first.position.dtype == np.float64


def test_raw_messages_come_back_byte_for_byte(tmp_path: Path) -> None:
    stroke = at_root([described(), *stroke_messages()])
    assert Bag(keep(tmp_path)).raw() == stroke


def test_messages_of_one_instant_keep_their_order(tmp_path: Path) -> None:
    stroke = [message._replace(log_time_ns=START_NS) for message in stroke_messages()]
    assert [m.sequence for m in Bag(keep(tmp_path, stroke)).raw()] == list(range(len(stroke)))


def test_an_episode_is_what_the_translation_makes_of_the_messages(tmp_path: Path) -> None:
    bag = Bag(keep(tmp_path))
    (episode,) = read_episodes(bag)
    assembler = EpisodeAssembler(LABEL, "s01")
    for message in stroke_messages():
        if message.topic == "joint_states":
            assembler.add_joint_state(deserialise(message.data, CONTRACT[message.topic].type_name))
        if message.topic == "ball/position":
            assembler.add_ball_position(deserialise(message.data, CONTRACT[message.topic].type_name))
    expected = assembler.assemble()
    np.testing.assert_array_equal(episode.observations, expected.observations)
    np.testing.assert_array_equal(episode.actions, expected.actions)
    assert (episode.label, episode.subject) == (LABEL, "s01")


@pytest.mark.parametrize(
    ("storage", "mode", "version"),
    [
        (StoragePlugin.MCAP, CompressionMode.NONE, 9),
        (StoragePlugin.MCAP, CompressionMode.STORAGE, 8),
        (StoragePlugin.MCAP, CompressionMode.MESSAGE, 9),
        (StoragePlugin.SQLITE3, CompressionMode.NONE, 8),
        (StoragePlugin.SQLITE3, CompressionMode.FILE, 9),
    ],
)
def test_bags_of_other_recorders_are_read(
    tmp_path: Path, storage: StoragePlugin, mode: CompressionMode, version: int
) -> None:
    stroke = stroke_messages("backhand-slice")
    path = foreign(tmp_path / "session", stroke, storage, mode, version=version)
    bag = Bag(path)
    assert [(m.topic, m.data) for m in bag.raw()] == [(m.topic, m.data) for m in at_root(stroke)]
    (episode,) = read_episodes(bag)
    assert str(episode.label) == "backhand-slice"


def test_a_longer_recording_is_cut_into_its_accepted_strokes(tmp_path: Path) -> None:
    session: list[BagMessage] = []
    labels = ["forehand-push", "backhand-topspin", "forehand-slice"]
    for index, label in enumerate(labels):
        scale = 1.2 if label == "backhand-topspin" else 0.5  # too fast: refused
        start = START_NS + index * 3_000_000_000
        session += stroke_messages(label, start, ball_id=index, velocity_scale=scale)
    episodes = read_episodes(Bag(foreign(tmp_path / "session", session)))
    assert [str(episode.label) for episode in episodes] == ["forehand-push", "forehand-slice"]
    alone = read_episodes(Bag(keep(tmp_path)))[0]
    np.testing.assert_array_equal(episodes[0].observations, alone.observations)


def test_topics_in_a_namespace_are_found(tmp_path: Path) -> None:
    path = foreign(tmp_path / "session", stroke_messages(), prefix="/lab/sawyer")
    bag = Bag(path)
    assert bag.topics["joint_states"] == "/lab/sawyer/joint_states"
    assert bag.role("/lab/sawyer/ball/position") == "ball/position"
    assert len(read_episodes(bag)) == 1


def test_topics_of_other_names_are_named_by_the_user(tmp_path: Path) -> None:
    renamed = [
        message._replace(topic=message.topic.replace("joint_states", "arm")) for message in stroke_messages()
    ]
    topics = [
        topic._replace(name=topic.name.replace("joint_states", "arm"))
        for topic in topics_of(stroke_messages())
    ]
    write_bag(tmp_path / "renamed", topics, at_root(renamed), {"label": "forehand-push"})
    assert_refused(tmp_path / "renamed", "has no topic joint_states", "/arm", "joint_states:=")
    names = parse_topic_names(["joint_states:=/arm"], "parameter topics")
    assert len(read_episodes(Bag(tmp_path / "renamed", names))) == 1
    with pytest.raises(UserError, match="has no topic /leg"):
        Bag(tmp_path / "renamed", {"joint_states": "/leg"})
    with pytest.raises(UserError, match="is a sensor_msgs/msg/JointState"):
        Bag(tmp_path / "renamed", {"ball/position": "/arm"})
    with pytest.raises(UserError, match="NAME:=NAME_IN_BAG"):
        parse_topic_names(["joint_states"], "parameter topics")


def test_two_robots_are_ambiguous(tmp_path: Path) -> None:
    stroke = stroke_messages()
    both = sorted(at_root(stroke, "/a") + at_root(stroke, "/b"), key=lambda message: message.log_time_ns)
    write_bag(tmp_path / "two", topics_of(stroke, "/a") + topics_of(stroke, "/b"), both, {})
    assert_refused(tmp_path / "two", "/a/joint_states and /b/joint_states", "joint_states:=")


def test_name_metadata_and_headers_must_agree(tmp_path: Path) -> None:
    path = keep(tmp_path)
    wrong_name = path.rename(path.with_name("forehand-slice_001"))
    assert_refused(wrong_name, "custom_data says forehand-push", "forehand-slice")
    wrong_name.rename(path)
    wrong_header = keep(tmp_path, stroke_messages("backhand-push"))
    assert_refused(wrong_header, "rally/outcome says backhand-push", "forehand-push")
    no_name = keep(tmp_path, stroke_messages("Forehand_Smash"))
    assert_refused(no_name, "'Forehand_Smash' is no strategy label")
    metadata = path / "metadata.yaml"
    metadata.write_text(metadata.read_text().replace("label: forehand-push", "label: forehand-flick"))
    assert_refused(path, "custom_data", "forehand-flick")


@pytest.mark.parametrize("frame", ["base_link", "base", "panda-link0", "backhand-slice"])
def test_joint_states_with_a_frame_of_their_own_are_unlabelled_no_error(tmp_path: Path, frame: str) -> None:
    (episode,) = read_episodes(Bag(keep(tmp_path, stroke_messages(joint_frame=frame))))
    assert episode.label == LABEL


def test_a_bag_without_labels_is_unlabelled_unless_its_name_tells(tmp_path: Path) -> None:
    silent = [
        message
        for message in stroke_messages(joint_frame="base_link")
        if message.topic in ("joint_states", "ball/position")
    ]
    path = foreign(tmp_path / "session", silent)
    (episode,) = read_episodes(Bag(path))
    assert episode.label is None
    with pytest.raises(UserError, match=rf"{path}: no strategy label; give it one with .* relabel"):
        _ = episode.strategy
    named = path.rename(tmp_path / "backhand-topspin_001")
    (episode,) = read_episodes(Bag(named))
    assert str(episode.label) == "backhand-topspin"


def test_a_bag_that_says_it_is_unlabelled_is_so_in_name_and_headers(tmp_path: Path) -> None:
    def keep_bare(label: str) -> Path:
        stroke = stroke_messages(label)
        return keep_stroke(tmp_path, "s01", None, topics_of(stroke), at_root(stroke), {})

    path = keep_bare("")
    assert path.name == "unlabelled_001"
    info = read_info(path)
    assert (info.label, info.unlabelled, info.custom_data["label"]) == (None, True, "")
    bag = Bag(path)
    assert bag.labels(bag.raw()) == set()
    assert [episode.label for episode in read_episodes(bag)] == [None]
    contradicted = keep_bare("forehand-push")
    assert contradicted.name == "unlabelled_002"
    assert_refused(contradicted, "rally/outcome says forehand-push", "metadata or name unlabelled")
    assert_refused(path.rename(path.with_name("forehand-push_007")), "custom_data says unlabelled", "rename")


def test_a_bags_own_label_holds_for_all_its_strokes_that_say_nothing(tmp_path: Path) -> None:
    session = stroke_messages("") + stroke_messages("", START_NS + 3_000_000_000, ball_id=2)
    path = foreign(tmp_path / "session", session)
    assert [episode.label for episode in read_episodes(Bag(path))] == [None, None]
    named = path.rename(tmp_path / "backhand-topspin_001")
    assert [str(episode.label) for episode in read_episodes(Bag(named))] == ["backhand-topspin"] * 2


def test_strategies_that_nothing_parts_are_refused(tmp_path: Path) -> None:
    session = stroke_messages() + stroke_messages("forehand-slice", START_NS + 3_000_000_000)
    session = [message for message in session if message.topic != "rally/outcome"]
    path = foreign(tmp_path / "session", session)
    assert_refused(path, "forehand-push, forehand-slice", "rally/outcome")


def test_bags_that_are_none_are_refused(tmp_path: Path) -> None:
    assert_refused(tmp_path / "nowhere", "does not exist")
    (tmp_path / "empty").mkdir()
    assert_refused(tmp_path / "empty", "no metadata.yaml")
    (tmp_path / "file").write_text("")
    assert_refused(tmp_path / "file", "is a file")
    nothing = tmp_path / "nothing"
    write_bag(nothing, topics_of(stroke_messages()), [], {})
    assert_refused(nothing, "holds no messages")


@pytest.mark.parametrize("content", ["", "{", "rosbag2_bagfile_information: 3", "\0", "a: b", "[]"])
def test_broken_metadata_is_refused(tmp_path: Path, content: str) -> None:
    path = keep(tmp_path)
    (path / "metadata.yaml").write_text(content)
    assert_refused(path, "metadata.yaml is not readable", "msrd_ros.bags repair")


def test_metadata_that_lacks_a_field_is_refused(tmp_path: Path) -> None:
    path = keep(tmp_path)
    root = yaml.safe_load((path / "metadata.yaml").read_text())
    for key in ("topics_with_message_count", "relative_file_paths", "message_count", "duration"):
        less = {k: v for k, v in root["rosbag2_bagfile_information"].items() if k != key}
        (path / "metadata.yaml").write_text(yaml.safe_dump({"rosbag2_bagfile_information": less}))
        assert_refused(path, "metadata.yaml is broken", key)


@pytest.mark.parametrize("storage", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_a_bag_cut_off_anywhere_is_refused(tmp_path: Path, storage: StoragePlugin) -> None:
    path = foreign(tmp_path / "forehand-push_001", stroke_messages(), storage)
    file = next(file for file in path.iterdir() if file.name != "metadata.yaml")
    whole = file.read_bytes()
    file.write_bytes(b"")
    assert_refused(path, "is empty")
    # SQLite's last page is spare, MCAP's last byte is not.
    spare = 1 if storage == StoragePlugin.MCAP else 4096
    for length in (1, 8, 30, 4096, len(whole) // 3, len(whole) - 4096, len(whole) - spare):
        file.write_bytes(whole[:length])
        assert_refused(path, "repair" if storage == StoragePlugin.MCAP else "copy it again")
    file.unlink()
    assert_refused(path, "is missing")


def test_damage_within_a_file_is_found_by_its_checksum(tmp_path: Path) -> None:
    path = keep(tmp_path)
    file = next(path.glob("*.mcap"))
    whole = file.read_bytes()
    with file.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    (chunk,) = summary.chunk_indexes
    head = 60  # the chunk's own record head; then its compressed messages
    for place in range(chunk.chunk_start_offset + head, chunk.chunk_start_offset + chunk.chunk_length, 3989):
        damaged = bytearray(whole)
        damaged[place] ^= 0x10
        file.write_bytes(damaged)
        assert_refused(path, "cut off or damaged")


def test_missing_joint_and_nan_name_the_bag(tmp_path: Path) -> None:
    stroke = stroke_messages()
    others = [message for message in stroke if message.topic != "joint_states"]
    names = [f"right_j{index}" for index in range(6)] + ["head_pan"]
    for kind, state in {
        "right_j6 is missing": joint_state(START_NS, "", names=names),
        "not finite": joint_state(START_NS, "", velocity_scale=float("nan")),
    }.items():
        joints = [m._replace(data=state) for m in stroke if m.topic == "joint_states"]
        path = keep(tmp_path, sorted(others + joints, key=lambda message: message.log_time_ns))
        assert_refused(path, kind)
        shutil.rmtree(path)
    balls = [
        m._replace(data=ball_position(m.log_time_ns, float("nan"))) if m.topic == "ball/position" else m
        for m in stroke
    ]
    assert_refused(keep(tmp_path, balls), "not finite")


def test_info_needs_no_message(tmp_path: Path) -> None:
    info = read_info(keep(tmp_path))
    assert (str(info.label), info.subject, info.outcome, info.kept) == (
        "forehand-push",
        "s01",
        "returned",
        True,
    )
    assert info.duration_ns == 2_250_000_000
    assert info.types["/joint_states"] == "sensor_msgs/msg/JointState"

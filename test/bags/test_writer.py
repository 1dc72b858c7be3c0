"""Bags on disk: what rosbag2 expects, whole or absent, never overwritten."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from mcap.writer import Writer as PlainWriter
from mcap_ros2.decoder import DecoderFactory
from rosbags.rosbag2 import Reader

from mcap_doctor import examine
from msrd_ros.bags.schemas import deserialise, serialise
from msrd_ros.bags.static_transforms import static_transforms_from_urdf
from msrd_ros.bags.writer import keep_stroke, remove_leftovers, write_bag
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.contract.topics import BagMessage
from msrd_ros.core.errors import UserError
from processes import CHECKOUT
from synthetic_strokes import URDF, at_root, described, stroke_messages, topics_of

LABEL = StrategyLabel.parse("forehand-push")
FACTS = {"outcome": "returned", "version": "msrd_ros 0.1.0"}


def messages() -> list[BagMessage]:
    return [described(), *stroke_messages()]


def keep(root: Path, subject: str = "s01") -> Path:
    stroke = messages()
    return keep_stroke(root, subject, LABEL, topics_of(stroke), at_root(stroke), FACTS)


def test_layout_and_metadata_are_what_rosbag2_reads(tmp_path: Path) -> None:
    path = keep(tmp_path)
    assert path == tmp_path / "s01" / "forehand-push_001"
    assert sorted(file.name for file in path.iterdir()) == ["forehand-push_001_0.mcap", "metadata.yaml"]
    root = yaml.safe_load((path / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert root["version"] == 9
    assert root["storage_identifier"] == "mcap"
    assert root["ros_distro"] == "jazzy"
    assert root["relative_file_paths"] == ["forehand-push_001_0.mcap"]
    assert root["custom_data"] == {"label": "forehand-push", "subject": "s01", **FACTS}
    assert all(isinstance(value, str) for value in root["custom_data"].values())
    stroke = messages()
    assert root["message_count"] == len(stroke) == root["files"][0]["message_count"]
    assert root["starting_time"]["nanoseconds_since_epoch"] == stroke[0].log_time_ns
    assert root["duration"]["nanoseconds"] == stroke[-1].log_time_ns - stroke[0].log_time_ns
    entries = {
        entry["topic_metadata"]["name"]: entry["topic_metadata"]
        for entry in root["topics_with_message_count"]
    }
    assert set(entries) == {f"/{message.topic}" for message in stroke}
    joint_states = entries["/joint_states"]
    # The hash that Jazzy's own message packages carry.
    assert joint_states["type_description_hash"] == (
        "RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e"
    )
    assert joint_states["offered_qos_profiles"][0]["durability"] == "volatile"
    assert joint_states["offered_qos_profiles"][0]["depth"] == 1000
    latched = entries["/strategy"]["offered_qos_profiles"][0]
    assert (latched["reliability"], latched["durability"]) == ("reliable", "transient_local")
    assert latched["lifespan"] == {"sec": 9223372036, "nsec": 854775807}


def test_passes_the_doctor_and_other_readers_read_the_same(tmp_path: Path) -> None:
    path = keep(tmp_path)
    file = next(path.glob("*.mcap"))
    assert examine(file) == []
    written = at_root(messages())
    with Reader(path) as reader:
        read = [(connection.topic, time, bytes(data)) for connection, time, data in reader.messages()]
        assert (reader.storage.metadata.custom or {})["label"] == "forehand-push"
    assert read == [(message.topic, message.log_time_ns, message.data) for message in written]
    with file.open("rb") as stream:
        decoded = list(make_reader(stream, decoder_factories=[DecoderFactory()]).iter_decoded_messages())
    assert len(decoded) == len(written)
    for (_, channel, record, content), message in zip(decoded, written, strict=True):
        assert (channel.topic, record.log_time, record.publish_time, record.sequence) == (
            message.topic,
            message.log_time_ns,
            message.publish_time_ns,
            message.sequence,
        )
        if message.topic == "/joint_states":
            ours = deserialise(message.data, "sensor_msgs/msg/JointState")
            assert list(content.velocity) == ours.velocity.tolist()
            assert content.header.frame_id == ours.header.frame_id


def test_the_doctor_finds_what_is_wrong(tmp_path: Path) -> None:
    file = next(keep(tmp_path).glob("*.mcap"))
    sound = file.read_bytes()
    for place in (100, len(sound) // 2):
        file.write_bytes(sound[:place] + bytes([sound[place] ^ 0xFF]) + sound[place + 1 :])
        with pytest.raises(Exception):  # noqa: B017 - damaged zstd or crc, whichever library notices
            assert examine(file) == []
    with file.open("wb") as stream:
        writer = PlainWriter(stream)  # its empty attachment group is an error to MCAP's doctor
        writer.start("ros2", "test")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        writer.add_message(writer.register_channel("/a", "cdr", schema), 1, b"\0\1\0\0\1\0\0\0\0", 1)
        writer.finish()
    assert any("summary offsets" in problem for problem in examine(file))


def test_a_stroke_of_incompressible_noise_stays_under_200_kb(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    stroke = []
    for message in messages():
        if message.topic == "joint_states":
            content = deserialise(message.data, "sensor_msgs/msg/JointState")
            for name in ("position", "velocity", "effort"):
                setattr(content, name, getattr(content, name) + rng.normal(0.0, 1e-3, 7))
            message = message._replace(data=serialise(content, "sensor_msgs/msg/JointState"))
        elif message.topic == "ball/position":
            content = deserialise(message.data, "geometry_msgs/msg/PointStamped")
            content.point.x, content.point.y, content.point.z = rng.normal(0.0, 1.0, 3)
            message = message._replace(data=serialise(content, "geometry_msgs/msg/PointStamped"))
        stroke.append(message)
    path = keep_stroke(tmp_path, "s01", LABEL, topics_of(stroke), at_root(stroke), FACTS)
    assert sum(file.stat().st_size for file in path.iterdir()) < 200_000


def test_numbers_go_on_and_nothing_is_overwritten(tmp_path: Path) -> None:
    first, second = keep(tmp_path), keep(tmp_path)
    assert [first.name, second.name] == ["forehand-push_001", "forehand-push_002"]
    before = next(first.glob("*.mcap")).read_bytes()
    for file in second.iterdir():
        file.unlink()
    second.rmdir()
    (tmp_path / "s01" / "forehand-push_017").mkdir()
    assert keep(tmp_path).name == "forehand-push_018"
    assert keep(tmp_path, "s02").name == "forehand-push_001"
    stroke = messages()
    with pytest.raises(FileExistsError):
        write_bag(first, topics_of(stroke), at_root(stroke), {})
    assert next(first.glob("*.mcap")).read_bytes() == before


def test_writers_side_by_side_take_different_numbers(tmp_path: Path) -> None:
    paths: list[Path] = []
    threads = [
        threading.Thread(target=lambda: paths.extend(keep(tmp_path) for _ in range(5))) for _ in range(4)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(set(paths)) == 20
    assert sorted(path.name for path in (tmp_path / "s01").iterdir()) == [
        f"forehand-push_{number:03d}" for number in range(1, 21)
    ]
    assert all(examine(next(path.glob("*.mcap"))) == [] for path in paths)


@pytest.mark.parametrize("subject", ["", "..", "a/b", "S01", "a b", "\N{LATIN SMALL LETTER E WITH ACUTE}"])
def test_a_subject_that_is_no_name_never_becomes_a_path(tmp_path: Path, subject: str) -> None:
    with pytest.raises(UserError, match="use a-z, 0-9 and _ only"):
        keep(tmp_path, subject)
    assert list(tmp_path.iterdir()) == []


def test_a_failed_write_leaves_nothing(tmp_path: Path) -> None:
    stroke = messages()
    bad = [*at_root(stroke), BagMessage("/unknown", b"", stroke[-1].log_time_ns, 0)]
    with pytest.raises(KeyError):
        write_bag(tmp_path / "bag", topics_of(stroke), bad, {})
    assert list(tmp_path.iterdir()) == []


FOLDERS = [str(Path(__file__).parent), str(CHECKOUT / "test" / "helpers")]

WRITE_FOR_EVER = """
import sys
from pathlib import Path
sys.path[:0] = sys.argv[2:]
from test_writer import keep
print("up", flush=True)
while True:
    keep(Path(sys.argv[1]))
"""


@pytest.mark.processes
def test_every_bag_is_whole_when_the_writer_is_killed_at_any_moment(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    seen = 0
    for _ in range(5):
        process = subprocess.Popen(
            [sys.executable, "-c", WRITE_FOR_EVER, str(tmp_path), *FOLDERS],
            stdout=subprocess.PIPE,
        )
        assert process.stdout is not None
        assert process.stdout.readline() == b"up\n"
        while len(list(tmp_path.glob("s01/forehand*"))) < seen + 3:
            assert process.poll() is None
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(timeout=rng.uniform(0.0, 0.03))
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
        paths = sorted(tmp_path.glob("s01/forehand*"))
        assert len(paths) >= seen + 3
        for path in paths[seen:]:
            assert examine(next(path.glob("*.mcap"))) == []
            with Reader(path) as reader:
                assert sum(1 for _ in reader.messages()) == len(messages())
        seen = len(paths)
    remove_leftovers(tmp_path)
    assert not list(tmp_path.glob("s01/.*"))


def test_leftovers_of_the_living_are_left_alone(tmp_path: Path) -> None:
    mine = tmp_path / "s01" / f".writing-{os.getpid()}-0123abcd"
    mine.mkdir(parents=True)
    assert remove_leftovers(tmp_path) == 0
    assert mine.is_dir()


def test_static_transforms_follow_the_description() -> None:
    scipy_rotation = pytest.importorskip("scipy.spatial.transform").Rotation
    data = static_transforms_from_urdf(URDF, 1_500_000_000)
    assert data is not None
    first, second = deserialise(data, "tf2_msgs/msg/TFMessage").transforms
    assert (first.header.frame_id, first.child_frame_id) == ("world", "base")
    assert (first.header.stamp.sec, first.header.stamp.nanosec) == (1, 500_000_000)
    assert (first.transform.translation.x, first.transform.translation.z) == (-2.0, 0.9)
    rotation = first.transform.rotation
    expected = scipy_rotation.from_euler("xyz", [0.1, 0.2, 0.3]).as_quat()
    np.testing.assert_allclose([rotation.x, rotation.y, rotation.z, rotation.w], expected, atol=1e-12)
    assert second.transform.rotation.w == 1.0
    assert static_transforms_from_urdf("<robot/>", 0) is None
    assert static_transforms_from_urdf("no xml", 0) is None

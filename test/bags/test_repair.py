"""What is left of a bag that was cut off becomes a bag again."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from mcap.writer import CompressionType
from mcap.writer import Writer as PlainWriter

from mcap_doctor import examine
from msrd_ros.bags.reader import Bag
from msrd_ros.bags.repair import repair
from msrd_ros.bags.schemas import describe_type
from msrd_ros.bags.writer import keep_stroke
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.contract.topics import BagMessage
from msrd_ros.core.errors import UserError
from msrd_ros.recordings.command import main
from msrd_ros.recordings.episodes import read_episodes
from synthetic_strokes import at_root, described, stroke_messages, topics_of

LABEL = StrategyLabel.parse("forehand-push")


@pytest.fixture
def stroke() -> list[BagMessage]:
    return at_root([described(), *stroke_messages()])


def killed(path: Path, messages: list[BagMessage], compression: CompressionType, chunk_size: int) -> Path:
    """What a recorder leaves that was killed: no metadata, no summary, the last chunk torn."""
    path.mkdir(parents=True)
    file = path / "recording_0.mcap"
    topics = topics_of([message._replace(topic=message.topic.lstrip("/")) for message in messages])
    with file.open("wb") as stream:
        writer = PlainWriter(stream, compression=compression, chunk_size=chunk_size)
        writer.start("ros2", "test")
        channels = {}
        for topic in topics:
            schema = writer.register_schema(topic.type_name, "ros2msg", describe_type(topic.type_name)[0])
            channels[topic.name] = writer.register_channel(topic.name, "cdr", schema, {})
        for message in messages:
            writer.add_message(
                channels[message.topic],
                message.log_time_ns,
                message.data,
                message.publish_time_ns,
                message.sequence,
            )
        end = stream.tell()
        writer.finish()
        stream.truncate(end - 100 if end > 100 else end)
    return path


@pytest.mark.parametrize("compression", [CompressionType.NONE, CompressionType.ZSTD, CompressionType.LZ4])
def test_all_but_the_torn_end_comes_back(
    tmp_path: Path, stroke: list[BagMessage], compression: CompressionType
) -> None:
    broken = killed(tmp_path / "session", stroke, compression, chunk_size=16 * 1024)
    with pytest.raises(UserError, match="repair"):
        Bag(broken)
    mended = repair(broken).path
    assert mended == tmp_path / "session_repaired"
    recovered = Bag(mended).raw()
    assert len(recovered) > 0.9 * len(stroke)
    assert recovered == stroke[: len(recovered)]
    assert examine(next(mended.glob("*.mcap"))) == []
    assert Bag(mended).info.custom_data["repaired"] == "true"


def test_part_of_an_uncompressed_chunk_comes_back(tmp_path: Path, stroke: list[BagMessage]) -> None:
    broken = killed(tmp_path / "session", stroke, CompressionType.NONE, chunk_size=100_000)
    file = broken / "recording_0.mcap"
    whole = file.read_bytes()
    counts = []
    for length in range(len(whole) // 4, len(whole), len(whole) // 7):
        file.write_bytes(whole[:length])
        mended = repair(broken).path
        recovered = Bag(mended).raw()
        assert recovered == stroke[: len(recovered)]
        counts.append(len(recovered))
        shutil.rmtree(mended)
    assert counts == sorted(set(counts))


def test_a_stroke_that_lost_only_its_summary_is_whole_again(tmp_path: Path) -> None:
    messages = [described(), *stroke_messages()]
    path = keep_stroke(
        tmp_path, "s01", LABEL, topics_of(messages), at_root(messages), {"outcome": "returned"}
    )
    file = next(path.glob("*.mcap"))
    (before,) = read_episodes(Bag(path))
    file.write_bytes(file.read_bytes()[:-2000])
    (after,) = read_episodes(Bag(repair(path, tmp_path / "mended").path))
    assert (after.observations == before.observations).all()
    assert (after.label, after.subject) == (LABEL, "s01")


def test_what_cannot_be_mended_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "nothing").mkdir()
    with pytest.raises(UserError, match=r"holds no \.mcap file"):
        repair(tmp_path / "nothing")
    (tmp_path / "nothing" / "a.mcap").write_bytes(b"\x89MCAP0\r\nnonsense")
    with pytest.raises(UserError, match="no message can be read in it; it is left as it is"):
        repair(tmp_path / "nothing")
    assert main(["repair", str(tmp_path / "nothing")]) == 2
    assert capsys.readouterr().err.startswith("repair: error: bag ")


def test_the_command_says_where_it_put_the_bag(
    tmp_path: Path, stroke: list[BagMessage], capsys: pytest.CaptureFixture[str]
) -> None:
    broken = killed(tmp_path / "session", stroke, CompressionType.ZSTD, chunk_size=16 * 1024)
    assert main(["repair", str(broken)]) == 0
    assert str(tmp_path / "session_repaired") in capsys.readouterr().out
    assert main(["repair", str(broken)]) == 2
    assert "exists already" in capsys.readouterr().err


def test_a_foreign_bag_is_told_and_left_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Advice to delete what one does not understand loses data."""
    path = tmp_path / "session"
    path.mkdir()
    with (path / "session_0.mcap").open("wb") as stream:
        writer = PlainWriter(stream)
        writer.start("ros2", "test")
        schema = writer.register_schema("test_msgs/msg/BasicTypes", "ros2msg", b"bool flag")
        channel = writer.register_channel("/test_topic", "cdr", schema)
        for time in range(30):
            writer.add_message(channel, time, b"\0\1\0\0\1", time)
        writer.finish()
    before = (path / "session_0.mcap").read_bytes()
    assert main(["repair", str(path)]) == 2
    said = capsys.readouterr().err
    assert "30 messages, 30 on /test_topic (test_msgs/msg/BasicTypes)" in said
    assert "none of it is a stroke" in said
    assert "delete" not in said
    assert (path / "session_0.mcap").read_bytes() == before
    assert [entry.name for entry in tmp_path.iterdir()] == ["session"]


def test_what_is_recovered_without_being_a_stroke_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    strategy = [message for message in at_root(stroke_messages()) if message.topic == "/strategy"]
    broken = killed(tmp_path / "session", strategy * 40, CompressionType.NONE, chunk_size=64)
    file = next(broken.glob("*.mcap"))
    assert main(["repair", str(file)]) == 0
    assert "none of it is a stroke: it holds" in capsys.readouterr().out

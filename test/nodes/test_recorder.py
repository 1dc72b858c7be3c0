"""The recorder, as a process of its own, against real publishers."""

from __future__ import annotations

import gc
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rclpy
import yaml
from rcl_interfaces.srv import SetParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.utilities import try_shutdown
from std_srvs.srv import Trigger

from mcap_doctor import examine
from msrd_ros.bags.cdr import read_frame_id
from msrd_ros.bags.reader import Bag
from msrd_ros.bags.schemas import deserialise
from msrd_ros.contract.episode import Episode
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.contract.outcome import MissReason
from msrd_ros.contract.topics import CONTRACT, BagMessage
from msrd_ros.contract.translation import EpisodeAssembler
from msrd_ros.nodes.recorder import Recorder, main
from msrd_ros.recordings.episodes import read_episodes
from msrd_ros.recordings.library import BagLibrary
from processes import Launcher, RunningProcess
from stroke_source import SENT, StrokeSource
from synthetic_strokes import LAUNCH_S, RALLY_S, described, joint_state, stroke_messages

pytestmark = pytest.mark.processes

SIMULATED_START_NS = 2_000_000_000
ALL_HEARD = "hears joint_states, ball/position, feed, strategy, rally/outcome$"


@pytest.fixture
def source(ros_node: Node) -> StrokeSource:
    return StrokeSource(ros_node)


def start(launcher: Launcher, source: StrokeSource, directory: Path, **parameters: Any) -> RunningProcess:
    """A recorder that everything is connected to."""
    process = launcher.start("recorder", parameters={"directory": directory, **parameters})
    process.wait_for_line(ALL_HEARD)
    source.wait_for_match()
    if "robot_description" in source.publishers:
        source.publishers["robot_description"].publish(described().data)
    return process


def simulated(number: int = 0, **options: Any) -> list[BagMessage]:
    """A stroke in simulated time, `number` strokes after the first."""
    begin = SIMULATED_START_NS + number * 3_000_000_000
    return stroke_messages(start_ns=begin, **{"ball_id": number + 1, **options})


def assembled(messages: list[BagMessage], label: str = "forehand-push", subject: str = "s01") -> Episode:
    """What the translation makes of the messages as they were sent."""
    assembler = EpisodeAssembler(StrategyLabel.parse(label), subject)
    for message in messages:
        if message.topic == "joint_states":
            assembler.add_joint_state(deserialise(message.data, CONTRACT[message.topic].type_name))
        if message.topic == "ball/position":
            assembler.add_ball_position(deserialise(message.data, CONTRACT[message.topic].type_name))
    return assembler.assemble()


def call(source: StrokeSource, service: str) -> Trigger.Response:
    client = source.node.create_client(Trigger, f"/recorder/{service}")
    assert client.wait_for_service(20.0)
    future = client.call_async(Trigger.Request())
    source.wait_until(future.done, f"answer of {service}")
    return future.result()


def set_parameter(source: StrokeSource, name: str, value: Any) -> Any:
    client = source.node.create_client(SetParameters, "/recorder/set_parameters")
    assert client.wait_for_service(20.0)
    parameter = Parameter(name, value=value).to_parameter_msg()
    future = client.call_async(SetParameters.Request(parameters=[parameter]))
    source.wait_until(future.done, "answer of set_parameters")
    return future.result().results[0]


def test_a_returned_stroke_becomes_a_bag(launcher: Launcher, source: StrokeSource, tmp_path: Path) -> None:
    process = start(launcher, source, tmp_path)
    stroke = simulated()
    source.send(stroke)
    verdict = source.verdict(1)
    path = tmp_path / "s01" / "forehand-push_001"
    assert verdict == {
        "ball_id": "1",
        "kept": "true",
        "reason": "",
        "path": str(path),
        "subject": "s01",
        "detail": "",
        "message": "kept",
        "label": "forehand-push",
    }
    process.wait_for_line(rf"kept forehand-push of s01, ball 1: {path}")
    assert examine(next(path.glob("*.mcap"))) == []
    root = yaml.safe_load((path / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert root["custom_data"]["label"] == "forehand-push"
    assert root["custom_data"]["subject"] == "s01"
    assert root["custom_data"]["outcome"] == "returned"
    assert root["custom_data"]["version"].startswith("msrd_ros ")
    assert sum(file.stat().st_size for file in path.iterdir()) < 200_000

    bag = Bag(path)
    counts = {
        entry["topic_metadata"]["name"]: entry["message_count"] for entry in root["topics_with_message_count"]
    }
    assert set(counts) == {
        "/robot_description", "/tf_static", "/strategy", "/feed",
        "/joint_states", "/ball/position", "/rally/outcome",
    }  # fmt: skip
    # Everything from the pre-roll to the outcome, byte for byte, in the simulation's time.
    first_ns = SIMULATED_START_NS + int((LAUNCH_S - 0.2) * 1e9)
    for topic in ("joint_states", "ball/position"):
        sent = [m.data for m in stroke if m.topic == topic and m.log_time_ns >= first_ns]
        kept = [m for m in bag.raw() if m.topic == f"/{topic}"]
        assert [m.data for m in kept] == sent[-len(kept) :]
        assert len(sent) - len(kept) <= 1
    raw = bag.raw()
    assert raw[-1].topic == "/rally/outcome"
    assert raw[-1].log_time_ns == stroke[-1].log_time_ns
    (episode,) = read_episodes(bag)
    np.testing.assert_array_equal(episode.observations, assembled(stroke).observations)
    np.testing.assert_array_equal(episode.actions, assembled(stroke).actions)


def test_two_strokes_in_real_time_at_1_khz_lose_nothing(
    launcher: Launcher, source: StrokeSource, tmp_path: Path
) -> None:
    """Joint states at 1 kHz and ball at 200 Hz, on the wall clock; the first is written during the second."""
    start(launcher, source, tmp_path, keep="returned")
    begin_ns = time.time_ns() + 1_000_000_000
    strokes = [
        stroke_messages(start_ns=begin_ns, joint_hz=1000.0),
        stroke_messages("backhand-slice", begin_ns + 2_300_000_000, joint_hz=1000.0, ball_id=2),
    ]
    for stroke in strokes:
        source.send_in_time(stroke)
    assert [source.verdict(number)["kept"] for number in (1, 2)] == ["true", "true"]
    for stroke, number in zip(strokes, (1, 2), strict=True):
        messages = Bag(source.verdict(number)["path"]).raw()
        for topic, rate_hz in (("joint_states", 1000.0), ("ball/position", 200.0)):
            kept = [message for message in messages if message.topic == f"/{topic}"]
            sequences = [message.sequence for message in kept]
            assert sequences == list(range(sequences[0], sequences[0] + len(kept)))
            assert len(kept) >= (RALLY_S + 0.15) * rate_hz
            sent = [message.data for message in stroke if message.topic == topic]
            begin = sent.index(kept[0].data)
            assert [message.data for message in kept] == sent[begin : begin + len(kept)]
            assert begin + len(kept) >= len(sent) - 2
    source.diagnostics.clear()
    source.wait_until(lambda: source.diagnostics, "diagnostics")
    assert source.diagnostics["messages_lost"] == "0"
    assert source.diagnostics["kept"] == "2"


def test_refused_strokes_are_counted_by_reason_and_nothing_is_written(
    launcher: Launcher, source: StrokeSource, tmp_path: Path
) -> None:
    process = start(launcher, source, tmp_path)
    flawed = simulated(3)
    middle = len(flawed) // 2
    names = [f"right_j{index}" for index in range(6)]
    pause = [m for m in simulated(7) if m.topic == "joint_states"][300:340]
    balls = {
        "long": simulated(0, miss=MissReason.LONG),
        "missed": simulated(1, miss=MissReason.MISSED),
        "joint_speed": simulated(2, velocity_scale=1.02),
        "bad_joint_states": [
            m._replace(data=joint_state(m.log_time_ns, "", velocity_scale=float("nan")))
            if m.topic == "joint_states" and index > middle
            else m
            for index, m in enumerate(flawed)
        ],
        "no_label": simulated(5, label=""),
        "joint_gap": [m for m in simulated(7) if m not in pause],
    }
    for number, (reason, messages) in enumerate(balls.items(), start=1):
        source.send(messages)
        verdict = source.verdict(number)
        assert (verdict["kept"], verdict["reason"], verdict["path"]) == ("false", reason, "")
        assert verdict["detail"]
        process.wait_for_line(rf"not kept: .*{reason}")
    lacking = [
        m._replace(data=joint_state(m.log_time_ns, "", names=names)) if m.topic == "joint_states" else m
        for m in simulated(8)
    ]
    source.send(lacking)
    assert "right_j6" in source.verdict(7)["detail"]
    # 1 % over the limit is the tolerance.
    source.send(simulated(9, velocity_scale=1.009))
    assert source.verdict(8)["kept"] == "true"
    source.diagnostics.clear()
    source.wait_until(lambda: source.diagnostics, "diagnostics")
    assert source.diagnostics["kept"] == "1"
    assert source.diagnostics["rejected"] == "7"
    assert source.diagnostics["rejected_bad_joint_states"] == "2"
    assert source.diagnostics["rejected_joint_speed"] == "1"
    assert int(source.diagnostics["disk_left_mb"]) > 0
    assert [path.name for path in (tmp_path / "s01").iterdir()] == ["forehand-push_001"]


def test_all_are_kept_on_request_and_marked(launcher: Launcher, source: StrokeSource, tmp_path: Path) -> None:
    start(launcher, source, tmp_path, keep="all")
    source.send(simulated(0, miss=MissReason.NET))
    source.send(simulated(1, velocity_scale=1.5))
    source.send(simulated(2))
    assert [source.verdict(number)["kept"] for number in (1, 2, 3)] == ["false", "false", "true"]
    assert source.verdict(1)["path"].endswith("forehand-push_001")
    library = BagLibrary.scan(tmp_path)
    assert [(bag.kept, bag.outcome) for bag in library.bags] == [
        (False, "net"),
        (False, "returned"),
        (True, "returned"),
    ]
    assert [bag.path.name for bag in library.select()] == ["forehand-push_003"]


def test_strokes_without_a_label_are_kept_on_request_and_else_refused_with_the_way_to_it(
    launcher: Launcher, source: StrokeSource, tmp_path: Path
) -> None:
    start(launcher, source, tmp_path, note="by hand")
    source.send(simulated(0, label=""))
    refused = source.verdict(1)
    assert (refused["reason"], refused["path"]) == ("no_label", "")
    assert refused["detail"].endswith(
        "publish its label on strategy, or keep such strokes with unlabelled:=true"
    )

    assert set_parameter(source, "unlabelled", True).successful
    strokes = [simulated(1, label=""), simulated(2, label="", joint_frame="base_link"), simulated(3)]
    for stroke in strokes:
        source.send(stroke)
    source.send(simulated(4, label="", velocity_scale=1.5))
    names = ["unlabelled_001", "unlabelled_002", "forehand-push_001"]
    for number, name in enumerate(names, start=2):
        verdict = source.verdict(number)
        assert (verdict["kept"], verdict["path"]) == ("true", str(tmp_path / "s01" / name)), verdict
    assert [source.verdict(number)["label"] for number in (2, 3, 4)] == ["", "", "forehand-push"]
    assert source.verdict(5)["reason"] == "joint_speed"
    assert sorted(path.name for path in (tmp_path / "s01").iterdir()) == sorted(names)

    for stroke, name, frame in zip(strokes, names, ("", "base_link"), strict=False):
        bag = Bag(tmp_path / "s01" / name)
        assert (bag.info.unlabelled, bag.info.outcome, bag.info.kept) == (True, "returned", True)
        assert {
            **bag.info.custom_data,
            "label": "",
            "subject": "s01",
            "note": "by hand",
        } == bag.info.custom_data
        frames: dict[str, set[str]] = {}
        for message in bag.raw():
            if message.topic in ("/strategy", "/rally/outcome", "/joint_states"):
                frames.setdefault(message.topic, set()).add(read_frame_id(message.data))
        assert frames == {"/strategy": {""}, "/rally/outcome": {""}, "/joint_states": {frame}}
        (episode,) = read_episodes(bag)
        assert episode.label is None
        np.testing.assert_array_equal(episode.observations, assembled(stroke).observations)


def test_a_driver_without_labels_and_a_best_effort_camera_are_recorded(
    launcher: Launcher, ros_node: Node, tmp_path: Path
) -> None:
    """What ros2_control's broadcaster and a camera with sensor QoS send."""
    source = StrokeSource(ros_node, best_effort=["ball/position"])
    start(launcher, source, tmp_path)
    stroke = simulated(joint_frame="base_link")
    source.send(stroke, rate_hz=1500.0)
    path = Path(source.verdict(1)["path"])
    frames = {
        deserialise(message.data, "sensor_msgs/msg/JointState").header.frame_id
        for message in Bag(path).raw()
        if message.topic == "/joint_states"
    }
    assert frames == {"forehand-push"}
    (episode,) = read_episodes(Bag(path))
    np.testing.assert_array_equal(episode.observations, assembled(stroke).observations)
    root = yaml.safe_load((path / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    offered = {
        entry["topic_metadata"]["name"]: entry["topic_metadata"]["offered_qos_profiles"][0]["reliability"]
        for entry in root["topics_with_message_count"]
    }
    assert (offered["/ball/position"], offered["/joint_states"]) == ("best_effort", "reliable")


def test_the_subject_changes_between_strokes(
    launcher: Launcher, source: StrokeSource, tmp_path: Path
) -> None:
    start(launcher, source, tmp_path)
    source.send(simulated(0))
    source.verdict(1)
    assert set_parameter(source, "subject", "s02").successful
    source.send(simulated(1))
    assert source.verdict(2)["path"] == str(tmp_path / "s02" / "forehand-push_001")
    refused = set_parameter(source, "subject", "../elsewhere")
    assert not refused.successful
    assert "use a-z, 0-9 and _ only" in refused.reason
    assert "can only be set when it starts" in set_parameter(source, "pre_roll_s", 1.0).reason
    source.send(simulated(2))
    assert source.verdict(3)["path"] == str(tmp_path / "s02" / "forehand-push_002")
    assert {bag.subject for bag in BagLibrary.scan(tmp_path).bags} == {"s01", "s02"}


def test_start_stop_and_discard(launcher: Launcher, source: StrokeSource, tmp_path: Path) -> None:
    start(launcher, source, tmp_path, recording=False)
    source.send(simulated(0))
    assert source.verdict(1)["reason"] == "stopped"
    assert call(source, "start").success
    source.send(simulated(1))
    kept = Path(source.verdict(2)["path"])
    answer = call(source, "discard")
    assert answer.success
    assert str(kept) in answer.message
    assert not kept.exists()
    assert (tmp_path / ".discarded" / "s01" / kept.name / "metadata.yaml").is_file()
    stroke = simulated(2)
    source.send(stroke[:700])
    source.diagnostics.clear()
    source.wait_until(lambda: source.diagnostics.get("stroke_under_way") == "true", "stroke under way")
    assert "under way" in call(source, "discard").message
    source.send(stroke[700:])
    assert source.verdict(3)["reason"] == "discarded"
    assert not call(source, "discard").success
    source.send(simulated(3))
    assert source.verdict(4)["kept"] == "true"
    assert call(source, "stop").success
    source.send(simulated(4))
    assert source.verdict(5)["reason"] == "stopped"
    assert len(BagLibrary.scan(tmp_path).bags) == 1


def test_killed_in_mid_stroke_every_accepted_bag_is_whole(
    launcher: Launcher, source: StrokeSource, tmp_path: Path
) -> None:
    process = start(launcher, source, tmp_path)
    for number in range(3):
        source.send(simulated(number))
    assert source.verdict(3)["kept"] == "true"
    source.send(simulated(3)[:600])
    process.kill()
    paths = sorted((tmp_path / "s01").iterdir())
    assert [path.name for path in paths] == [f"forehand-push_{number:03d}" for number in (1, 2, 3)]
    for path in paths:
        assert examine(next(path.glob("*.mcap"))) == []
        assert len(read_episodes(Bag(path))) == 1


def test_a_recorder_alone_on_its_domain_says_so(launcher: Launcher, tmp_path: Path, domain_id: int) -> None:
    process = launcher.start("recorder", parameters={"directory": tmp_path})
    process.wait_for_line(rf"waits for joint_states: start a simulator .*\(on domain {domain_id}\)")
    assert process.stop() == 0


@pytest.mark.usefixtures("domain_id")
def test_what_is_decided_when_the_node_closes_is_kept(tmp_path: Path) -> None:
    rclpy.init(args=["--ros-args", "-p", f"directory:={tmp_path}"])
    try:
        recorder = Recorder()
        source = StrokeSource(Node("test_source"), SENT)
        executor = SingleThreadedExecutor()
        executor.add_node(recorder)

        def spun_until(condition: Callable[[], Any]) -> bool:
            executor.spin_once(timeout_sec=0.05)
            return bool(condition())

        source.wait_until(
            lambda: spun_until(lambda: recorder.diagnose()[1]["hears"] == " ".join(SENT)), "match"
        )
        *flight, outcome = simulated()
        for message in flight:
            source.send([message])
            spun_until(lambda: True)
        for _ in range(300):
            executor.spin_once(timeout_sec=0.001)
        source.send([outcome])
        # Decided and not yet cut: the joint states have not gone past the outcome.
        source.wait_until(lambda: spun_until(lambda: recorder.diagnose()[1]["decided"]), "outcome")
        recorder.close()
        recorder.destroy_node()
        source.node.destroy_node()
    finally:
        try_shutdown()
    assert len(BagLibrary.scan(tmp_path).bags) == 1


def test_lost_messages_are_noticed(launcher: Launcher, source: StrokeSource, tmp_path: Path) -> None:
    """A recorder that is held up for longer than queues last: real losses, found by the sequence numbers."""
    process = start(launcher, source, tmp_path)
    stroke = simulated(joint_hz=1000.0)
    middle = len(stroke) // 4
    source.send(stroke[:middle])
    process.send_signal(signal.SIGSTOP)
    source.send(stroke[middle:-100])
    process.send_signal(signal.SIGCONT)
    source.send(stroke[-100:])
    verdict = source.verdict(1)
    assert verdict["reason"] == "messages_lost", verdict
    source.diagnostics.clear()
    source.wait_until(lambda: source.diagnostics, "diagnostics")
    assert int(source.diagnostics["messages_lost"]) > 0


@pytest.mark.parametrize(
    ("parameter", "words"),
    [
        ("subject:=Jane Doe", ("parameter subject", "a-z, 0-9 and _")),
        ("keep:=some", ("parameter keep", "returned, all")),
        ("pre_roll_s:=-1.0", ("parameter pre_roll_s", "out of range")),
        ("extra_topics:=[camera]", ("extra_topics", "NAME=PACKAGE/msg/TYPE")),
        ("extra_topics:=[camera=my_msgs/msg/Image]", ("extra_topics", "unknown")),
        ("directory:=/dev/null/bags", ("parameter directory", "cannot be written")),
    ],
)
@pytest.mark.usefixtures("domain_id", "tidy")
def test_wrong_parameters_are_refused_by_name(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], parameter: str, words: tuple[str, ...]
) -> None:
    assert main(["--ros-args", "-p", f"directory:={tmp_path}", "-p", parameter]) == 2
    (line,) = capfd.readouterr().err.splitlines()
    assert line.startswith("recorder: error: ")
    assert all(word in line for word in words), line


@pytest.fixture
def tidy() -> Iterator[None]:
    """What an executable leaves behind in this process is cleared away: signal handlers, a node half made."""
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in handlers.items():
        signal.signal(number, handler)
    gc.collect()


def test_extra_topics_are_recorded_and_a_full_disk_is_told(
    launcher: Launcher, ros_node: Node, tmp_path: Path
) -> None:
    source = StrokeSource(ros_node, topics=[*SENT, "ball/odometry"])
    full = {"directory": tmp_path / "full", "minimum_free_mb": 1e9, "subject": "s02"}
    launcher.start("recorder", parameters=full).wait_for_line(ALL_HEARD)
    extra = "[ball/odometry, stray=std_msgs/msg/Header]"
    start(launcher, source, tmp_path / "room", extra_topics=extra)
    both = [source.publishers[topic] for topic in SENT]
    source.wait_until(lambda: all(item.get_subscription_count() >= 2 for item in both), "both recorders")
    truth = [BagMessage("ball/odometry", m.data, m.log_time_ns, 0) for m in simulated() if m.topic == "feed"]
    source.send(sorted([*simulated(), *truth], key=lambda message: message.log_time_ns))
    source.verdict(2)
    verdicts = {verdict["subject"]: verdict for verdict in source.verdicts}
    assert verdicts["s02"]["reason"] == "disk_full"
    assert list((tmp_path / "full").iterdir()) == []
    assert verdicts["s01"]["kept"] == "true", verdicts["s01"]
    assert "/ball/odometry" in Bag(verdicts["s01"]["path"]).info.types

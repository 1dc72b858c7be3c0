"""The player, as a process of its own, heard by real subscribers."""

from __future__ import annotations

import signal
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import deserialize_message
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as RosbagWriter
from rosgraph_msgs.msg import Clock

from msrd_ros.bags.cdr import read_frame_id
from msrd_ros.bags.reader import Bag
from msrd_ros.bags.schemas import typestore
from msrd_ros.bags.writer import keep_stroke, write_bag
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.contract.topics import CONTRACT, BagMessage
from msrd_ros.contract.translation import EpisodeAssembler
from msrd_ros.core.errors import UserError
from msrd_ros.nodes.player import main
from msrd_ros.nodes.recorder_inputs import import_message_type
from msrd_ros.recordings.episodes import read_episodes
from processes import Launcher, RunningProcess
from stroke_source import message_class
from synthetic_strokes import START_NS, at_root, described, stroke_messages, topics_of

pytestmark = pytest.mark.processes

HEARD = ("joint_states", "ball/position", "feed", "strategy", "rally/outcome", "robot_description")


class Listener:
    """Hears all topics as bytes, with the wall time of their arrival."""

    def __init__(self, node: Node, topics: tuple[str, ...] = HEARD) -> None:
        self._executor = SingleThreadedExecutor(context=node.context)
        self._executor.add_node(node)
        self.messages: dict[str, list[bytes]] = {topic: [] for topic in topics}
        self.sent_ns: dict[str, list[int]] = {topic: [] for topic in topics}
        self.lost = 0
        self.clock_ns: list[int] = []
        self._sequence: dict[str, int] = {}
        for topic in topics:
            durability = (
                DurabilityPolicy.TRANSIENT_LOCAL if CONTRACT[topic].latched else DurabilityPolicy.VOLATILE
            )
            node.create_subscription(
                message_class(CONTRACT[topic].type_name),
                topic,
                self._take(topic),
                QoSProfile(depth=1000, durability=durability),
                raw=True,
            )
        node.create_subscription(Clock, "/clock", self._on_clock, QoSProfile(depth=10000))

    def hear(self, process: RunningProcess, timeout_s: float = 60.0) -> None:
        """Listen until the player has ended."""
        deadline = time.monotonic() + timeout_s
        while process.running:
            assert time.monotonic() < deadline, process.output
            self._executor.spin_once(timeout_sec=0.05)
        for _ in range(1000):
            self._executor.spin_once(timeout_sec=0.0)

    def _take(self, topic: str) -> Any:
        def take(data: bytes, info: dict[str, int]) -> None:
            self.messages[topic].append(data)
            self.sent_ns[topic].append(info["source_timestamp"])
            number = info["publication_sequence_number"]
            self.lost += number - self._sequence.get(topic, number - 1) - 1
            self._sequence[topic] = number

        return take

    def _on_clock(self, message: Clock) -> None:
        self.clock_ns.append(message.clock.sec * 10**9 + message.clock.nanosec)


@pytest.fixture
def listener(ros_node: Node) -> Listener:
    return Listener(ros_node)


def keep(
    root: Path, label: str = "forehand-push", subject: str = "s01", number: int = 0, **facts: str
) -> Path:
    stroke = [described(), *stroke_messages(label, START_NS + number * 3_000_000_000, ball_id=number)]
    strategy = StrategyLabel.parse(label)
    return keep_stroke(
        root, subject, strategy, topics_of(stroke), at_root(stroke), {"outcome": "returned", **facts}
    )


def of(messages: list[BagMessage], topic: str) -> list[bytes]:
    """The bytes of a topic as DDS hands them on: padded to four."""
    found = [message.data for message in messages if message.topic == f"/{topic}"]
    return [data + bytes(-len(data) % 4) for data in found]


def test_a_bag_is_played_byte_for_byte_in_its_own_time(
    launcher: Launcher, listener: Listener, tmp_path: Path
) -> None:
    path = keep(tmp_path)
    process = launcher.start("player", parameters={"bags": f"[{path}]"})
    listener.hear(process)
    assert process.wait() == 0, process.output
    messages = Bag(path).raw()
    for topic in HEARD:
        assert [data + bytes(-len(data) % 4) for data in listener.messages[topic]] == of(messages, topic)
    assert listener.lost == 0
    assert listener.sent_ns["rally/outcome"][-1] == max(times[-1] for times in listener.sent_ns.values())
    recorded = np.array([m.log_time_ns for m in messages if m.topic == "/joint_states"])
    played = np.array(listener.sent_ns["joint_states"])
    late_s = (played - recorded - (played - recorded).min()) / 1e9
    # Some milliseconds on a free machine; others may use this one as well.
    assert np.median(late_s) < 0.05
    assert played[-1] - played[0] == pytest.approx(recorded[-1] - recorded[0], abs=0.2e9)
    assert listener.clock_ns[0] == messages[0].log_time_ns
    assert listener.clock_ns == sorted(listener.clock_ns)
    assert listener.clock_ns[-1] > messages[-1].log_time_ns - 10_000_000
    total = sum(len(of(messages, topic)) for topic in HEARD)
    process.wait_for_line(rf"played 1 bags, {total} messages in [23]\.\d s")


def test_as_fast_as_it_goes_nothing_is_lost_and_arrays_are_the_same(
    launcher: Launcher, listener: Listener, tmp_path: Path
) -> None:
    labels = ["forehand-push", "backhand-topspin", "forehand-slice"]
    paths = [keep(tmp_path, label, number=number) for number, label in enumerate(labels)]
    process = launcher.start("player", parameters={"bags": f"[{tmp_path}]", "rate": 0.0, "clock": False})
    listener.hear(process)
    assert process.wait() == 0, process.output
    assert listener.lost == 0
    assert listener.clock_ns == []
    in_order = [paths[labels.index(name)] for name in sorted(labels)]
    bags = [Bag(path) for path in in_order]
    assert [read_frame_id(data) for data in listener.messages["strategy"]] == sorted(labels)
    joints, balls = list(listener.messages["joint_states"]), list(listener.messages["ball/position"])
    for bag, label in zip(bags, sorted(labels), strict=True):
        assembler = EpisodeAssembler(StrategyLabel.parse(label))
        raw = bag.raw()
        for _ in of(raw, "joint_states"):
            message = deserialize_message(joints.pop(0), message_class("sensor_msgs/msg/JointState"))
            assembler.add_joint_state(message)
        for _ in of(raw, "ball/position"):
            message = deserialize_message(balls.pop(0), message_class("geometry_msgs/msg/PointStamped"))
            assembler.add_ball_position(message)
        (from_disk,) = read_episodes(bag)
        np.testing.assert_array_equal(assembler.assemble().observations, from_disk.observations)
        np.testing.assert_array_equal(assembler.assemble().actions, from_disk.actions)
    assert joints == balls == []
    # Three bags close with their outcomes; the robot is described once.
    assert len(listener.messages["rally/outcome"]) == 3
    assert len(listener.messages["robot_description"]) == 1


def test_a_choice_is_played_and_broken_bags_are_named(
    launcher: Launcher, listener: Listener, tmp_path: Path
) -> None:
    keep(tmp_path, "forehand-push", "s01")
    wanted = keep(tmp_path, "backhand-push", "s01", number=1)
    keep(tmp_path, "backhand-push", "s02", number=2)
    keep(tmp_path, "backhand-push", "s01", number=3, kept="false")
    torn = keep(tmp_path, "backhand-push", "s01", number=4)
    file = next(torn.glob("*.mcap"))
    file.write_bytes(file.read_bytes()[:20_000])
    gone = keep(tmp_path, "backhand-push", "s01", number=5)
    (gone / "metadata.yaml").write_text("{")
    parameters = {"bags": f"[{tmp_path}]", "labels": "[backhand-push]", "subjects": "[s01]", "rate": 20.0}
    process = launcher.start("player", parameters=parameters)
    listener.hear(process)
    assert process.wait() == 0
    assert listener.messages["joint_states"] == of(Bag(wanted).raw(), "joint_states")
    process.wait_for_line(rf"left out: bag {gone}: metadata.yaml is not readable")
    process.wait_for_line(rf"left out: bag {torn}: is cut off or damaged")
    process.wait_for_line("played 1 bags, .*, 1 left out")


def test_strokes_without_a_label_are_chosen_and_played_with_an_empty_one(
    launcher: Launcher, listener: Listener, tmp_path: Path
) -> None:
    keep(tmp_path)
    bare = stroke_messages("")
    said = keep_stroke(tmp_path, "s01", None, topics_of(bare), at_root(bare), {})
    # Its recorder has never heard a strategy.
    silent = [message for message in bare if message.topic != "strategy"]
    other = keep_stroke(tmp_path, "s02", None, topics_of(silent), at_root(silent), {})
    parameters = {"bags": f"[{tmp_path}]", "labels": "[unlabelled]", "rate": 20.0}
    process = launcher.start("player", parameters=parameters)
    listener.hear(process)
    assert process.wait() == 0, process.output
    process.wait_for_line("played 2 bags")
    assert [path.name for path in (said, other)] == ["unlabelled_001"] * 2
    for topic in ("strategy", "rally/outcome"):
        assert {read_frame_id(data) for data in listener.messages[topic]} == {""}
    assert len(listener.messages["strategy"]) == len(listener.messages["rally/outcome"]) == 2
    assert len(listener.messages["joint_states"]) == 2 * len(of(Bag(said).raw(), "joint_states"))


def test_topics_of_others_are_passed_over_by_name(
    launcher: Launcher, listener: Listener, tmp_path: Path
) -> None:
    stroke = at_root(stroke_messages())
    path = tmp_path / "session"
    foreign = {"/odd": "test_msgs/msg/BasicTypes", "/module": "antigravity/msg/Comic", "/no type": "os/path"}
    names = dict.fromkeys(message.topic for message in stroke)
    with RosbagWriter(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connections = {
            name: writer.add_connection(name, CONTRACT[name.lstrip("/")].type_name, typestore=typestore())
            for name in names
        }
        for name, kind in foreign.items():
            connections[name] = writer.add_connection(name, kind, msgdef="bool flag", rihs01="RIHS01_0")
        for message in stroke:
            writer.write(connections[message.topic], message.log_time_ns, message.data)
        for name in foreign:
            writer.write(connections[name], stroke[-1].log_time_ns, b"\0\1\0\0\1")
    process = launcher.start("player", parameters={"bags": f"[{path}]", "rate": 10.0})
    listener.hear(process)
    assert process.wait() == 0, process.output
    assert len(listener.messages["rally/outcome"]) == 1
    for name in foreign:
        process.wait_for_line(f"topic {name} is not played")
    assert "played 1 bags" in process.output
    assert "Traceback" not in process.output


@pytest.mark.parametrize(
    "name",
    ["os/path", "antigravity/msg/Comic", "std_msgs/srv/Empty", "std_msgs.msg/String", "sys/msg/Path", "",
     "std_msgs/msg/../String", "msrd_ros/msg/Table", "std_msgs/msg/__doc__"],
)  # fmt: skip
def test_only_classes_of_messages_are_imported(name: str) -> None:
    before = set(sys.modules)
    with pytest.raises(UserError, match="message type"):
        import_message_type(name)
    assert set(sys.modules) == before
    assert import_message_type("nav_msgs/msg/Odometry").__name__ == "Odometry"


def test_a_label_that_only_the_name_tells_is_sent_as_strategy(
    launcher: Launcher, listener: Listener, tmp_path: Path
) -> None:
    silent = [
        message
        for message in stroke_messages(joint_frame="base_link")
        if message.topic in ("joint_states", "ball/position")
    ]
    path = tmp_path / "backhand-slice_001"
    write_bag(path, topics_of(silent, "/lab"), at_root(silent, "/lab"), {})
    process = launcher.start("player", parameters={"bags": f"[{path}]", "rate": 0.0})
    listener.hear(process)
    assert process.wait() == 0
    assert [read_frame_id(data) for data in listener.messages["strategy"]] == ["backhand-slice"]
    assert len(listener.messages["joint_states"]) == len(of(Bag(path).raw(), "lab/joint_states"))


def test_what_is_played_can_be_recorded_again(launcher: Launcher, tmp_path: Path) -> None:
    labels = ("forehand-push", "backhand-slice")
    paths = [keep(tmp_path / "first", label, number=number) for number, label in enumerate(labels)]
    recorder = launcher.start("recorder", parameters={"directory": tmp_path / "second"})
    recorder.wait_for_line("ready")
    player = launcher.start("player", parameters={"bags": f"[{tmp_path / 'first'}]", "rate": 0.0})
    for path in paths:
        recorder.wait_for_line(f"kept {path.name[:-4]} of s01")
    assert player.wait() == 0, player.output
    assert recorder.stop() == 0
    for path in paths:
        (before,), (after,) = (
            read_episodes(Bag(tmp_path / root / "s01" / path.name)) for root in ("first", "second")
        )
        np.testing.assert_array_equal(before.observations, after.observations)
        np.testing.assert_array_equal(before.actions, after.actions)


def test_without_subscribers_it_says_so_and_plays(launcher: Launcher, tmp_path: Path) -> None:
    path = keep(tmp_path)
    process = launcher.start("player", parameters={"bags": f"[{path}]", "rate": 0.0, "wait_s": 0.1})
    assert process.wait() == 0
    assert "nobody subscribes to joint_states and ball/position" in process.output
    assert "played 1 bags" in process.output


def test_a_loop_goes_on_until_it_is_told_to_stop(
    launcher: Launcher, listener: Listener, tmp_path: Path
) -> None:
    path = keep(tmp_path)
    process = launcher.start("player", parameters={"bags": f"[{path}]", "rate": 50.0, "loop": True})
    process.wait_for_line("playing bag 3")
    assert process.stop(signal.SIGINT) == 0
    assert "Traceback" not in process.output


@pytest.fixture
def tidy() -> Iterator[None]:
    """An executable run in this process leaves its signal handlers behind; put ours back."""
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in handlers.items():
        signal.signal(number, handler)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["bags:=[{root}/nowhere]"], ("nowhere", "does not exist")),
        (["bags:=[{root}/empty]"], ("empty", "holds no bags")),
        (["bags:=[{root}/some]", "labels:=[Smash]"], ("parameter labels", "no strategy label")),
        (["bags:=[{root}/some]", "labels:=[backhand-push]"], ("no bag fits", "forehand-push")),
        (["bags:=[{root}/some]", "rate:=-1.0"], ("parameter rate", "out of range")),
        (["bags:=[{root}/some]", "topics:=[joints]"], ("parameter topics", "NAME:=NAME_IN_BAG")),
    ],
)
@pytest.mark.usefixtures("domain_id", "tidy")
def test_wrong_parameters_are_refused_by_name(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], arguments: list[str], words: tuple[str, ...]
) -> None:
    (tmp_path / "empty").mkdir()
    keep(tmp_path / "some")
    command = ["--ros-args"]
    for argument in arguments:
        command += ["-p", argument.format(root=tmp_path)]
    assert main(command) == 2
    (line,) = capfd.readouterr().err.splitlines()
    assert line.startswith("player: error: ")
    assert all(word in line for word in words), line

"""What a user may get wrong: one clear line on what, where and what to do, exit status 2, no traceback."""

from __future__ import annotations

import gc
import re
import shutil
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from edited_bags import edited, messages_of, write
from made_up_policies import made_up_policies, with_columns
from msrd_ros.bags.writer import write_bag
from msrd_ros.core.resources import shipped_bags
from msrd_ros.nodes import demonstrator, evaluator, executor, simulator, trainer
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS
from synthetic_strokes import at_root, stroke_messages, topics_of

pytestmark = pytest.mark.slow

NODES = {
    "simulator": simulator.main,
    "executor": executor.main,
    "evaluator": evaluator.main,
    "demonstrator": demonstrator.main,
    "trainer": trainer.main,
}


@pytest.fixture(autouse=True)
def tidy(domain_id: int) -> Iterator[None]:
    """What an executable leaves behind in this process is cleared away: signal handlers, a node half made."""
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in handlers.items():
        signal.signal(number, handler)
    gc.collect()


def error_line(capfd: pytest.CaptureFixture[str], name: str, *parameters: str) -> str:
    """Start an executable with parameters that cannot be, and return what it says."""
    words = [word for parameter in parameters for word in ("-p", parameter)]
    assert NODES[name](["--ros-args", *words]) == 2
    captured = capfd.readouterr().err
    assert "Traceback" not in captured
    lines = [
        line[line.index(f"{name}: error: ") :] for line in captured.splitlines() if f"{name}: error: " in line
    ]
    assert len(lines) == 1, captured
    return lines[0]


@pytest.mark.parametrize(
    ("name", "parameter", "words"),
    [
        (
            "simulator",
            "camera_noise_m:=-1.0",
            ("parameter camera_noise_m of simulator", "out of range", "0.0 to 0.1 m"),
        ),
        (
            "simulator",
            "camera_rate_hz:=fast",
            ("parameter camera_rate_hz of simulator", "'fast' has the wrong type", "double"),
        ),
        (
            "simulator",
            "mode:=free",
            ("parameter mode of simulator", "'free' is unknown", "lockstep, real_time"),
        ),
        ("simulator", "seed:=1.5", ("parameter seed of simulator", "wrong type", "integer")),
        (
            "executor",
            "stale_timeout_s:=60",
            ("parameter stale_timeout_s of executor", "out of range", "0.02 to 5.0 s"),
        ),
        (
            "evaluator",
            "labels:=[forehand-push, Forehand Lob]",
            ("parameter labels of evaluator", "'Forehand Lob'", "my-smash"),
        ),
        ("evaluator", "balls:=0", ("parameter balls of evaluator", "out of range")),
        ("demonstrator", "subjects:=[1]", ("parameter subjects of demonstrator", "wrong type")),
        (
            "demonstrator",
            "spread:=huge",
            ("parameter spread of demonstrator", "'huge' is unknown", "none, easy, standard"),
        ),
        ("trainer", "labels:=[Forehand Lob]", ("parameter labels of trainer", "'Forehand Lob'")),
        ("trainer", "labels:=[forehand-lob]", ("no bag fits the selection", "backhand-topspin")),
        ("trainer", "method:=gail", ("parameter method of trainer", "'gail' is unknown", "msrd", "airl")),
        ("trainer", "out:=/dev/null/runs", ("parameter out of trainer", "cannot be written", "give another")),
    ],
)
def test_wrong_parameters_are_refused_by_name(
    capfd: pytest.CaptureFixture[str], name: str, parameter: str, words: tuple[str, ...]
) -> None:
    line = error_line(capfd, name, parameter)
    assert all(word in line for word in words), line


def test_checkpoints_that_do_not_fit_are_refused_with_what_differs(
    capfd: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    path = tmp_path / "policies.safetensors"
    policies = made_up_policies(ALL_LABELS[:1])
    names = (*policies.policies.layout.observation_names[:12], "wind")
    path.write_bytes(with_columns(policies, observation_names=names).to_bytes())
    line = error_line(capfd, "executor", f"checkpoint:={path}")
    assert f"{path}: does not fit: observations: lacks ball_velocity_z_m_s and has wind too many" in line
    assert "train for this layout" in line
    whole = policies.to_bytes()
    for damaged, words in ((whole[:-40], "damaged checkpoint"), (b"", "not a checkpoint of msrd_ros")):
        path.write_bytes(damaged)
        line = error_line(capfd, "executor", f"checkpoint:={path}")
        assert str(path) in line
        assert words in line
    line = error_line(capfd, "evaluator", f"checkpoint:={tmp_path / 'gone'}")
    assert f"{tmp_path / 'gone'}: cannot read the checkpoint (No such file or directory); train one" in line


def test_folders_that_teach_nothing_are_refused(capfd: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    out = f"out:={tmp_path / 'out'}"
    empty = tmp_path / "empty"
    empty.mkdir()
    line = error_line(capfd, "trainer", out, f"bags:={empty}")
    assert f"folder {empty}: holds no bags; record some" in line
    line = error_line(capfd, "trainer", out, f"bags:={tmp_path / 'gone'}")
    assert f"folder {tmp_path / 'gone'}: does not exist" in line

    torn = tmp_path / "torn"
    shutil.copytree(next(shipped_bags().glob("*/forehand-push_001")), torn / "forehand-push_001")
    file = next((torn / "forehand-push_001").glob("*.mcap"))
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    line = error_line(capfd, "trainer", out, f"bags:={torn}")
    assert f"bag {torn / 'forehand-push_001'}: is cut off or damaged" in line

    silent = [
        m for m in stroke_messages(joint_frame="base_link") if m.topic in ("joint_states", "ball/position")
    ]
    nameless = tmp_path / "nameless"
    write_bag(nameless / "a_recording", topics_of(silent), at_root(silent), {})
    line = error_line(capfd, "trainer", out, f"bags:={nameless}")
    assert str(nameless / "a_recording") in line
    assert "label" in line

    line = error_line(capfd, "trainer", out, f"bags:={shipped_bags()}", "subjects:=[nobody]")
    assert "no bag fits the selection" in line
    assert "subject_01" in line


def test_one_bad_bag_of_many_is_named_and_the_rest_is_trained(
    capfd: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    bags = tmp_path / "bags"
    for number in (1, 2, 3):
        renamed = [m._replace(topic=m.topic.replace("/joint_states", "/arm/joints")) for m in messages_of()]
        types = {"/arm/joints": "sensor_msgs/msg/JointState"}
        write(bags / f"forehand-push_{number:03d}", renamed, types)
    spoilt = bags / "forehand-push_002"
    shutil.rmtree(spoilt)
    degrees = edited(messages_of(), {"joint_states": in_degrees})
    write(spoilt, [m._replace(topic=m.topic.replace("/joint_states", "/arm/joints")) for m in degrees], types)
    torn = next((bags / "forehand-push_003").glob("*.mcap"))
    torn.write_bytes(torn.read_bytes()[:9000])
    # The remedy that the error names works where it is shown.
    out = f"out:={tmp_path / 'out'}"
    line = error_line(capfd, "trainer", out, f"bags:={bags}")
    (remedy,) = re.findall(r"topics:='\S+'", line)
    words = [out, f"bags:={bags}", remedy.replace("NAME", "/arm/joints").replace("'", ""), "iterations:=0"]
    assert trainer.main(["--ros-args", *(word for entry in words for word in ("-p", entry))]) == 0
    said = capfd.readouterr().err
    assert "1 demonstrations from" in said
    assert "2 left out" in said
    assert f"left out: bag {spoilt}: joint_limit" in said
    assert f"left out: bag {torn.parent}: is cut off or damaged" in said


def in_degrees(message: Any, _: int) -> Any:
    message.position, message.velocity = np.degrees(message.position), np.degrees(message.velocity)
    return message


def test_nothing_to_go_on_from_is_said(capfd: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    line = error_line(capfd, "trainer", f"out:={tmp_path}", "resume:=true", "labels:=[forehand-push]")
    assert str(tmp_path / "checkpoint.safetensors") in line


def test_a_run_is_not_lost_by_a_repeated_command(capfd: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    held = tmp_path / "policies.safetensors"
    held.write_bytes(b"work")
    line = error_line(capfd, "trainer", f"out:={tmp_path}")
    assert f"parameter out of trainer: {tmp_path} holds a run already (policies.safetensors)" in line
    assert "resume:=true to go on with it, or overwrite:=true to lose it" in line
    assert held.read_bytes() == b"work"
    # Asked for, it goes on to what is wrong next.
    line = error_line(capfd, "trainer", f"out:={tmp_path}", "overwrite:=true", f"bags:={tmp_path / 'gone'}")
    assert "does not exist" in line


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("evaluator", "nobody publishes rally/outcome; start it, or set the same ROS_DOMAIN_ID"),
        ("demonstrator", "nobody offers simulator/teach; start it, or set the same ROS_DOMAIN_ID"),
    ],
)
def test_without_a_simulator_the_domain_is_named(
    capfd: pytest.CaptureFixture[str], domain_id: int, name: str, words: str
) -> None:
    line = error_line(capfd, name, "timeout_s:=0.5")
    assert f"no simulator on domain {domain_id}: {words}" in line

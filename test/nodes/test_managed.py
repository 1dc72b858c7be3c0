"""Nodes with a life cycle: states, refusals, errors, nothing left behind; a stack that is told."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import rclpy
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from msrd_ros.core.errors import UserError
from msrd_ros.core.parameters import parameter
from msrd_ros.nodes.common import STATE, steady_timer
from msrd_ros.nodes.managed import LIFECYCLE_SERVICES, ManagedNode, autostart_parameter
from msrd_ros.stack.doctor import main as doctor
from msrd_ros.stack.processes import ros_arguments
from stack import START_TIMEOUT_S, Stack

CONFIGURE, CLEANUP = Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_CLEANUP
ACTIVATE, DEACTIVATE = Transition.TRANSITION_ACTIVATE, Transition.TRANSITION_DEACTIVATE
SHUTDOWN = Transition.TRANSITION_INACTIVE_SHUTDOWN
PATIENCE = 5
"""How often the doctor may look again on a loaded machine."""
WAY_ON = "call /lamp/change_state (ros2 lifecycle set /lamp"


@dataclass(frozen=True)
class LampConfig:
    fails: str = parameter("", "Step that fails", live=True)
    error: str = parameter("user", "How it fails", choices=("user", "other"), live=True)
    autostart: bool = autostart_parameter()


class Lamp(ManagedNode):
    """Tells of its steps, and fails where it is told to."""

    config: LampConfig

    def __init__(self, context: Context) -> None:
        self.steps: list[str] = []
        self.said: list[str] = []
        super().__init__("lamp", LampConfig, context=context)

    def get_logger(self) -> Any:
        return self

    def error(self, line: str) -> None:
        self.said.append(line)

    warning = error

    def info(self, line: str) -> None:
        """Of no interest."""

    def configure(self) -> None:
        self._held.callback(self.steps.append, "given back")
        self.create_publisher(JointState, "joint_states", STATE)
        self.create_service(Trigger, "~/burn", lambda _, response: response)
        steady_timer(self, 100.0, lambda: None)
        self.on_change(lambda: self.steps.append("changed"), "error")
        self._step("configure")

    def activate(self) -> None:
        self._step("activate")

    def deactivate(self) -> None:
        self._step("deactivate")

    def _step(self, name: str) -> None:
        self.steps.append(name if self.active else f"{name} while not active")
        if self.config.fails == name:
            raise (UserError if self.config.error == "user" else KeyError)("no bulb; screw one in")

    @property
    def told(self) -> tuple[str, list[str]]:
        message, _, waits = self.account()
        return message, waits


@contextmanager
def context(domain_id: int, **parameters: object) -> Iterator[Context]:
    one = Context()
    rclpy.init(args=ros_arguments(parameters), context=one, domain_id=domain_id)
    try:
        yield one
    finally:
        one.try_shutdown()


@pytest.fixture
def lamp(domain_id: int) -> Iterator[Lamp]:
    with context(domain_id, autostart=False) as one:
        node = Lamp(one)
        yield node
        node.close()
        node.destroy_node()  # type: ignore[no-untyped-call]


def parts(node: Node) -> list[int]:
    """How many timers, subscriptions and so on a node has."""
    kinds = node.timers, node.subscriptions, node.services, node.clients, node.guards, node.publishers
    return [len(list(kind)) for kind in kinds]


def test_by_itself_it_configures_and_activates(domain_id: int) -> None:
    with context(domain_id) as one:
        node = Lamp(one)
        assert (node.state, node.active) == ("active", True)
        assert node.steps == ["configure while not active", "activate"]
        assert node.told == ("running", [])
        node.close()
        node.close()
        assert node.steps[2:] == ["given back"]
        node.destroy_node()  # type: ignore[no-untyped-call]


@pytest.mark.parametrize("step", ["configure", "activate"])
@pytest.mark.parametrize("error", ["user", "other"])
def test_an_error_at_a_start_by_itself_is_raised_as_it_is(domain_id: int, step: str, error: str) -> None:
    with context(domain_id, fails=step, error=error) as one:
        with pytest.raises(UserError if error == "user" else KeyError, match="no bulb"):
            Lamp(one)


def test_one_that_waits_says_for_what(lamp: Lamp) -> None:
    assert lamp.steps == []
    assert lamp.told == ("unconfigured", [f"leave to configure: {WAY_ON} configure)"])
    with pytest.raises(UserError, match="lamp is unconfigured; call /lamp/change_state"):
        lamp.require_active()
    lamp.trigger_configure()  # type: ignore[no-untyped-call]
    assert lamp.told == ("inactive, running", [f"leave to activate: {WAY_ON} activate)"])
    response = Trigger.Response()
    assert lamp.refuses(response)
    assert response.message.startswith("lamp is inactive; ")
    lamp.trigger_shutdown()  # type: ignore[no-untyped-call]
    assert lamp.told == ("finalized", ["leave to begin anew: end it and start it again"])


def test_twenty_times_round_leave_nothing_behind(lamp: Lamp) -> None:
    before = parts(lamp)
    for _ in range(20):
        for trigger in (lamp.trigger_configure, lamp.trigger_activate):
            trigger()  # type: ignore[no-untyped-call]
        inside = parts(lamp)
        for trigger in (lamp.trigger_deactivate, lamp.trigger_cleanup):
            trigger()  # type: ignore[no-untyped-call]
        assert parts(lamp) == before
        # Timer, service and publisher.
        assert sum(inside) == sum(before) + 3
    assert lamp.steps.count("given back") == 20
    assert lamp.set_parameters_atomically([Parameter("error", value="other")]).successful
    assert "changed" not in lamp.steps


def test_simulated_time_that_was_asked_for_meanwhile_outlives_a_clean_up(lamp: Lamp) -> None:
    lamp.trigger_configure()  # type: ignore[no-untyped-call]
    lamp.set_parameters_atomically([Parameter("use_sim_time", value=True)])
    lamp.trigger_cleanup()  # type: ignore[no-untyped-call]
    assert "/clock" in [subscription.topic_name for subscription in lamp.subscriptions]


@pytest.mark.parametrize(
    ("fails", "error", "asked", "state"),
    [
        ("configure", "user", (CONFIGURE,), "unconfigured"),
        ("configure", "other", (CONFIGURE,), "unconfigured"),
        ("activate", "user", (CONFIGURE, ACTIVATE), "inactive"),
        ("activate", "other", (CONFIGURE, ACTIVATE), "unconfigured"),
        ("deactivate", "user", (CONFIGURE, ACTIVATE, DEACTIVATE), "unconfigured"),
        ("", "", (ACTIVATE,), "unconfigured"),
        ("", "", (77,), "unconfigured"),
        ("", "", (CONFIGURE, CONFIGURE), "inactive"),
        ("", "", (CONFIGURE, SHUTDOWN, CONFIGURE), "finalized"),
    ],
)
def test_the_service_answers_truly(
    lamp: Lamp, fails: str, error: str, asked: tuple[int, ...], state: str
) -> None:
    """The last of what is asked fails: the answer says so, the node lives on, and tells why."""
    before = parts(lamp)
    if fails:
        lamp.change("fails", fails)
        lamp.change("error", error)
    node = Node("asker", context=lamp.context)
    executor = SingleThreadedExecutor(context=lamp.context)
    executor.add_node(lamp)
    executor.add_node(node)

    def call(kind: Any, service: str, request: Any) -> Any:
        client = node.create_client(kind, service)
        assert client.wait_for_service(20.0)
        future = client.call_async(request)
        executor.spin_until_future_complete(future, 20.0)
        return future.result()

    answers = [
        call(ChangeState, "lamp/change_state", ChangeState.Request(transition=Transition(id=number))).success
        for number in asked
    ]
    assert answers == [True] * (len(asked) - 1) + [False]
    answer = call(GetState, "lamp/get_state", GetState.Request())
    assert answer.current_state.label == lamp.state == state
    assert not lamp.active
    if state == "unconfigured":
        assert parts(lamp) == before
    if fails:
        assert "no bulb; screw one in" in lamp.said[-1]
        assert ("Traceback" in lamp.said[-1]) == (error == "other")
        assert lamp.told[1][0].startswith("what was refused: ")
        assert "no bulb, screw one in" in lamp.told[1][0]
        lamp.change("fails", "")
        again = Transition(label="activate" if state == "inactive" else "configure")
        assert call(ChangeState, "lamp/change_state", ChangeState.Request(transition=again)).success
        assert len(lamp.told[1]) == (state != "inactive")
    else:
        assert "does not lead on from" in lamp.said[-1]
    node.destroy_node()
    executor.shutdown()


def test_the_reference_lists_what_rclpy_offers(lamp: Lamp) -> None:
    offered = dict(lamp.get_service_names_and_types_by_node("lamp", "/"))
    for name, kind in LIFECYCLE_SERVICES.items():
        assert offered[name.replace("~", "/lamp")] == [f"lifecycle_msgs/srv/{kind}"]
    kinds = [kind for kinds in offered.values() for kind in kinds if kind.startswith("lifecycle_msgs")]
    assert len(kinds) == len(LIFECYCLE_SERVICES)


@pytest.mark.processes
def test_a_stack_is_told_over_services(
    stack: Stack, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def ask(node: str, number: int) -> bool:
        request = ChangeState.Request(transition=Transition(id=number))
        return bool(stack.call(ChangeState, f"{node}/change_state", request, START_TIMEOUT_S).success)

    recorder = stack.start("recorder", autostart=False, directory=tmp_path / "file" / "bags")
    simulator = stack.start("simulator", autostart=False, show=False)
    executor = stack.start("executor", autostart=False)
    (tmp_path / "file").touch()
    # What cannot be configured says so, and may be once it can.
    assert not ask("recorder", CONFIGURE)
    recorder.wait_for_line("configure was refused, it is unconfigured: parameter directory of recorder")
    assert "cannot be written" in stack.diagnosed("recorder")["waits_for"]
    (tmp_path / "file").unlink()
    assert ask("recorder", CONFIGURE)
    assert not stack.trigger("recorder/start").success

    ticks: list[JointState] = []
    stack.node.create_subscription(JointState, "joint_states", ticks.append, STATE)
    assert ask("simulator", CONFIGURE)
    assert not stack.trigger("simulator/serve").success
    assert stack.diagnosed("executor")["message"] == "unconfigured"
    wanted = [
        f"call /{name}/change_state (ros2 lifecycle set /{name} {step})"
        for name, step in (("executor", "configure"), ("simulator", "activate"), ("recorder", "activate"))
    ]
    for _ in range(PATIENCE):
        doctor(["--domain", str(stack.domain_id), "--json", "--wait", "4"])
        found = [finding["remedy"] for finding in json.loads(capsys.readouterr().out)["findings"]]
        missing = [text for text in wanted if not any(text in remedy for remedy in found)]
        if not missing:
            break
    assert not missing, found
    assert ticks == []

    for name, number in (("executor", CONFIGURE), ("executor", ACTIVATE), ("simulator", ACTIVATE)):
        assert ask(name, number)
    moved(stack, ticks)
    assert ask("executor", DEACTIVATE)
    # The clock goes on: the held position answers.
    moved(stack, ticks)
    assert ask("simulator", DEACTIVATE)
    standing = stack.diagnosed("simulator")["ticks"]
    assert stack.diagnosed("simulator")["ticks"] == standing
    assert ask("executor", ACTIVATE)
    assert ask("simulator", ACTIVATE)
    moved(stack, ticks)
    for process in (executor, simulator, recorder):
        assert process.stop() == 0
        assert "Traceback" not in process.output


def moved(stack: Stack, ticks: list[JointState]) -> None:
    """Wait until simulated time has moved on by half a second."""
    ticks.clear()
    stack.wait_until(lambda: ticks and seconds(ticks[-1]) > seconds(ticks[0]) + 0.5, "ticks", timeout_s=120.0)


def seconds(state: JointState) -> float:
    return float(state.header.stamp.sec + state.header.stamp.nanosec / 1e9)

"""What the doctor finds in made-up snapshots: each fault by name, and nothing in a healthy graph."""

from __future__ import annotations

from dataclasses import replace

import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from msrd_ros.contract.interface import TOPICS
from msrd_ros.stack.findings import findings
from msrd_ros.stack.snapshot import Endpoint, Heard, Said, Snapshot, namespace_of, role_of
from sawyer import JOINT_NAMES

RELIABLE = QoSProfile(depth=1)
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
BEST_EFFORT = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
NOW_NS = 1_790_000_000_000_000_000


def sends(node: str, topic: str, qos: QoSProfile = RELIABLE) -> Endpoint:
    return Endpoint(node, topic, TOPICS[role_of(topic)].type_name, True, qos)


def hears(node: str, topic: str, qos: QoSProfile = RELIABLE) -> Endpoint:
    return replace(sends(node, topic, qos), publishes=False)


def states(stamp_ns: int = NOW_NS, names: tuple[str, ...] = JOINT_NAMES) -> Heard:
    return Heard(4.0, 1000, stamp_ns, NOW_NS, 2, {names})


HEALTHY = Snapshot(
    5,
    "LOCALHOST",
    ("/driver", "/executor"),
    (
        sends("/driver", "/joint_states"),
        hears("/executor", "/joint_states"),
        sends("/executor", "/joint_command"),
        hears("/driver", "/joint_command"),
        hears("/executor", "/strategy", LATCHED),
        hears("/executor", "/strategy"),
        sends("/executor", "/diagnostics"),
    ),
    {"/joint_states": states()},
    {"/executor": Said("ready", {})},
    {"/executor": {"robot": "sawyer", "mode": "real_time", "checkpoint": ""}},
)


def among(*endpoints: Endpoint) -> Snapshot:
    return replace(HEALTHY, endpoints=HEALTHY.endpoints + endpoints)


def simulated(heard: Heard, **said: str) -> Snapshot:
    """A simulator's graph with a clock."""
    clock = among(sends("/simulator", "/clock"), sends("/simulator", "/diagnostics"))
    return replace(
        clock,
        heard={**clock.heard, "/clock": heard, "/joint_states": states(heard.stamp_ns or 0)},
        said={**clock.said, "/simulator": Said("playing", said)},
        parameters={"/simulator": {"robot": "sawyer", "mode": "lockstep"}},
    )


def test_in_a_healthy_graph_nothing_is_found() -> None:
    assert findings(HEALTHY) == []
    assert findings(simulated(Heard(4.0, 200, 5_000_000_000, NOW_NS, 2))) == []
    # What a tool sends with its default settings is heard by one of two subscriptions.
    assert findings(among(sends("/tool", "/strategy"), sends("/evaluator", "/strategy", LATCHED))) == []


def test_an_arm_and_its_gripper_are_one_source() -> None:
    both = among(sends("/gripper", "/joint_states"))
    heard = states()
    heard.names.add(("finger",))
    assert findings(replace(both, heard={"/joint_states": heard})) == []


@pytest.mark.parametrize(
    ("snapshot", "what", "remedy"),
    [
        (Snapshot(5, "LOCALHOST"), "no node of the stack is on domain 5", "start a simulator"),
        (
            Snapshot(5, "LOCALHOST", other_domains=(7,)),
            "no node of the stack is on domain 5, but something on this machine speaks on 7",
            "--domain 7",
        ),
        (replace(HEALTHY, discovery_range="OFF"), "ROS_AUTOMATIC_DISCOVERY_RANGE is OFF", "LOCALHOST"),
        (replace(HEALTHY, domain=150), "domain 150 uses ports", "up to 101"),
        (
            replace(HEALTHY, nodes=(*HEALTHY.nodes, "/executor")),
            "2 nodes are called /executor",
            "stop all but one",
        ),
        (
            among(replace(sends("/camera", "/ball/position"), type_name="geometry_msgs/msg/Point")),
            "/camera publishes /ball/position as geometry_msgs/msg/Point, which is a geometry_msgs",
            "of /camera another name",
        ),
        (
            among(sends("/camera", "/ball/position", BEST_EFFORT), hears("/executor", "/ball/position")),
            "/executor cannot hear /ball/position from /camera: ",
            "let /camera offer what /executor asks for",
        ),
        (
            among(sends("/sim", "/robot_description"), hears("/rviz", "/robot_description", LATCHED)),
            "/rviz cannot hear /robot_description from /sim: ",
            "durability",
        ),
        (
            among(sends("/player", "/joint_states")),
            "/joint_states has 2 sources: /driver, /player",
            "stop all but one",
        ),
        (
            among(sends("/executor", "/joint_command")),
            "/joint_command has 2 sources: /executor (2 times)",
            "stop all but one",
        ),
        (
            replace(HEALTHY, parameters={"/executor": {"mode": "lockstep"}, "/sim": {"mode": "real_time"}}),
            "/executor in lockstep and /sim in real_time",
            "same mode:=",
        ),
        (
            replace(HEALTHY, heard={"/joint_states": states(names=("elbow", "wrist"))}),
            "/executor is for sawyer, but /joint_states lacks right_j0, ",
            "robot:= that arm",
        ),
        (
            replace(HEALTHY, policies={"/policy": "ur10e@0"}),
            "/executor is for sawyer: topic /policy: is of the robot ur10e, not sawyer; say robot:=ur10e",
            "train for that arm",
        ),
        (
            simulated(
                Heard(4.0, 16, 5_000_000_000, NOW_NS, 1), waits_for="a joint_command: start an executor"
            ),
            "the clock of /simulator stands: it waits for a joint_command",
            "start an executor",
        ),
        (
            replace(HEALTHY, heard={"/joint_states": states(NOW_NS + 3600 * 10**9)}),
            "stamps of /joint_states of /driver are 3600.0 s in the future",
            "clocks of the machines",
        ),
        (
            replace(HEALTHY, heard={"/joint_states": states(NOW_NS - 5 * 10**9)}),
            "stamps of /joint_states of /driver are 5.0 s old",
            "clocks of the machines",
        ),
        (replace(HEALTHY, heard={"/joint_states": states(0)}), "carries no stamps", "stamp what it sends"),
        (
            replace(HEALTHY, heard={"/joint_states": replace(states(), count=20)}),
            "/joint_states comes 5.0 times a second",
            "publish faster",
        ),
        (
            among(hears("/trainer", "/left/joint_states"), sends("/arm", "/right/joint_states")),
            "/trainer listens to /left/joint_states, which nobody publishes; /right/joint_states has nobody",
            "one namespace",
        ),
        (replace(HEALTHY, said={}), "/executor is there but says nothing in /diagnostics", "its log"),
        (
            replace(
                HEALTHY,
                said={"/executor": Said("ready", {"waits_for": "a: do this; b: do that", "waits_s": "7.0"})},
            ),
            "/executor waits for a: do this; b: do that (since 7.0 s)",
            "do this; do that",
        ),
    ],
)
def test_a_fault_is_found_by_name_with_what_to_do(snapshot: Snapshot, what: str, remedy: str) -> None:
    found = [finding for finding in findings(snapshot) if what in finding.what]
    assert len(found) == 1, findings(snapshot)
    assert remedy in found[0].remedy


@pytest.mark.parametrize(
    ("topic", "role", "namespace"),
    [
        ("/joint_states", "joint_states", "/"),
        ("/a/b/ball/position", "ball/position", "/a/b"),
        ("/clock", "clock", "/"),
        ("/left/clock", "clock", "/left"),
        ("/rosout", "", "/"),
    ],
)
def test_topics_play_their_roles_in_any_namespace(topic: str, role: str, namespace: str) -> None:
    assert role_of(topic) == role
    assert not role or namespace_of(topic, role) == namespace

"""What is wrong with a graph, and what to do about it: judged from a snapshot alone."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from rclpy.qos import QoSCompatibility, qos_check_compatible

from msrd_ros.contract.interface import TOPICS
from msrd_ros.core.errors import UserError
from msrd_ros.robots.loading import load_robot
from msrd_ros.robots.robot import Robot
from msrd_ros.stack.looking import robot_of_policies
from msrd_ros.stack.snapshot import Endpoint, Snapshot, namespace_of, role_of

ONE_SOURCE = ("ball/position", "joint_command", "rally/outcome", "clock", "joint_states")
NEEDED = ("joint_states", "ball/position", "joint_command")
CLOCK_TOLERANCE_S = 1.0
SLOWEST_HZ = 40.0
"""Of joint states in real time: the executor acts fifty times a second."""
HIGHEST_DOMAIN = 101


class Finding(NamedTuple):
    """Something that keeps the stack from its work."""

    what: str
    remedy: str


def findings(snapshot: Snapshot) -> list[Finding]:
    """All that is wrong; the causes of others first."""
    checks = (
        _nobody,
        _names,
        _types,
        _qualities,
        _sources,
        _modes,
        _robots,
        _clock,
        _stamps,
        _rates,
        _apart,
        _silent,
        _waiting,
    )
    return [finding for check in checks for finding in check(snapshot)]


def _nobody(snapshot: Snapshot) -> Iterator[Finding]:
    if snapshot.domain > HIGHEST_DOMAIN:
        yield Finding(
            f"domain {snapshot.domain} uses ports that the system hands to other programs",
            f"set ROS_DOMAIN_ID to a number up to {HIGHEST_DOMAIN}",
        )
    if snapshot.discovery_range.startswith("OFF"):
        yield Finding(
            "ROS_AUTOMATIC_DISCOVERY_RANGE is OFF: nodes do not find each other",
            "set it to LOCALHOST, or to SUBNET for several machines",
        )
    if snapshot.own_nodes:
        return
    elsewhere = ", ".join(map(str, snapshot.other_domains))
    yield Finding(
        f"no node of the stack is on domain {snapshot.domain}"
        + (f", but something on this machine speaks on {elsewhere}" if elsewhere else ""),
        f"start one, or look there with --domain {snapshot.other_domains[0]}"
        if elsewhere
        else "start a simulator, or set the same ROS_DOMAIN_ID and ROS_AUTOMATIC_DISCOVERY_RANGE as its",
    )


def _names(snapshot: Snapshot) -> Iterator[Finding]:
    for name, count in Counter(snapshot.nodes).items():
        if count > 1 and name in snapshot.own_nodes:
            yield Finding(f"{count} nodes are called {name}", "stop all but one, or give them namespaces")


def _types(snapshot: Snapshot) -> Iterator[Finding]:
    for topic in snapshot.topics:
        wanted = TOPICS[role_of(topic)].type_name
        for end in snapshot.endpoints:
            if end.topic == topic and end.type_name != wanted:
                does = "publishes" if end.publishes else "listens to"
                yield Finding(
                    f"{end.node} {does} {topic} as {end.type_name}, which is a {wanted}",
                    f"give that topic of {end.node} another name, or its proper type",
                )


def _qualities(snapshot: Snapshot) -> Iterator[Finding]:
    """A node that cannot hear another because of what they offer and ask for."""
    for topic in snapshot.topics:
        for sender in snapshot.publishers(topic):
            for listener in sorted({end.node for end in snapshot.subscriptions(topic)}):
                # A node that listens twice, latched and volatile, hears with either.
                ends = [end for end in snapshot.subscriptions(topic) if end.node == listener]
                reasons = [_clash(sender, end) for end in ends]
                if all(reasons):
                    yield Finding(
                        f"{listener} cannot hear {topic} from {sender.node}: {reasons[0]}",
                        f"let {sender.node} offer what {listener} asks for (reliability, durability), "
                        f"or {listener} ask for less",
                    )


def _clash(sender: Endpoint, listener: Endpoint) -> str:
    compatibility, reason = qos_check_compatible(sender.qos, listener.qos)
    return (
        (reason.removeprefix("ERROR: ").strip().rstrip(";") or "qualities differ")
        if compatibility == QoSCompatibility.ERROR
        else ""
    )


def _sources(snapshot: Snapshot) -> Iterator[Finding]:
    for topic in snapshot.topics:
        role, sources = role_of(topic), snapshot.publishers(topic)
        if role not in ONE_SOURCE or len(sources) < 2:
            continue
        heard = snapshot.heard.get(topic)
        if role == "joint_states" and heard is not None and _share_joints(heard.names):
            continue  # an arm and its gripper
        names = Counter(sorted(end.node for end in sources))
        told = ", ".join(f"{name} ({count} times)" if count > 1 else name for name, count in names.items())
        yield Finding(f"{topic} has {len(sources)} sources: {told}", "stop all but one of them")


def _share_joints(names: set[tuple[str, ...]]) -> bool:
    """Whether several devices publish joints of their own."""
    joints = [joint for group in names for joint in group]
    return len(names) > 1 and len(joints) == len(set(joints))


def _modes(snapshot: Snapshot) -> Iterator[Finding]:
    modes = {name: str(values["mode"]) for name, values in snapshot.parameters.items() if "mode" in values}
    for namespace in sorted({namespace_of(name) for name in modes}):
        here = {name: mode for name, mode in modes.items() if namespace_of(name) == namespace}
        if len(set(here.values())) > 1:
            told = " and ".join(f"{name} in {mode}" for name, mode in sorted(here.items()))
            yield Finding(f"{told}: they do not wait for each other", "start both with the same mode:=")


def _robots(snapshot: Snapshot) -> Iterator[Finding]:
    """Robots of nodes, policies and joints on the wire, held against each other."""
    for name, values in sorted(snapshot.parameters.items()):
        if "robot" not in values:
            continue
        try:
            robot = load_robot(str(values["robot"]))
        except UserError:
            continue  # a folder of another machine
        namespace = namespace_of(name).rstrip("/")
        topic = f"{namespace}/joint_states"
        heard = snapshot.heard.get(topic)
        joints = {joint for group in heard.names for joint in group} if heard is not None else set()
        missing = [joint for joint in robot.joint_names if joint not in joints]
        if joints and missing:
            yield Finding(
                f"{name} is for {robot.name}, but {topic} lacks {', '.join(missing)}: it has "
                f"{', '.join(sorted(joints))}",
                f"start {name} with robot:= that arm, or the driver of {robot.name}",
            )
        if "checkpoint" in values:
            yield from _policies(snapshot, name, robot, str(values["checkpoint"]))


def _policies(snapshot: Snapshot, node: str, robot: Robot, checkpoint: str) -> Iterator[Finding]:
    topic = f"{namespace_of(node).rstrip('/')}/policy"
    found = {f"topic {topic}": snapshot.policies.get(topic, "")}
    if checkpoint and Path(checkpoint).is_file():
        found[checkpoint] = robot_of_policies(Path(checkpoint).read_bytes(), checkpoint)
    for where, identity in found.items():
        try:
            if identity:
                robot.require(identity, where)
        except UserError as error:
            yield Finding(f"{node} is for {robot.name}: {error}", "train for that arm, or start both for one")


def _clock(snapshot: Snapshot) -> Iterator[Finding]:
    for topic in snapshot.topics:
        heard = snapshot.heard.get(topic)
        senders = snapshot.simulators(topic)
        if role_of(topic) != "clock" or heard is None or heard.stamps > 1 or not senders:
            continue
        said = [snapshot.said[name].waits_for for name in senders if name in snapshot.said]
        reason = "; ".join(filter(None, said))
        yield Finding(
            f"the clock of {', '.join(senders)} stands" + (f": it waits for {reason}" if reason else ""),
            _doing(reason) if reason else "see its log, and whether its commands carry its stamps",
        )


def _stamps(snapshot: Snapshot) -> Iterator[Finding]:
    for topic, heard in sorted(snapshot.heard.items()):
        if role_of(topic) not in ("joint_states", "ball/position") or not heard.count:
            continue
        sender = ", ".join(sorted({end.node for end in snapshot.publishers(topic)}))
        if not heard.stamp_ns:
            yield Finding(f"{topic} of {sender} carries no stamps", "let its driver stamp what it sends")
            continue
        age_s = snapshot.age_s(topic)
        if age_s is not None and abs(age_s) > CLOCK_TOLERANCE_S:
            told = f"{age_s:.1f} s old" if age_s > 0.0 else f"{-age_s:.1f} s in the future"
            yield Finding(
                f"stamps of {topic} of {sender} are {told}",
                "set the clocks of the machines alike (chrony, ntp), or let one source stamp",
            )


def _rates(snapshot: Snapshot) -> Iterator[Finding]:
    if any(values.get("mode") == "lockstep" for values in snapshot.parameters.values()):
        return
    for topic, heard in sorted(snapshot.heard.items()):
        if role_of(topic) != "joint_states" or not heard.seconds:
            continue
        if heard.rate_hz < SLOWEST_HZ and any("mode" in values for values in snapshot.parameters.values()):
            yield Finding(
                f"{topic} comes {heard.rate_hz:.1f} times a second; the executor acts 50 times",
                "let the driver publish faster",
            )


def _apart(snapshot: Snapshot) -> Iterator[Finding]:
    """Listeners in one namespace, senders in another."""
    for topic in snapshot.topics:
        role = role_of(topic)
        if role not in NEEDED or snapshot.publishers(topic):
            continue
        listeners = ", ".join(sorted({end.node for end in snapshot.subscriptions(topic)}))
        others = [
            other
            for other in snapshot.topics
            if role_of(other) == role and snapshot.publishers(other) and not snapshot.subscriptions(other)
        ]
        for other in others:
            yield Finding(
                f"{listeners} listens to {topic}, which nobody publishes; {other} has nobody who listens",
                "start both in one namespace (-r __ns:=/NAME), or remap one topic to the other",
            )


def _silent(snapshot: Snapshot) -> Iterator[Finding]:
    for name in snapshot.own_nodes:
        if name not in snapshot.said:
            yield Finding(
                f"{name} is there but says nothing in /diagnostics",
                "it may still be starting, be stopped or have no processor time: see its log, or end it",
            )


def _waiting(snapshot: Snapshot) -> Iterator[Finding]:
    for name, said in sorted(snapshot.said.items()):
        if said.waits_for:
            since = said.values.get("waits_s", "?")
            yield Finding(f"{name} waits for {said.waits_for} (since {since} s)", _doing(said.waits_for))


def _doing(waits_for: str) -> str:
    """The remedies in what a node says that it waits for: what stands behind each colon."""
    parts = [part.partition(": ")[2] for part in waits_for.split("; ")]
    return "; ".join(part for part in parts if part) or "see its log"

"""Looks at a running graph for a few seconds, and disturbs nobody."""

from __future__ import annotations

import contextlib
import os
import time
from pathlib import Path
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.srv import GetParameters
from rclpy.client import Client
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import UInt8MultiArray

from msrd_ros.contract.interface import TOPICS
from msrd_ros.contract.translation import stamp_to_ns
from msrd_ros.core.discovery import DISCOVERY_RANGE, stay_on_this_machine
from msrd_ros.core.errors import UserError
from msrd_ros.learning.policy import read_header
from msrd_ros.nodes.recorder_inputs import import_message_type
from msrd_ros.robots.default import DEFAULT_ROBOT
from msrd_ros.stack.snapshot import Endpoint, Heard, Said, Snapshot, role_of

LISTENED = ("joint_states", "ball/position", "joint_command", "rally/outcome", "clock")
ASKED = ("robot", "mode", "checkpoint")
GRAPH_SHARE = 0.4
"""Of the time: for finding who is there, before anything is subscribed to."""
LONGEST_SHARE = 3.0
"""Of the time: for who is there and has not answered yet, as on a loaded machine."""
ASK_PERIOD_S = 0.1
DEPTH = 1000


class Look:
    """A node that listens, in a context of its own.

    Parameters
    ----------
    domain
        ROS domain; None takes ROS_DOMAIN_ID.
    namespace
        Only what is in it; ``/`` takes all.
    """

    def __init__(self, domain: int | None, namespace: str) -> None:
        self._namespace = namespace
        self._context = Context()
        stay_on_this_machine(os.environ)
        rclpy.init(args=[], context=self._context, domain_id=domain)
        # A name that begins with an underscore is not listed by tools.
        self._node = Node(f"_doctor_{os.getpid()}", context=self._context, start_parameter_services=False)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._heard: dict[str, Heard] = {}
        self._said: dict[str, Said] = {}
        self._policies: dict[str, str | None] = {}
        self._parameters: dict[str, dict[str, Any]] = {}
        self._clients: dict[str, Client] = {}
        self._open_questions: set[tuple[str, str]] = set()
        self._node.create_subscription(DiagnosticArray, "/diagnostics", self._take_word, DEPTH)
        self._node.create_timer(ASK_PERIOD_S, self._ask)

    def close(self) -> None:
        """Leave the graph."""
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.try_shutdown()

    def take(self, wait_s: float) -> Snapshot:
        """Listen for `wait_s` seconds, and say what was there."""
        self._spin(GRAPH_SHARE * wait_s)
        self._listen(self._endpoints())
        begun_s = time.monotonic()
        self._spin((1.0 - GRAPH_SHARE) * wait_s)
        end_s = time.monotonic() + LONGEST_SHARE * wait_s
        while self._lacks_answers and time.monotonic() < end_s:
            self._executor.spin_once(timeout_sec=ASK_PERIOD_S)
        for heard in self._heard.values():
            heard.seconds = time.monotonic() - begun_s
        own = self._node.get_fully_qualified_name()
        names = (f"{space.rstrip('/')}/{name}" for name, space in self._node.get_node_names_and_namespaces())
        domain = int(self._context.get_domain_id())
        return Snapshot(
            domain,
            discovery_range(),
            tuple(sorted(name for name in names if name != own and self._is_wanted(name))),
            tuple(self._endpoints()),
            self._heard,
            {name: said for name, said in self._said.items() if self._is_wanted(name)},
            self._parameters,
            {topic: robot for topic, robot in self._policies.items() if robot},
            tuple(other for other in domains_in_use() if other != domain),
        )

    def _spin(self, seconds: float) -> None:
        end_s = time.monotonic() + seconds
        while (left_s := end_s - time.monotonic()) > 0.0:
            self._executor.spin_once(timeout_sec=left_s)

    def _is_wanted(self, name: str) -> bool:
        return self._namespace == "/" or name.startswith(f"{self._namespace}/")

    def _endpoints(self) -> list[Endpoint]:
        found = []
        own = self._node.get_fully_qualified_name()
        for topic, _ in self._node.get_topic_names_and_types():
            if not role_of(topic):
                continue
            for publishes, infos in (
                (True, self._node.get_publishers_info_by_topic(topic)),
                (False, self._node.get_subscriptions_info_by_topic(topic)),
            ):
                for info in infos:
                    name = f"{info.node_namespace.rstrip('/')}/{info.node_name}"
                    if name != own and self._is_wanted(name):
                        found.append(Endpoint(name, topic, info.topic_type, publishes, info.qos_profile))
        return found

    # -- what is asked and heard ---------------------------------------------------------------

    def _ask(self) -> None:
        """Ask nodes of the stack for their parameters once they are found and their services are there."""
        for info in self._node.get_publishers_info_by_topic("/diagnostics"):
            name = f"{info.node_namespace.rstrip('/')}/{info.node_name}"
            if name not in self._parameters and self._is_wanted(name):
                self._parameters[name] = {}
                self._clients[name] = self._node.create_client(GetParameters, f"{name}/get_parameters")
        # A request to a service that is not yet matched would be lost.
        for name in [name for name, client in self._clients.items() if client.service_is_ready()]:
            self._call(name, self._clients.pop(name))

    def _call(self, node: str, client: Client) -> None:
        for parameter in ASKED:
            self._open_questions.add((node, parameter))
            future = client.call_async(GetParameters.Request(names=[parameter]))
            future.add_done_callback(
                lambda done, parameter=parameter: self._take_parameter(node, parameter, done.result())
            )

    @property
    def _lacks_answers(self) -> bool:
        """Whether a node has not spoken or answered, or policies have not come, that are there."""
        silent = self._parameters.keys() - self._said.keys()
        return bool(silent or self._clients or self._open_questions or None in self._policies.values())

    def _take_parameter(self, node: str, parameter: str, answer: Any) -> None:
        self._open_questions.discard((node, parameter))
        for value in answer.values:
            self._parameters[node][parameter] = parameter_value_to_python(value)

    def _listen(self, endpoints: list[Endpoint]) -> None:
        # A player that waits for subscribers would take the doctor for one, and begin to play.
        reluctant = {name for name, said in self._said.items() if "subscribers of" in said.waits_for}
        topics = {end.topic for end in endpoints if end.publishes}
        topics -= {end.topic for end in endpoints if end.publishes and end.node in reluctant}
        any_publisher = QoSProfile(depth=DEPTH, reliability=ReliabilityPolicy.BEST_EFFORT)
        for topic in sorted(topics):
            role = role_of(topic)
            if role in LISTENED:
                self._heard[topic] = Heard()
                kind = import_message_type(TOPICS[role].type_name)
                self._node.create_subscription(kind, topic, self._taker(topic), any_publisher)
            if role == "policy":
                self._policies[topic] = None
                latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
                self._node.create_subscription(UInt8MultiArray, topic, self._policy_taker(topic), latched)

    def _taker(self, topic: str) -> Any:
        heard = self._heard[topic]

        def take(message: Any) -> None:
            heard.count += 1
            heard.received_ns = time.time_ns()
            stamp = message.clock if hasattr(message, "clock") else message.header.stamp
            stamp_ns = stamp_to_ns(stamp)
            heard.stamps += heard.stamps < 2 and stamp_ns != heard.stamp_ns
            heard.stamp_ns = stamp_ns
            if hasattr(message, "name") and len(heard.names) < DEPTH:
                heard.names.add(tuple(message.name))

        return take

    def _policy_taker(self, topic: str) -> Any:
        def take(message: UInt8MultiArray) -> None:
            self._policies[topic] = robot_of_policies(bytes(message.data), f"topic {topic}")

        return take

    def _take_word(self, message: DiagnosticArray) -> None:
        for item in message.status:
            if item.name.startswith("/"):
                values = {pair.key: pair.value for pair in item.values}
                self._said[item.name] = Said(item.message, values)


def robot_of_policies(data: bytes, where: str) -> str:
    """Identity of the robot that policies are of; empty if they cannot be read, which their user says."""
    with contextlib.suppress(UserError, AttributeError):
        return str(read_header(data, where)["details"].get("robot", DEFAULT_ROBOT))
    return ""


def discovery_range() -> str:
    """How far nodes look for each other, from the environment."""
    if os.environ.get("ROS_LOCALHOST_ONLY") == "1":
        return "LOCALHOST (ROS_LOCALHOST_ONLY)"
    return os.environ.get(DISCOVERY_RANGE) or "LOCALHOST (our default)"


def domains_in_use() -> tuple[int, ...]:
    """Domains on which something on this machine listens, from its UDP ports (Linux; empty elsewhere)."""
    found = set()
    for table in (Path("/proc/net/udp"), Path("/proc/net/udp6")):
        with contextlib.suppress(OSError):
            for line in table.read_text(encoding="ascii").splitlines()[1:]:
                port = int(line.split()[1].rpartition(":")[2], 16)
                domain, offset = divmod(port - 7400, 250)
                # Only a participant's own ports: even ones for discovery, from 10 on.
                if 0 <= domain <= 101 and 10 <= offset < 40:
                    found.add(domain)
    return tuple(sorted(found))

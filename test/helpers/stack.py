"""A domain of its own with nodes of the package as processes, and a node of the test that talks to them."""

from __future__ import annotations

import time
from collections.abc import Callable
from types import TracebackType
from typing import Any, Self

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import SingleThreadedExecutor
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool, Trigger

from domains import close_observer, open_observer
from msrd_ros.contract.translation import stamp_to_ns
from msrd_ros.nodes.common import STATE
from processes import Installation, Launcher, RunningProcess

START_TIMEOUT_S = 90.0
"""Code may have to be compiled first."""
ANSWER_TIMEOUT_S = 30.0
SETTLE_S = 0.5


class Stack:
    """Starts executables on one domain, and spins the test's own node.

    Parameters
    ----------
    domain_id
        ROS domain.
    directory
        Working directory of the processes.
    """

    def __init__(self, domain_id: int, directory: Any) -> None:
        self.domain_id = domain_id
        self.launcher = Launcher(Installation("checkout", checkout=True), domain_id, directory)
        self.node = open_observer(domain_id)
        self.executor = SingleThreadedExecutor(context=self.node.context)
        self.executor.add_node(self.node)
        self.diagnostics: dict[str, dict[str, str]] = {}
        self._said_ns: dict[str, int] = {}
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 100)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.launcher.close()
        self.executor.shutdown()
        close_observer(self.node)

    def start(self, name: str, **parameters: Any) -> RunningProcess:
        """Start an executable; it may take a while until it is ready."""
        return self.launcher.start(name, parameters=parameters)

    def start_simulator(self, **parameters: Any) -> RunningProcess:
        """Start a simulator, and wait for its first tick."""
        process = self.start("simulator", **parameters)
        heard: list[JointState] = []
        subscription = self.node.create_subscription(JointState, "joint_states", heard.append, STATE)
        self.wait_until(lambda: heard, "joint_states", START_TIMEOUT_S, process)
        self.node.destroy_subscription(subscription)
        return process

    def wait_until(
        self,
        condition: Callable[[], Any],
        what: str,
        timeout_s: float = ANSWER_TIMEOUT_S,
        process: RunningProcess | None = None,
    ) -> Any:
        """Spin until a condition holds; its value. Fails early if `process` ends."""
        deadline = time.monotonic() + timeout_s
        while not (found := condition()):
            if process is not None:
                process.require_running()
            assert time.monotonic() < deadline, f"no {what} in {timeout_s} s"
            self.executor.spin_once(timeout_sec=0.02)
        return found

    def trigger(self, service: str) -> Trigger.Response:
        """Call a std_srvs/Trigger."""
        return self.call(Trigger, service, Trigger.Request())

    def set(self, service: str, on: bool) -> SetBool.Response:
        """Call a std_srvs/SetBool."""
        return self.call(SetBool, service, SetBool.Request(data=on))

    def diagnosed(self, name: str) -> dict[str, str]:
        """What a node says of itself from now on, in /diagnostics."""
        asked_ns = time.time_ns()
        self.wait_until(lambda: self._said_ns.get(name, 0) > asked_ns, f"diagnostics of {name}")
        return self.diagnostics[name]

    def call(self, kind: Any, service: str, request: Any, timeout_s: float = ANSWER_TIMEOUT_S) -> Any:
        """Call a service of any type."""
        client = self.node.create_client(kind, service)
        self.wait_until(client.service_is_ready, service, START_TIMEOUT_S)
        # A server that has not found the client's reader yet sends its answer to nobody.
        settled_s = time.monotonic() + SETTLE_S
        self.wait_until(lambda: time.monotonic() > settled_s, "pause")
        future = client.call_async(request)
        self.wait_until(future.done, f"answer of {service}", timeout_s)
        self.node.destroy_client(client)
        return future.result()

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            name = status.name.removeprefix("/")
            self._said_ns[name] = stamp_to_ns(message.header.stamp)
            values = {item.key: item.value for item in status.values}
            self.diagnostics[name] = {**values, "message": status.message}


def one_line(process: RunningProcess, name: str, code: int = 2, timeout_s: float = START_TIMEOUT_S) -> str:
    """The one error line of an executable that ends by itself; no traceback, and its exit status."""
    assert process.wait(timeout_s) == code, process.output
    assert "Traceback" not in process.output, process.output
    lines = [line for line in process.output.splitlines() if f"{name}: error: " in line]
    assert len(lines) == 1, process.output
    return lines[0]

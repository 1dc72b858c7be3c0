"""What all nodes share: parameters from dataclasses, quality of service, diagnostics, start and stop."""

from __future__ import annotations

import argparse
import dataclasses
import os
import re
import sys
import time
import uuid
from collections.abc import Callable, Mapping
from typing import Any, ClassVar

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.utilities import try_shutdown

from msrd_ros.core.discovery import stay_on_this_machine
from msrd_ros.core.errors import UserError
from msrd_ros.core.parameters import parameter
from msrd_ros.nodes.given_files import given_files, require_section
from msrd_ros.nodes.interrupts import Interrupts, ignore_signals, is_shut_down
from msrd_ros.nodes.node_parameters import is_own, read_change, read_parameters
from msrd_ros.nodes.parameter_files import NODES
from msrd_ros.nodes.waiting import Waiting
from msrd_ros.robots.default import DEFAULT_ROBOT


def _reliable(depth: int, durability: DurabilityPolicy = DurabilityPolicy.VOLATILE) -> QoSProfile:
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=durability,
    )


LATCHED = _reliable(1, DurabilityPolicy.TRANSIENT_LOCAL)
"""strategy, policy, robot_description: a late joiner still gets the newest."""
COMMAND = _reliable(1)
"""joint_command, teach/hand: only the newest command counts."""
EVENT = _reliable(100)
"""rally/outcome, feed."""
STATE = _reliable(1000)
"""joint_states, ball/position, ball/odometry."""

INSTANCE, UP_S = "instance", "up_s"
"""What every node says of itself in /diagnostics: which process it is, and how long it has been up."""

SIDE_OF = "side_"
"""What begins a key of an executor's diagnostics; a label that it has policies for follows."""
COMPLAINT_PERIOD_S = 1.0
MOST_COMPLAINTS = 100


class Finished(Exception):  # noqa: N818 - an end, not an error
    """Raised inside a callback when a node's work is done; `run` then ends the process.

    Parameters
    ----------
    exit_code
        Exit status of the process.
    """

    def __init__(self, exit_code: int = 0) -> None:
        super().__init__(exit_code)
        self.exit_code = exit_code


def robot_parameter() -> Any:
    """The parameter `robot` of every node that has to do with joints."""
    return parameter(DEFAULT_ROBOT, "The arm: a name below config/robots, or a folder with its robot.yaml")


def steady_timer(node: Node, period_s: float, callback: Callable[[], None]) -> Any:
    """Start a timer on the steady clock: watchdogs must not stop with simulated time."""
    return node.create_timer(period_s, callback, clock=Clock(clock_type=ClockType.STEADY_TIME))


def status(name: str, message: str, values: Mapping[str, object], level: bytes = b"\x00") -> DiagnosticStatus:
    """A diagnostic status; floats are written so that they read back exactly."""
    return DiagnosticStatus(
        level=level,
        name=name,
        message=message,
        values=[KeyValue(key=key, value=write_value(value)) for key, value in values.items()],
    )


def write_value(value: object) -> str:
    """Text of a value in a KeyValue: repr of floats, lower-case booleans."""
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(float(value)) if isinstance(value, float) else str(value)


def referee_hears(node: Node, feed: Publisher) -> bool:
    """Whether a ball that is fed now reaches the simulator.

    A recorder listens to `feed` as well and may be found first, so that some subscriber is not enough: one
    that also decides rallies must be there, and all subscribers that are known must be connected.
    """
    referees, listeners = (
        {(info.node_name, info.node_namespace) for info in infos}
        for infos in (
            node.get_publishers_info_by_topic("rally/outcome"),
            node.get_subscriptions_info_by_topic("feed"),
        )
    )
    return bool(referees & listeners) and feed.get_subscription_count() >= len(listeners)


class StackNode(Node):
    """A node with parameters from a dataclass and a line in /diagnostics once a second.

    Attributes
    ----------
    config
        Its parameters as they are now: those that are live change while it runs.
    instance
        Tells this process from all others that have, had or will have the node's name.
    up_since_s
        When it was started, by the steady clock.
    """

    command_line: ClassVar[tuple[str, ...]] = ()
    """Words that the process was started with."""

    def __init__(self, name: str, config_type: type[Any], **options: Any) -> None:
        super().__init__(name, **options)
        self.instance = uuid.uuid4().hex[:12]
        self.up_since_s = time.monotonic()
        self._look_into_given_files()
        self.config = read_parameters(self, config_type)
        self._hooks: dict[str, Callable[[], None]] = {}
        self._complained_s: dict[str, float] = {}
        domain = self.context.get_domain_id()
        self._waiting = Waiting(lambda line: self.get_logger().info(f"{line} (on domain {domain})"))
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        steady_timer(self, 1.0, self.publish_diagnostics)

    def diagnose(self) -> tuple[str, Mapping[str, object]]:
        """One line on how the node is doing, and its figures. Nodes override this."""
        return "running", {}

    def waits_for(self) -> list[str]:
        """What keeps the node from its work, each with what to do about it. Nodes override this."""
        return []

    def account(self) -> tuple[str, Mapping[str, object], list[str]]:
        """What it says of itself: a line, its figures, and what it waits for."""
        return *self.diagnose(), self.waits_for()

    def publish_diagnostics(self) -> None:
        """Say how the node is doing and what it waits for, now."""
        message, values, waits = self.account()
        self._waiting.update(waits)
        waited = self._waiting.figures()
        level = DiagnosticStatus.WARN if waited else DiagnosticStatus.OK
        name = self.get_fully_qualified_name()
        facts = {INSTANCE: self.instance, UP_S: round(time.monotonic() - self.up_since_s, 3)}
        array = DiagnosticArray(status=[status(name, message, {**values, **waited, **facts}, level)])
        array.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(array)

    def complain(self, error: UserError) -> None:
        """Log what was refused, at most once a second for each kind of complaint."""
        # Numbers change from message to message; it is still the same complaint.
        kind = re.sub(r"\d+\.\d+", "", str(error))
        now_s = time.monotonic()
        if now_s - self._complained_s.get(kind, -COMPLAINT_PERIOD_S) < COMPLAINT_PERIOD_S:
            return
        if len(self._complained_s) > MOST_COMPLAINTS:
            self._complained_s.clear()
        self._complained_s[kind] = now_s
        self.get_logger().error(str(error))

    # -- parameters ----------------------------------------------------------------------------

    def on_change(self, hook: Callable[[], None], *names: str) -> None:
        """Have `hook` called after any of these live parameters has changed; `config` has it by then.

        What looks its parameter up in `config` whenever it is needed does without a hook.
        """
        self._hooks.update(dict.fromkeys(names, hook))

    def change(self, name: str, value: object) -> None:
        """Set a live parameter from within, as if it had been set from outside.

        Raises
        ------
        UserError
            If the value is not allowed.
        """
        result = self.set_parameters_atomically([Parameter(name, value=value)])
        if not result.successful:
            raise UserError(result.reason)

    def set_parameters_atomically(self, parameter_list: list[Parameter]) -> SetParametersResult:
        """Set live parameters, all of them or none, and let them take effect; rclpy calls this, too."""
        try:
            wanted = read_change(self, type(self.config), parameter_list)
            changes = {item.name: item.value for item in wanted if not is_own(item.name)}
            changed = dataclasses.replace(self.config, **changes)
        except UserError as error:
            return SetParametersResult(successful=False, reason=str(error))
        result = super().set_parameters_atomically(wanted)
        if result.successful:
            self.config = changed
            for hook in dict.fromkeys(self._hooks[name] for name in changes if name in self._hooks):
                hook()
            self.publish_diagnostics()  # who looks on need not wait for it
        return result

    def _look_into_given_files(self) -> None:
        for file in given_files(self.command_line):
            passed_over = require_section(file, self.get_fully_qualified_name(), NODES)
            if passed_over:
                self.get_logger().warning(passed_over)


def run(
    name: str, make_node: Callable[[], Node], argv: list[str] | None = None, description: str = ""
) -> int:
    """Run a node until it finishes or is told to stop; the body of every executable's `main`.

    Parameters
    ----------
    name
        The executable's name, to begin an error line with.
    make_node
        Builds the node, after rclpy is up.
    argv
        Command line without the program's name; the process's own when None.
    description
        What `--help` says.

    Returns
    -------
    Exit status: 0 after work done, SIGINT or SIGTERM; 2 after a `UserError`.
    """
    arguments = sys.argv[1:] if argv is None else argv
    node: Node | None = None
    executor: SingleThreadedExecutor | None = None
    code = 0
    try:
        _answer_help(name, arguments, description)
        stay_on_this_machine(os.environ)
        interrupts = Interrupts()
        try:
            rclpy.init(args=[name, *arguments])
        except Exception as error:  # rclpy raises RCLError and UnknownROSArgsError for unusable arguments
            raise UserError(f"command line: {str(error).splitlines()[0]}; see --help") from None
        StackNode.command_line = tuple(arguments)
        node = make_node()
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        interrupts.leave_to_rclpy()
        executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except Finished as finished:
        code = finished.exit_code
    except UserError as error:
        print(f"{name}: error: {error}", file=sys.stderr, flush=True)
        code = 2
    except Exception:
        # A signal may shut rclpy down between two steps of the executor or in the middle of a callback, which
        # then ends in an RCLError, or in a RuntimeError where a message was just being taken.
        if not is_shut_down():
            raise
    finally:
        ignore_signals()
        if node is not None:
            close = getattr(node, "close", None)
            if close is not None:
                close()
            node.destroy_node()
        if executor is not None:
            # Left to the garbage collector, it may find its own parts gone and complain.
            executor.shutdown(timeout_sec=0)
        try_shutdown()
    return code


def _answer_help(name: str, arguments: list[str], description: str) -> None:
    own = arguments[: arguments.index("--ros-args")] if "--ros-args" in arguments else arguments
    parser = argparse.ArgumentParser(
        prog=name,
        description=description,
        epilog="Parameters follow --ros-args, as -p name:=value or --params-file FILE.",
    )
    _, unknown = parser.parse_known_args(own)
    if unknown:
        raise UserError(f"command line: unknown argument {unknown[0]!r}; parameters follow --ros-args -p")

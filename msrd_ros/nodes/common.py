"""What all nodes share: parameters from dataclasses, quality of service, diagnostics, start and stop."""

from __future__ import annotations

import argparse
import dataclasses
import re
import signal
import sys
import time
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.exceptions import (
    InvalidParameterTypeException,
    InvalidParameterValueException,
    ParameterUninitializedException,
)
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.utilities import ok, try_shutdown

from msrd_ros.core.errors import UserError
from msrd_ros.core.parameters import ParameterFacts, parameter
from msrd_ros.robots.loading import DEFAULT_ROBOT

Config = TypeVar("Config")


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

COMPLAINT_PERIOD_S = 1.0
MOST_COMPLAINTS = 100
SHUTDOWN_S = 0.5
_OWN_PARAMETERS = ("use_sim_time", "start_type_description_service")


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


def _descriptor(facts: ParameterFacts, default: object) -> ParameterDescriptor:
    descriptor = ParameterDescriptor(description=facts.text)
    if facts.low is None and facts.high is None:
        return descriptor
    if isinstance(default, int) and not isinstance(default, bool):
        low = -(2**63) if facts.low is None else int(facts.low)
        high = 2**63 - 1 if facts.high is None else int(facts.high)
        descriptor.integer_range = [IntegerRange(from_value=low, to_value=high, step=0)]
    else:
        low_f = -1.7e308 if facts.low is None else float(facts.low)
        high_f = 1.7e308 if facts.high is None else float(facts.high)
        descriptor.floating_point_range = [FloatingPointRange(from_value=low_f, to_value=high_f, step=0.0)]
    return descriptor


def _parameter_type(default: object) -> Parameter.Type:
    if isinstance(default, list) and not default:
        return Parameter.Type.STRING_ARRAY
    kind: Parameter.Type = Parameter.Type.from_parameter_value(default)
    return kind


def read_parameters(node: Node, config_type: type[Config]) -> Config:
    """Declare every field of a dataclass as a parameter of `node` and fill the dataclass from them.

    Raises
    ------
    UserError
        If a parameter has the wrong type, lies out of its range or does not exist; names it.
    """
    values: dict[str, Any] = {}
    name = node.get_name()
    for field in dataclasses.fields(config_type):  # type: ignore[arg-type]
        facts: ParameterFacts = field.metadata["parameter"]
        default = _default_of(field)
        descriptor = _descriptor(facts, default)
        descriptor.type = _parameter_type(default).value
        _take_former_name(node, field.name, facts.former)
        _widen_integer_override(node, field.name, default)
        try:
            value = node.declare_parameter(field.name, default or _typed_empty(default), descriptor).value
        except InvalidParameterTypeException:
            given = node._parameter_overrides[field.name].value
            raise UserError(
                f"parameter {field.name} of {name}: {given!r} has the wrong type; give "
                f"{_parameter_type(default).name.lower().replace('_', ' ')}, such as {default!r}"
            ) from None
        except (InvalidParameterValueException, ParameterUninitializedException):
            given = node._parameter_overrides[field.name].value
            raise UserError(
                f"parameter {field.name} of {name}: {given!r} is out of range; "
                f"give a value from {facts.low} to {facts.high} {facts.unit}".rstrip()
            ) from None
        if facts.choices and value not in facts.choices:
            raise UserError(
                f"parameter {field.name} of {name}: {value!r} is unknown; "
                f"use one of {', '.join(facts.choices)}"
            )
        values[field.name] = list(value or []) if isinstance(default, list) else value
    _refuse_unknown(node, values)
    return config_type(**values)


def _default_of(field: dataclasses.Field[Any]) -> Any:
    if field.default is not dataclasses.MISSING:
        return field.default
    assert field.default_factory is not dataclasses.MISSING
    return field.default_factory()


def _typed_empty(default: Any) -> Any:
    # An empty list has no type that rclpy could infer; the descriptor's type says what it is.
    return Parameter.Type.STRING_ARRAY if default == [] else default


def _take_former_name(node: Node, name: str, former: str) -> None:
    """Let a parameter be given by the name that it had in earlier versions."""
    override = node._parameter_overrides.pop(former, None)
    if override is None:
        return
    node.get_logger().warning(f"parameter {former} of {node.get_name()} is called {name} now; say {name}")
    if name not in node._parameter_overrides:
        node._parameter_overrides[name] = Parameter(name, override.type_, override.value)


def _widen_integer_override(node: Node, name: str, default: object) -> None:
    """Let `2` stand for `2.0`: YAML and command lines write whole numbers without a point."""
    override = node._parameter_overrides.get(name)
    if override is not None and isinstance(default, float) and override.type_ == Parameter.Type.INTEGER:
        node._parameter_overrides[name] = Parameter(name, Parameter.Type.DOUBLE, float(override.value))


def _refuse_unknown(node: Node, known: Mapping[str, object]) -> None:
    for name in node._parameter_overrides:
        if name not in known and name not in _OWN_PARAMETERS and not name.startswith("qos_overrides"):
            raise UserError(
                f"parameter {name} is unknown to {node.get_name()}; it has {', '.join(sorted(known))}"
            )


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
    """A node with parameters from a dataclass and a line in /diagnostics once a second."""

    def __init__(self, name: str, config_type: type[Any], **options: Any) -> None:
        super().__init__(name, **options)
        self.config = read_parameters(self, config_type)
        self._complained_s: dict[str, float] = {}
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        steady_timer(self, 1.0, self.publish_diagnostics)

    def diagnose(self) -> tuple[str, Mapping[str, object]]:
        """One line on how the node is doing, and its figures. Nodes override this."""
        return "running", {}

    def publish_diagnostics(self) -> None:
        """Say how the node is doing, now."""
        message, values = self.diagnose()
        array = DiagnosticArray(status=[status(self.get_name(), message, values)])
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

    def on_change(self, names: tuple[str, ...], apply: Callable[[str, Any], None]) -> None:
        """Let `apply` take changes of the named parameters while running; all others are refused."""

        def accept(parameters: list[Parameter]) -> SetParametersResult:
            for item in parameters:
                if item.name not in names:
                    return SetParametersResult(
                        successful=False, reason=f"{item.name} can only be set when the node starts"
                    )
                try:
                    apply(item.name, item.value)
                except UserError as error:
                    return SetParametersResult(successful=False, reason=str(error))
            return SetParametersResult(successful=True)

        self.add_on_set_parameters_callback(accept)


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
        try:
            rclpy.init(args=[name, *arguments])
        except Exception as error:  # rclpy raises RCLError and UnknownROSArgsError for unusable arguments
            raise UserError(f"command line: {str(error).splitlines()[0]}; see --help") from None
        node = make_node()
        executor = SingleThreadedExecutor()
        executor.add_node(node)
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
        if not _is_shut_down():
            raise
    finally:
        # A second Ctrl-C must not cut the clean-up short.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
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


def _is_shut_down() -> bool:
    """Whether a signal has shut rclpy down; it does so on a thread of its own, which may need a moment."""
    deadline_s = time.monotonic() + SHUTDOWN_S
    while ok() and time.monotonic() < deadline_s:
        time.sleep(0.01)
    return not ok()


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

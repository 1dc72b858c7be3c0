"""Parameters of a node from a dataclass: declared, held against what is allowed, changed at run time."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node
from rclpy.parameter import Parameter

from msrd_ros.core.errors import UserError
from msrd_ros.core.parameters import ParameterFacts

Config = TypeVar("Config")

_OWN_PARAMETERS = ("use_sim_time", "start_type_description_service")
_LARGEST_INTEGER = 2**63 - 1
_LARGEST_FLOAT = 1.7e308


def read_parameters(node: Node, config_type: type[Config]) -> Config:
    """Declare every field of a dataclass as a parameter of `node` and fill the dataclass from them.

    Raises
    ------
    UserError
        If a parameter has the wrong type, is not allowed or does not exist; names it.
    """
    values: dict[str, Any] = {}
    for field in dataclasses.fields(config_type):  # type: ignore[arg-type]
        facts, default = _facts_of(field), _default_of(field)
        _take_former_name(node, field.name, facts.former)
        given = node._parameter_overrides.get(field.name)
        if given is not None and given.type_ != Parameter.Type.NOT_SET:
            fitting = fit(given, default)
            facts.require(_plain(fitting.value), default, _where(node, field.name))
            node._parameter_overrides[field.name] = fitting
        descriptor = _descriptor(facts, default)
        value = node.declare_parameter(field.name, default or _typed_empty(default), descriptor).value
        values[field.name] = list(value or []) if isinstance(default, list) else value
    _refuse_unknown(node, values)
    return config_type(**values)


def read_change(node: Node, config_type: type[Any], changes: Sequence[Parameter]) -> list[Parameter]:
    """Hold a change at run time against what was held against at the start.

    Returns
    -------
    The parameters to set: those of `changes`, whole numbers widened where a parameter is not one.

    Raises
    ------
    UserError
        If one of them is unknown, can only be set at the start, or is not allowed; says what is.
    """
    fields = {field.name: field for field in dataclasses.fields(config_type)}
    wanted = []
    for change in changes:
        if is_own(change.name):
            wanted.append(change)
            continue
        if change.name not in fields:
            raise UserError(_unknown(node, change.name, fields))
        facts, default = _facts_of(fields[change.name]), _default_of(fields[change.name])
        if not facts.live:
            raise UserError(
                f"{_where(node, change.name)} can only be set when it starts: with --ros-args "
                f"-p {change.name}:=VALUE, or in its parameter file; start it again with that"
            )
        fitting = fit(change, default)
        facts.require(_plain(fitting.value), default, _where(node, change.name))
        wanted.append(fitting)
    return wanted


def is_own(name: str) -> bool:
    """Whether a parameter is one that rclpy gives to every node."""
    return name in _OWN_PARAMETERS or name.startswith("qos_overrides")


def fit(given: Parameter, default: object) -> Parameter:
    """Let `2` stand for `2.0`, and a text for a list of it: so YAML and command lines are written."""
    if isinstance(default, float) and given.type_ == Parameter.Type.INTEGER:
        return Parameter(given.name, Parameter.Type.DOUBLE, float(given.value))
    if isinstance(default, list) and given.type_ == Parameter.Type.STRING:
        return Parameter(given.name, Parameter.Type.STRING_ARRAY, [given.value])
    return given


def _where(node: Node, name: str) -> str:
    return f"parameter {name} of {node.get_name()}"


def _plain(value: Any) -> Any:
    # Sequences come as lists, tuples or arrays.
    return value if value is None or isinstance(value, str | bool | int | float) else list(value)


def _facts_of(field: dataclasses.Field[Any]) -> ParameterFacts:
    facts: ParameterFacts = field.metadata["parameter"]
    return facts


def _default_of(field: dataclasses.Field[Any]) -> Any:
    if field.default is not dataclasses.MISSING:
        return field.default
    assert field.default_factory is not dataclasses.MISSING
    return field.default_factory()


def _typed_empty(default: Any) -> Any:
    # An empty list has no type that rclpy could infer; the descriptor's type says what it is.
    return Parameter.Type.STRING_ARRAY if default == [] else default


def _descriptor(facts: ParameterFacts, default: object) -> ParameterDescriptor:
    empty = isinstance(default, list) and not default
    kind = Parameter.Type.STRING_ARRAY if empty else Parameter.Type.from_parameter_value(default)
    descriptor = ParameterDescriptor(description=facts.text, type=kind.value, read_only=not facts.live)
    if facts.low is None and facts.high is None:
        return descriptor
    if isinstance(default, int) and not isinstance(default, bool):
        low = -_LARGEST_INTEGER if facts.low is None else int(facts.low)
        high = _LARGEST_INTEGER if facts.high is None else int(facts.high)
        descriptor.integer_range = [IntegerRange(from_value=low, to_value=high, step=0)]
    else:
        low_f = -_LARGEST_FLOAT if facts.low is None else float(facts.low)
        high_f = _LARGEST_FLOAT if facts.high is None else float(facts.high)
        descriptor.floating_point_range = [FloatingPointRange(from_value=low_f, to_value=high_f, step=0.0)]
    return descriptor


def _take_former_name(node: Node, name: str, former: str) -> None:
    """Let a parameter be given by the name that it had in earlier versions."""
    override = node._parameter_overrides.pop(former, None)
    if override is None:
        return
    node.get_logger().warning(f"parameter {former} of {node.get_name()} is called {name} now; say {name}")
    if name not in node._parameter_overrides:
        node._parameter_overrides[name] = Parameter(name, override.type_, override.value)


def _refuse_unknown(node: Node, known: Mapping[str, object]) -> None:
    for name in node._parameter_overrides:
        if name not in known and not is_own(name):
            raise UserError(_unknown(node, name, known))


def _unknown(node: Node, name: str, known: Mapping[str, object]) -> str:
    return f"parameter {name} is unknown to {node.get_name()}; it has {', '.join(sorted(known))}"

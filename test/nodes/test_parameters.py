"""Parameters at run time: live ones take effect, all others are refused with how to set them."""

from __future__ import annotations

import ast
import dataclasses
import inspect
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
import rclpy
from rclpy.context import Context
from rclpy.parameter import Parameter

from msrd_ros.core.errors import UserError
from msrd_ros.core.parameters import ParameterFacts, parameter
from msrd_ros.nodes.common import StackNode
from msrd_ros.nodes.managed import ManagedNode
from msrd_ros.nodes.parameter_files import NODES, config_type, node_type


def lower_case(text: str, where: str) -> None:
    if text != text.lower():
        raise UserError(f"{where}: {text!r} has capitals; use a-z")


@dataclass(frozen=True)
class LampConfig:
    brightness: float = parameter(0.5, "How bright", unit="cd", low=0.0, high=1.0, live=True)
    colour: str = parameter("white", "Of its light", choices=("white", "red"), live=True)
    owner: str = parameter("nobody", "Whose it is", live=True, check=lower_case)
    rooms: list[str] = parameter([], "Where it is wanted", live=True)
    socket: str = parameter("E27", "What it is screwed into")


class Lamp(StackNode):
    """A node with parameters of every kind."""

    def __init__(self, context: Context) -> None:
        super().__init__("lamp", LampConfig, context=context)
        self.burning: list[tuple[float, str]] = []
        self.on_change(self._burn, "brightness", "colour")

    def _burn(self) -> None:
        self.burning.append((self.config.brightness, self.config.colour))


@pytest.fixture
def context(domain_id: int) -> Iterator[Context]:
    one = Context()
    rclpy.init(args=[], context=one, domain_id=domain_id)
    yield one
    one.try_shutdown()


@pytest.fixture
def lamp(context: Context) -> Iterator[Lamp]:
    node = Lamp(context)
    yield node
    node.destroy_node()  # type: ignore[no-untyped-call]


def set_to(lamp: Lamp, **values: object) -> str:
    """Set at once; why not, empty if it was done."""
    result = lamp.set_parameters_atomically([Parameter(name, value=value) for name, value in values.items()])
    assert result.successful == (not result.reason)
    return str(result.reason)


def test_a_live_parameter_takes_effect_at_once(lamp: Lamp) -> None:
    assert set_to(lamp, brightness=0.75) == ""
    assert lamp.config.brightness == lamp.get_parameter("brightness").value == 0.75
    assert set_to(lamp, brightness=1) == ""
    assert lamp.get_parameter("brightness").value == 1.0
    assert set_to(lamp, owner="me") == ""
    assert lamp.burning == [(0.75, "white"), (1.0, "white")]
    assert set_to(lamp, rooms="hall") == ""
    assert lamp.config.rooms == ["hall"]
    assert set_to(lamp, rooms=["hall", "attic"]) == ""
    assert lamp.config.rooms == ["hall", "attic"]


def test_several_are_set_together_or_not_at_all(lamp: Lamp) -> None:
    assert set_to(lamp, brightness=0.25, colour="red") == ""
    assert lamp.burning == [(0.25, "red")]
    for values in ({"colour": "blue"}, {"socket": "E14"}, {"volts": 12}):
        assert set_to(lamp, brightness=0.1, **values)
    assert lamp.config == LampConfig(brightness=0.25, colour="red")
    assert lamp.get_parameter("brightness").value == 0.25
    assert len(lamp.burning) == 1


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        (
            "brightness",
            1.5,
            "parameter brightness of lamp: 1.5 is out of range; give a value from 0.0 to",
        ),
        ("brightness", "bright", "parameter brightness of lamp: 'bright' has the wrong type; give double"),
        ("colour", "blue", "parameter colour of lamp: 'blue' is unknown; use one of white, red"),
        ("owner", "Me", "parameter owner of lamp: 'Me' has capitals; use a-z"),
        (
            "socket",
            "E14",
            "parameter socket of lamp can only be set when it starts: with --ros-args -p soc",
        ),
        ("volts", 12, "parameter volts is unknown to lamp; it has brightness, colour, owner, rooms, socket"),
    ],
)
def test_a_refusal_names_parameter_value_and_what_is_allowed(
    lamp: Lamp, name: str, value: object, words: str
) -> None:
    assert set_to(lamp, **{name: value}).startswith(words)
    assert lamp.config == LampConfig()
    assert not lamp.burning


def test_tools_see_what_may_be_set_and_between_what(lamp: Lamp) -> None:
    described = {name: lamp.describe_parameter(name) for name in ("brightness", "socket")}
    assert described["socket"].read_only
    assert not described["brightness"].read_only
    (bounds,) = described["brightness"].floating_point_range
    assert (bounds.from_value, bounds.to_value) == (0.0, 1.0)
    assert described["brightness"].description == "How bright [cd]"


def test_parameters_of_rclpy_itself_are_left_to_it(lamp: Lamp) -> None:
    assert set_to(lamp, use_sim_time=True) == ""
    assert lamp.get_parameter("use_sim_time").value is True


def reads(tree: ast.AST) -> Iterator[str]:
    """Attributes that code looks up in a `config`."""
    for item in ast.walk(tree):
        if isinstance(item, ast.Attribute) and ast.unparse(item.value) in ("config", "self.config"):
            yield item.attr


def code_of(kind: type) -> ast.Module:
    return ast.parse(Path(inspect.getfile(kind)).read_text(encoding="utf-8"))


DECLARED = [
    (node, field.name, field.metadata["parameter"])
    for node in NODES
    for field in dataclasses.fields(config_type(node))
]


@pytest.mark.parametrize(("node", "name"), [(node, name) for node, name, _ in DECLARED])
def test_every_declared_parameter_is_read(node: str, name: str) -> None:
    managed = issubclass(node_type(node), ManagedNode)
    assert name in {*reads(code_of(node_type(node))), *(reads(code_of(ManagedNode)) if managed else ())}


@pytest.mark.parametrize(("node", "name"), [(node, name) for node, name, facts in DECLARED if facts.live])
def test_every_live_parameter_is_looked_up_when_needed_or_has_a_hook(node: str, name: str) -> None:
    tree = code_of(node_type(node))
    methods = [item for item in ast.walk(tree) if isinstance(item, ast.FunctionDef)]
    # What only these read would stay as it was at the start.
    at_start = ("__init__", "configure")
    later = {name for method in methods if method.name not in at_start for name in reads(method)}
    hooked = {
        argument.value
        for item in ast.walk(tree)
        if isinstance(item, ast.Call) and ast.unparse(item.func) == "self.on_change"
        for argument in item.args
        if isinstance(argument, ast.Constant)
    }
    assert name in later | hooked


def test_what_stops_an_arm_is_live() -> None:
    live = {(node, name) for node, name, facts in DECLARED if facts.live}
    assert {("executor", "enabled"), ("executor", "accept_policy"), ("executor", "stale_timeout_s")} <= live
    assert all(isinstance(facts, ParameterFacts) and facts.description for _, _, facts in DECLARED)

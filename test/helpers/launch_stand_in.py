"""Small stand-ins of `launch` and `launch_ros`, for where there is no ROS installation.

They have the names and keywords that the launch files use, refuse all others, and keep what they are given.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any


@dataclass
class Context:
    """What a launch holds while it runs."""

    launch_configurations: dict[str, str] = field(default_factory=dict)


@dataclass
class LaunchDescription:
    """Entities in their order."""

    entities: Sequence[Any]


@dataclass
class DeclareLaunchArgument:
    """An argument."""

    name: str
    default_value: str
    description: str
    choices: list[str] | None = None

    def __post_init__(self) -> None:
        assert self.choices is None or self.default_value in self.choices


@dataclass
class LaunchConfiguration:
    """The value of an argument, later."""

    name: str

    def perform(self, context: Context) -> str:
        return context.launch_configurations[self.name]


@dataclass
class OpaqueFunction:
    """Entities that a function makes."""

    function: Callable[..., list[Any]]
    args: Sequence[Any]


@dataclass
class Shutdown:
    """The end of all."""

    reason: str


@dataclass
class ExecuteProcess:
    """A process."""

    cmd: Sequence[Any]
    output: str


@dataclass
class ExecutableInPackage:
    """Where an executable is, later."""

    executable: str
    package: str


@dataclass
class Node:
    """A node as a process."""

    package: str
    executable: str
    name: str
    namespace: str
    remappings: list[tuple[str, str]]
    ros_arguments: list[str]
    parameters: list[Any]
    output: str
    respawn: bool
    respawn_delay: float
    on_exit: Callable[[Any, Context], list[Any]]


_MODULES: dict[str, tuple[type, ...]] = {
    "launch": (LaunchDescription,),
    "launch.actions": (DeclareLaunchArgument, ExecuteProcess, OpaqueFunction, Shutdown),
    "launch.substitutions": (LaunchConfiguration,),
    "launch_ros": (),
    "launch_ros.actions": (Node,),
    "launch_ros.substitutions": (ExecutableInPackage,),
}


def modules() -> dict[str, ModuleType]:
    """Modules to put into sys.modules."""
    made = {}
    for name, contents in _MODULES.items():
        made[name] = ModuleType(name)
        for one in contents:
            setattr(made[name], one.__name__, one)
    return made


def entities(description: LaunchDescription, said: dict[str, str]) -> list[Any]:
    """What a description starts when these arguments are given."""
    context = Context(dict(said))
    found = []
    for entity in description.entities:
        if isinstance(entity, DeclareLaunchArgument):
            context.launch_configurations.setdefault(entity.name, entity.default_value)
        elif isinstance(entity, OpaqueFunction):
            found += entity.function(context, *entity.args)
        else:
            found.append(entity)
    return found

"""The sets of `sets.py` as launch descriptions; each file of ``launch/`` is one of them."""

from __future__ import annotations

from typing import Any

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess, OpaqueFunction, Shutdown
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.substitutions import ExecutableInPackage

from msrd_ros.stack.arguments import Argument
from msrd_ros.stack.sets import REMAPPINGS, SETS, NodeCall, NodeSet, Part, RosOptions

PACKAGE = "msrd_ros"
RESPAWN_PAUSE_S = 2.0


def describe(name: str) -> LaunchDescription:
    """A set with its arguments."""
    chosen = SETS[name]
    return LaunchDescription(
        [*map(_declare, chosen.arguments), OpaqueFunction(function=_start, args=[chosen])]
    )


def _declare(argument: Argument) -> Any:
    choices = [*argument.choices] if argument.default else ["", *argument.choices]
    return DeclareLaunchArgument(
        argument.name,
        default_value=argument.default,
        description=argument.description,
        choices=choices if argument.choices else None,
    )


def _start(context: Any, chosen: NodeSet) -> list[Any]:
    texts = {one.name: LaunchConfiguration(one.name).perform(context) for one in chosen.arguments}
    values = chosen.read(texts)
    stages = chosen.stages(values)
    if len(stages) > 1:
        # One stage after the other, with a report at the end, is work for one process.
        words = [f"{name}:={text}" for name, text in texts.items() if text]
        command = [ExecutableInPackage("up", PACKAGE), chosen.name, *words]
        return [ExecuteProcess(cmd=command, output="screen")]
    options = RosOptions.of(values)
    return [_node(call, options, values["respawn"] is True) for call in stages[0].nodes]


def _node(call: NodeCall, options: RosOptions, respawn: bool) -> Any:
    options = options.within(call.namespace)
    files = [options.params_file] if options.params_file else []

    def on_exit(event: Any, context: Any) -> list[Any]:
        """End all with a node that is done or lost."""
        is_done = call.part is not Part.STAYS and event.returncode == 0
        if (call.part is Part.FINISHES and is_done) or (respawn and not is_done):
            return []
        return [Shutdown(reason=f"{call.label} ended with exit status {event.returncode}")]

    return Node(
        package=PACKAGE,
        executable=call.executable,
        name=call.executable,
        namespace=options.namespace,
        remappings=[*REMAPPINGS],
        ros_arguments=options.log_words(call.executable),
        parameters=[*files, call.parameters] if call.parameters else files,
        output="screen",
        respawn=respawn,
        respawn_delay=RESPAWN_PAUSE_S,
        on_exit=on_exit,
    )

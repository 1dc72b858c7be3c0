"""`python -m msrd_ros <name>`: every executable without the `ros2` command.

Only what is asked for is imported: `recorder` starts without torch, `reproduce` without rclpy.
"""

from __future__ import annotations

import importlib
import os
import sys
from typing import NamedTuple

from msrd_ros.core.compiled_cache import choose_compiled_cache
from msrd_ros.core.errors import UserError
from msrd_ros.core.parent import end_with_parent
from msrd_ros.core.scratch import provide_writable_directories


class Command(NamedTuple):
    """Where a command lives, and what it does in a few words."""

    module: str
    summary: str


PACKAGE = "msrd_ros"

EXECUTABLES: dict[str, Command] = {
    "simulator": Command("msrd_ros.nodes.simulator", "arm, table, ball, feeder and referee in PyBullet"),
    "demonstrator": Command("msrd_ros.nodes.demonstrator", "teachers who lead the arm by the hand"),
    "recorder": Command("msrd_ros.nodes.recorder", "keep strokes that returned the ball as MCAP bags"),
    "player": Command("msrd_ros.nodes.player", "replay bags onto the topics"),
    "trainer": Command("msrd_ros.nodes.trainer", "learn rewards and policies from bags"),
    "executor": Command("msrd_ros.nodes.executor", "play a learned strategy on the simulator or the robot"),
    "evaluator": Command("msrd_ros.nodes.evaluator", "feed balls to the executor and report how it played"),
    "match": Command("msrd_ros.nodes.match", "two arms at one table in PyBullet, for rallies"),
    "chooser": Command("msrd_ros.nodes.chooser", "name an arm's next strategy from where the ball comes"),
    "studio": Command("msrd_ros.studio.studio", "a page in the browser to watch and drive the stack with"),
    "reproduce": Command("msrd_ros.studies.reproduce", "run the paper's studies again"),
    "up": Command("msrd_ros.up.command", "start all that it takes to teach, play or train, or the demo"),
}
"""What `ros2 run msrd_ros <name>` finds: one file of this name under ``lib/msrd_ros`` each."""

COMMANDS: dict[str, Command] = {
    **EXECUTABLES,
    "plan": Command("msrd_ros.table_tennis.teachers.plan", "plan the six strokes for an arm"),
    "aim": Command("msrd_ros.table_tennis.strokes.aim", "teach policies to land where they are told"),
    "rally": Command("msrd_ros.rally.command", "two arms play each other: how long their rallies are"),
    "learn-rally": Command("msrd_ros.rally.learn_command", "learn the policies of rallies"),
    "explain": Command("msrd_ros.explain.command", "what learned rewards say of a recorded stroke"),
    "doctor": Command("msrd_ros.stack.doctor", "look at the running stack: what keeps it from its work"),
}

FORMER = {"demo": "up demo"}
"""What is said otherwise now."""

EXTRAS = {
    "nodes": "ros,sim",
    "studio": "ros,sim,studio",
    "stack": "ros,sim",
    "up": "ros,sim",
    "explain": "sim",
    "table_tennis": "sim",
    "rally": "sim",
    "studies": "studies",
}
"""Extras of the installation that commands need, by the room that a command lives in."""

USER_ERROR = 2
INTERRUPTED = 130


def main(argv: list[str] | None = None) -> int:
    """Run the command that `argv` names.

    Parameters
    ----------
    argv
        The command's name and its own arguments; the process's arguments when None.

    Returns
    -------
    The command's exit status; 2 for an unknown name or another user error, 130 if it was interrupted
    before it could listen to signals itself.
    """
    arguments = sys.argv[1:] if argv is None else argv
    if not arguments or arguments[0] in ("-h", "--help"):
        print(_usage())
        return 0
    name, *rest = arguments
    if name in FORMER:
        print(f"msrd_ros: error: {name} is called `{FORMER[name]}` now; see `up --help`", file=sys.stderr)
        return USER_ERROR
    if name not in COMMANDS:
        print(f"msrd_ros: error: unknown name {name!r}; use one of these\n{_list()}", file=sys.stderr)
        return USER_ERROR
    end_with_parent(os.environ)
    provide_writable_directories(os.environ)
    choose_compiled_cache(os.environ)
    try:
        return _run(name, rest)
    except UserError as error:
        print(f"{name}: error: {error}", file=sys.stderr)
        return USER_ERROR
    except KeyboardInterrupt:
        return INTERRUPTED


def _run(name: str, arguments: list[str]) -> int:
    module = COMMANDS[name].module
    try:
        return int(importlib.import_module(module).main(arguments))
    except ModuleNotFoundError as error:
        missing = (error.name or "").partition(".")[0]
        if missing in ("", PACKAGE):
            raise
        raise UserError(
            f"the Python package {missing!r} is missing for {sys.executable}; install what {name} needs: "
            f"pip install '{PACKAGE}[{EXTRAS.get(module.split('.')[1], 'all')}]'"
        ) from error


def _usage() -> str:
    return f"usage: python -m msrd_ros <name> [arguments]; each <name> answers --help\n{_list()}"


def _list() -> str:
    return "\n".join(f"  {name:<13} {command.summary}" for name, command in COMMANDS.items())


if __name__ == "__main__":
    sys.exit(main())

"""`python -m msrd_ros up`: start nodes together, see what each says, and end all with one Ctrl-C."""

from __future__ import annotations

import os
import signal
import sys
import textwrap
from collections.abc import Sequence
from typing import Any

from msrd_ros.core.discovery import DISCOVERY_RANGE, stay_on_this_machine
from msrd_ros.core.errors import UserError
from msrd_ros.stack.arguments import Values, split_words
from msrd_ros.stack.console import Console
from msrd_ros.stack.processes import NodeLostError, NodeProcess
from msrd_ros.stack.sets import SETS, NodeCall, NodeSet, RosOptions
from msrd_ros.stack.stage_run import StageRun

NAME = "up"
WIDTH = 100
NODE_FAILED, USER_ERROR, INTERRUPTED = 1, 2, 130
_END_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_HELP = ("-h", "--help")


def main(argv: list[str] | None = None) -> int:
    """Start a set of nodes; see `--help`.

    Returns
    -------
    0 after work done or a signal, 1 after the loss of a node, 2 after a wrong call; 130 for a demo cut short.
    """
    words = sys.argv[1:] if argv is None else argv
    if not words or words[0] in _HELP:
        print(_usage())
        return 0 if words else USER_ERROR
    name, *rest = words
    if name not in SETS:
        raise UserError(f"there is no {name!r} to start; say one of {', '.join(SETS)}, and see --help")
    chosen = SETS[name]
    if any(word in _HELP for word in rest):
        print(_usage_of(chosen))
        return 0
    values = chosen.read(split_words(name, rest))
    stages = chosen.stages(values)
    _require_robot(values.text("robot"))
    _interrupt_once()
    console = Console(sys.stdout)
    try:
        if name == "demo":
            from msrd_ros.demo.stages import run_demo

            run_demo(values, stages, console)
        else:
            (stage,) = stages
            environment = _environment(console)
            _greet(console, chosen, values, [call.label for call in stage.nodes], environment)
            options = RosOptions.of(values)

            def start(call: NodeCall) -> NodeProcess:
                words = options.within(call.namespace).words(call.executable)
                return NodeProcess(call.label, call.parameters, environment, console, words)

            def tell(line: str) -> None:
                console.say(NAME, line)

            with StageRun(stage, start, tell, respawn=values["respawn"] is True) as run:
                run.wait()
    except NodeLostError as error:
        print(f"{NAME}: error: {error}", file=sys.stderr, flush=True)
        return NODE_FAILED
    except KeyboardInterrupt:
        console.say(NAME, "all has ended")
        return INTERRUPTED if name == "demo" else 0
    return 0


def _environment(console: Console) -> dict[str, str]:
    """Environment of the nodes: readable on one terminal, with the user's own settings left alone."""
    environment = dict(os.environ)
    stay_on_this_machine(environment)
    # Who speaks is said before the line.
    environment.setdefault("RCUTILS_CONSOLE_OUTPUT_FORMAT", "[{severity}] {message}")
    if console.columns is not None:
        environment.setdefault("RCUTILS_COLORIZED_OUTPUT", "1")
        environment.setdefault("COLUMNS", str(console.columns - len("[demonstrator] ")))
    return environment


def _greet(
    console: Console, chosen: NodeSet, values: Values, nodes: Sequence[str], environment: dict[str, str]
) -> None:
    """Say what is started, where it meets, where its outputs go and how to end it."""
    domain = environment.get("ROS_DOMAIN_ID") or 0
    reach = environment[DISCOVERY_RANGE]
    namespace = values.text("namespace") or "/"
    console.say(
        NAME,
        f"{chosen.name}: starts {', '.join(nodes)} on domain {domain} ({reach}), namespace {namespace}",
    )
    console.say(NAME, chosen.outputs(values))
    console.say(NAME, "Ctrl-C ends all of it")


def _require_robot(robot: str) -> None:
    if robot:
        from msrd_ros.robots.loading import load_robot

        load_robot(robot)


def _interrupt_once() -> None:
    """Let the first signal to end raise KeyboardInterrupt, and let no second one cut the clean-up short."""

    def interrupt(number: int, frame: Any) -> None:
        for each in _END_SIGNALS:
            signal.signal(each, signal.SIG_IGN)
        raise KeyboardInterrupt

    for number in _END_SIGNALS:
        signal.signal(number, interrupt)


def _usage() -> str:
    lines = [f"  {chosen.name:<7} {chosen.summary}" for chosen in SETS.values()]
    told = "\n".join(lines)
    return f"usage: python -m msrd_ros up <set> [name:=value ...]; each <set> answers --help\n{told}"


def _usage_of(chosen: NodeSet) -> str:
    lines = [f"usage: python -m msrd_ros up {chosen.name} [name:=value ...]", f"{chosen.summary}", ""]
    for argument in chosen.arguments:
        default = f" (default: {argument.default})" if argument.default else ""
        text = textwrap.wrap(f"{argument.description}{default}", WIDTH - 16)
        lines += [f"  {argument.name:<12}  {text[0]}", *(f"{'':16}{line}" for line in text[1:])]
    return "\n".join(lines)

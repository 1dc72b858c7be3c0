"""What is started together: which executables, with which parameters, from which arguments.

`python -m msrd_ros up` and the launch files both start from here. It needs the standard library alone, as
`ros2 launch` reads it with the Python of the system.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from enum import Enum
from pathlib import Path

from msrd_ros.core.errors import UserError
from msrd_ros.core.resources import share_directory
from msrd_ros.robots.default import DEFAULT_ROBOT
from msrd_ros.stack.arguments import (
    Argument,
    Value,
    Values,
    as_count,
    as_file,
    as_names,
    as_namespace,
    as_path,
    as_truth,
    read_values,
)

REMAPPINGS = (("/clock", "clock"), ("/tf", "tf"), ("/tf_static", "tf_static"))
"""Each namespace has a clock and frames of its own; without a namespace these change nothing."""

POLICIES_FILE = "policies.safetensors"
RALLY_POLICIES_FILE = "rally.safetensors"
"""Policies of an arm that learned from balls of rallies."""
ENDS = ("near", "far")
"""Namespaces of the two arms of a match; `ball.ends` has their frames."""


class Part(Enum):
    """What the end of a node means to its stage."""

    STAYS = "is needed until the stage is over"
    FINISHES = "may be done before"
    ENDS = "its end is the end of the stage"


@dataclass(frozen=True)
class NodeCall:
    """An executable with its parameters."""

    executable: str
    parameters: dict[str, Value] = field(default_factory=dict)
    part: Part = Part.STAYS
    namespace: str = ""
    """Within that of its set."""

    @property
    def label(self) -> str:
        """Its name for people: with its namespace, where it has one of its own."""
        return f"{self.namespace}/{self.executable}" if self.namespace else self.executable

    def having(self, **parameters: Value) -> NodeCall:
        """The same with further parameters."""
        return replace(self, parameters={**self.parameters, **parameters})


@dataclass(frozen=True)
class Stage:
    """Nodes that run side by side, in the order in which they start."""

    name: str
    title: str
    nodes: tuple[NodeCall, ...]


@dataclass(frozen=True)
class RosOptions:
    """What all nodes of a set are started with: namespace, parameter file and log level; empty for none."""

    namespace: str = ""
    params_file: str = ""
    log_level: str = ""

    @classmethod
    def of(cls, values: Values) -> RosOptions:
        """From the arguments of a set."""
        return cls(*(values.text(name) for name in ("namespace", "params_file", "log_level")))

    def within(self, namespace: str) -> RosOptions:
        """The same for a node in a namespace within this one."""
        return replace(self, namespace=f"{self.namespace}/{namespace}") if namespace else self

    def log_words(self, node: str) -> list[str]:
        """ROS arguments for the level of a node's own log: everybody's would let the middleware speak."""
        if not self.log_level:
            return []
        logger = f"{self.namespace}/{node}".strip("/").replace("/", ".")
        return ["--log-level", f"{logger}:={self.log_level}"]

    def words(self, node: str) -> list[str]:
        """ROS arguments of a node; what is said after them goes before the parameter file."""
        words = ["-r", f"__ns:={self.namespace}"] if self.namespace else []
        for source, target in REMAPPINGS:
            words += ["-r", f"{source}:={target}"]
        words += self.log_words(node)
        return [*words, "--params-file", self.params_file] if self.params_file else words


@dataclass(frozen=True)
class NodeSet:
    """A set that can be started.

    Attributes
    ----------
    name, summary
        What it is called, and what it does.
    arguments
        What it takes.
    stages
        What is started, one stage after the other.
    outputs
        Where what it makes goes, in words.
    """

    name: str
    summary: str
    arguments: tuple[Argument, ...]
    stages: Callable[[Values], tuple[Stage, ...]]
    outputs: Callable[[Values], str]

    def read(self, texts: dict[str, str]) -> Values:
        """Values of its arguments.

        Raises
        ------
        UserError
            If one of them does not exist or is not allowed; says what is.
        """
        return read_values(self.name, self.arguments, texts)


_FROM_FILE = "what params_file says, else {}"
_COMMON = (
    Argument("namespace", "Namespace of all its nodes, with a clock of its own", read=as_namespace),
    Argument("params_file", "Parameter file for all its nodes; arguments go before it", read=as_file),
    Argument(
        "log_level", "How much its nodes tell", "info", choices=("debug", "info", "warn", "error", "fatal")
    ),
    Argument(
        "respawn",
        "Start a node again that dies, instead of ending all",
        "false",
        choices=("true", "false"),
        read=as_truth,
    ),
)
_ROBOT = Argument(
    "robot",
    "The arm: a name below config/robots, or a folder with its robot.yaml",
    unset=_FROM_FILE.format(DEFAULT_ROBOT),
)
_MODE = Argument(
    "mode",
    "lockstep goes as fast as the machine allows; real_time follows the wall clock",
    unset=_FROM_FILE.format("lockstep"),
    choices=("lockstep", "real_time"),
)
_GUI = Argument(
    "gui",
    "Show Bullet's window",
    unset=_FROM_FILE.format("false"),
    choices=("true", "false"),
    read=as_truth,
)
_SEED = Argument("seed", "Everything random follows from it", unset=_FROM_FILE.format("0"), read=as_count(0))


def _patience(values: Values) -> dict[str, Value]:
    """How long to wait for the others: while one that starts for the first time compiles, all others wait.

    Who is lost is noticed at once by who has started all of them. A parameter file decides on its own.
    """
    return {} if "params_file" in values else {"timeout_s": 300.0}


def _teach(values: Values) -> tuple[Stage, ...]:
    simulator = NodeCall("simulator", values.pick("robot", "gui", "seed"))
    recorder = NodeCall("recorder", values.pick("robot", directory="bags"))
    study = values.pick("robot", "subjects", "recordings", "seed")
    return (
        Stage(
            "record",
            "Teach and record",
            (simulator, recorder, NodeCall("demonstrator", {**_patience(values), **study}, Part.ENDS)),
        ),
    )


def _play(values: Values) -> tuple[Stage, ...]:
    simulator = NodeCall("simulator", values.pick("robot", "mode", "gui", "seed"))
    executor = NodeCall("executor", values.pick("robot", "mode", "checkpoint", "seed"))
    nodes = [simulator, executor]
    if values.number("balls"):
        if "checkpoint" not in values:
            raise UserError(
                f"play: nothing to play without policies: give checkpoint:=FILE, such as out/demo/training/"
                f"{POLICIES_FILE} of `up demo`, or balls:=0 to wait for those of a trainer"
            )
        asked = values.pick("robot", "checkpoint", "labels", "balls", "report", "seed")
        nodes.append(NodeCall("evaluator", {**_patience(values), **asked}, Part.ENDS))
    return (Stage("play", "Play every strategy", tuple(nodes)),)


def _train(values: Values) -> tuple[Stage, ...]:
    picked = values.pick("robot", "bags", "labels", "out", "resume", "iterations", "seed")
    return (Stage("train", "Train", (NodeCall("trainer", picked, Part.ENDS),)),)


def _demo(values: Values) -> tuple[Stage, ...]:
    out, seed = Path(values.text("out")), values.number("seed")
    bags, training = str(out / "bags"), out / "training"
    robot = values.pick("robot")
    study = {name: values[name] for name in ("subjects", "recordings", "seed")}
    taught = Values({**robot, **study, "bags": bags})
    checkpoint = str(training / POLICIES_FILE)
    report = str(out / "evaluation.json")
    played = Values(
        {**robot, "checkpoint": checkpoint, "balls": values["balls"], "seed": seed, "report": report}
    )
    trainer: dict[str, Value] = {
        **values.pick("robot", "iterations"),
        "source": "played",
        "wanted": values.number("subjects") * values.number("recordings"),
        "idle_start_s": 15.0,
        "out": str(training),
        "seed": seed,
        "targets": True,
    }
    player: dict[str, Value] = {"bags": [bags], "rate": 0.0, "max_messages_per_s": 1500.0}
    kept: dict[str, Value] = {**robot, "directory": str(out / "played"), "subject": "robot", "keep": "all"}
    (record,), (play,) = _teach(taught), _play(played)
    simulator, executor, evaluator = play.nodes
    executor = executor.having(ready_noise_rad=0.03, accept_policy=False)
    return (
        record,
        Stage(
            "train",
            "Replay the bags into training",
            (
                NodeCall("trainer", trainer, Part.ENDS),
                NodeCall("player", player, Part.FINISHES),
            ),
        ),
        replace(play, nodes=(simulator.having(seed=seed + 1), executor, evaluator.having(targets=True))),
        Stage(
            "film",
            "Film one stroke of each",
            (
                simulator.having(seed=seed + 2),
                NodeCall("executor", {**robot, "checkpoint": checkpoint, "accept_policy": False}),
                NodeCall("recorder", kept),
                NodeCall("evaluator", {**robot, "balls": 2, "seed": seed + 1}, Part.ENDS),
            ),
        ),
    )


def _studio(values: Values) -> tuple[Stage, ...]:
    robot, mode = values.pick("robot"), values.text("mode")
    has_driver = values.text("arm") == "real"
    if has_driver and mode != "real_time":
        raise UserError("studio arm:=real: a real arm goes by the clock; say mode:=real_time, too")
    paced: dict[str, Value] = {"rate": 1.0} if mode == "lockstep" else {}
    simulator = NodeCall("simulator", {**robot, **values.pick("mode", "seed"), **paced})
    recorder = NodeCall("recorder", {**robot, **values.pick(directory="bags")})
    played: dict[str, Value] = {
        "checkpoint": values.text("checkpoint") or _policies_of(values.text("robot") or DEFAULT_ROBOT)
    }
    executor = NodeCall("executor", {**robot, **values.pick("mode"), **played, "seed": values["seed"]})
    if has_driver:
        executor = executor.having(enabled=False)
    page = values.pick("bags", "run", "runs", "mode", "port", "expose", "token", "seed")
    return (
        Stage(
            "studio",
            "Studio",
            (
                *([] if has_driver else [simulator]),
                recorder,
                executor,
                NodeCall("studio", {**robot, **page}, Part.ENDS),
            ),
        ),
    )


def _rally(values: Values) -> tuple[Stage, ...]:
    robot = values.pick("robot")
    arm = values.text("robot") or DEFAULT_ROBOT
    checkpoint = values.text("checkpoint") or _kept_with(arm, RALLY_POLICIES_FILE)
    if not checkpoint:
        raise UserError(
            f"rally: no policies for rallies come with {arm}; give checkpoint:=FILE, or learn them with "
            "python -m msrd_ros learn-rally"
        )
    played: dict[str, Value] = {**robot, "checkpoint": checkpoint}
    nodes = [NodeCall("match", {**robot, **values.pick("rallies", "most_hits", "report", "seed")}, Part.ENDS)]
    for number, end in enumerate(ENDS):
        executor = NodeCall("executor", {**played, "in_rally": True, "accept_policy": False}, namespace=end)
        chooser = NodeCall("chooser", {**played, "seed": 2 * values.number("seed") + number}, namespace=end)
        nodes += [executor, chooser]
    return (Stage("rally", "Two arms play each other", tuple(nodes)),)


def _policies_of(robot: str) -> str:
    """Policies of an arm: those of its last demo here, else those kept with it, else none."""
    demo = Path("out/demo")
    with contextlib.suppress(OSError, ValueError, TypeError, KeyError):
        metrics = json.loads((demo / "metrics.json").read_text(encoding="utf-8"))
        learned = demo / "training" / POLICIES_FILE
        if metrics["robot"] == Path(robot).name and learned.is_file():
            return str(learned)
    return _kept_with(robot, POLICIES_FILE)


def _kept_with(robot: str, name: str) -> str:
    """A file beside an arm's description; empty if there is none."""
    places = (Path(robot), share_directory() / "config" / "robots" / robot)
    return next((str(place / name) for place in places if (place / name).is_file()), "")


def _bags(values: Values) -> str:
    return f"bags below {Path(values.text('bags') or 'bags').absolute()}"


def _report(values: Values) -> str:
    report = values.text("report")
    return (
        f"report {Path(report).absolute()}" if report else "nothing is written (report:=FILE keeps the rates)"
    )


def _run(values: Values) -> str:
    return f"policies, checkpoint and curves in {Path(values.text('out') or 'runs/strokes').absolute()}"


def _folder(values: Values) -> str:
    return f"bags, policies, figures, logs and report.html in {Path(values.text('out')).absolute()}"


_LABELS = Argument(
    "labels", "Strategies, with commas between them", unset=_FROM_FILE.format("all there are"), read=as_names
)

SETS = {
    chosen.name: chosen
    for chosen in (
        NodeSet(
            "teach",
            "teachers lead the arm by the hand, what returned the ball is recorded",
            (
                Argument("bags", "Folder of the bags", unset=_FROM_FILE.format("./bags"), read=as_path),
                _ROBOT,
                Argument("subjects", "Teachers", unset=_FROM_FILE.format("10"), read=as_count(1)),
                Argument(
                    "recordings",
                    "Kept recordings of each teacher's strategies",
                    unset=_FROM_FILE.format("3"),
                    read=as_count(1),
                ),
                _GUI,
                _SEED,
                *_COMMON,
            ),
            _teach,
            _bags,
        ),
        NodeSet(
            "play",
            "learned strategies are played in the simulator, and their rates reported",
            (
                Argument("checkpoint", "Policies to play", unset="those that a trainer sends", read=as_file),
                _ROBOT,
                _MODE,
                _LABELS,
                Argument(
                    "balls",
                    "Balls for each strategy; 0 feeds none and waits for topic strategy and simulator/serve",
                    "20",
                    read=as_count(0),
                ),
                Argument("report", "JSON file for the rates", unset="none is written", read=as_path),
                _GUI,
                _SEED,
                *_COMMON,
            ),
            _play,
            _report,
        ),
        NodeSet(
            "train",
            "rewards and policies are learned from bags",
            (
                Argument(
                    "bags",
                    "Folder of bags",
                    unset=_FROM_FILE.format("the small set that the package ships"),
                    read=as_path,
                ),
                _ROBOT,
                _LABELS,
                Argument(
                    "out",
                    "Folder for policies, checkpoint and curves",
                    unset=_FROM_FILE.format("runs/strokes"),
                    read=as_path,
                ),
                Argument(
                    "resume",
                    "Go on from the checkpoint in out",
                    unset=_FROM_FILE.format("false"),
                    choices=("true", "false"),
                    read=as_truth,
                ),
                Argument(
                    "iterations",
                    "Iterations over all strategies",
                    unset=_FROM_FILE.format("the trainer's own"),
                    read=as_count(0),
                ),
                _SEED,
                *_COMMON,
            ),
            _train,
            _run,
        ),
        NodeSet(
            "studio",
            "a page in the browser to watch the arm, feed balls, look at strokes and learn from them",
            (
                Argument(
                    "checkpoint",
                    "Policies to play",
                    unset="those of the last demo in out/demo, else those that come with the arm",
                    read=as_file,
                ),
                Argument("bags", "Folder of the bags", "out/studio/bags", read=as_path),
                Argument(
                    "run",
                    "Folder of the training run whose rewards explain strokes",
                    unset=_FROM_FILE.format("out/demo/training"),
                    read=as_path,
                ),
                Argument("runs", "Folder of what is trained from the page", "out/studio/runs", read=as_path),
                _ROBOT,
                Argument(
                    "arm",
                    "real: no simulator is started, and the arm stands until the page gives it leave to move",
                    "simulated",
                    choices=("simulated", "real"),
                ),
                replace(_MODE, default="lockstep", unset=""),
                Argument("port", "Where the page is, on 127.0.0.1", "8080", read=as_count(1)),
                Argument(
                    "expose",
                    "Listen to other machines, too; they need the token",
                    unset=_FROM_FILE.format("false"),
                    choices=("true", "false"),
                    read=as_truth,
                ),
                Argument("token", "What a browser must know to come in", unset="one is made up if exposed"),
                Argument("seed", "Everything random follows from it", "0", read=as_count(0)),
                *_COMMON,
            ),
            _studio,
            _bags,
        ),
        NodeSet(
            "rally",
            "two arms at one table play each other",
            (
                Argument(
                    "checkpoint",
                    "Policies of both arms",
                    unset="those for rallies that come with the arm",
                    read=as_file,
                ),
                _ROBOT,
                Argument("rallies", "Rallies to play; 0 waits for match/serve", "10", read=as_count(0)),
                Argument("most_hits", "A rally is cut off after so many hits", "1000", read=as_count(1)),
                Argument(
                    "report", "JSON file for the lengths of rallies", unset="none is written", read=as_path
                ),
                Argument("seed", "Everything random follows from it", "0", read=as_count(0)),
                *_COMMON,
            ),
            _rally,
            _report,
        ),
        NodeSet(
            "demo",
            "all of it: teach, record, replay, train, play, report",
            (
                Argument("out", "Folder for everything; an earlier demo's goes", "out/demo", read=as_path),
                Argument("robot", _ROBOT.text, unset=DEFAULT_ROBOT),
                Argument("subjects", "Teachers", "4", read=as_count(1)),
                Argument("recordings", "Kept recordings of each teacher's strategies", "3", read=as_count(1)),
                Argument("iterations", "Training iterations", unset="the trainer's own", read=as_count(0)),
                Argument("balls", "Balls for each strategy", "100", read=as_count(1)),
                Argument("seed", "Everything random follows from it", "0", read=as_count(0)),
            ),
            _demo,
            _folder,
        ),
    )
}
"""What `up` and the launch files start, by name."""

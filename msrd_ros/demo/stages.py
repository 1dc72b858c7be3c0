"""The demo: six strokes are taught by hand, recorded, learned and played, every hop over ROS 2 topics.

Each stage starts its nodes as processes of their own and stops them afterwards.
"""

from __future__ import annotations

import shutil
import time
from pathlib import Path
from typing import Any

from msrd_ros.core import formats
from msrd_ros.core.errors import UserError
from msrd_ros.learning.harness import RESULT_FILE
from msrd_ros.robots.default import DEFAULT_ROBOT
from msrd_ros.robots.loading import load_robot
from msrd_ros.stack.arguments import Values
from msrd_ros.stack.console import Console
from msrd_ros.stack.monitor import Monitor
from msrd_ros.stack.processes import NodeProcess, own_domain
from msrd_ros.stack.sets import NodeCall, Part, Stage
from msrd_ros.stack.stage_run import StageRun
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS
from msrd_ros.table_tennis.teachers.planner import planned_strokes

ONE_BY_ONE = ("landing_points", "targets", "spins")
"""Of an evaluation's figures, what it has of every ball."""


class Demo:
    """Runs the stages one after the other.

    Parameters
    ----------
    values
        The demo's arguments: ``out`` is the folder of bags, policies, logs, metrics and report, in which what
        an earlier demo left is replaced.
    stages
        What is started.
    console
        Prints what the node says that a stage is about; all others write to ``logs``.
    """

    def __init__(self, values: Values, stages: tuple[Stage, ...], console: Console) -> None:
        self._values, self._stages, self._console = values, stages, console
        self._out = Path(values.text("out"))
        self._robot = values.text("robot") or DEFAULT_ROBOT
        self._environment = own_domain()
        self._seconds: dict[str, float] = {}
        self._begun_s = time.monotonic()

    def run(self) -> dict[str, Any]:
        """All stages; the metrics, which are also written beside the report."""
        _clear(self._out)
        planned_strokes(load_robot(self._robot))
        figures: dict[str, dict[str, str]] = {}
        with Monitor(self._environment) as monitor:
            for stage in self._stages:
                self._run(stage, monitor)
                figures[stage.name] = monitor.values("recorder" if stage.name == "record" else "simulator")
        recorded, played = figures["record"], figures["play"]
        evaluation = formats.read_report(self._out / "evaluation.json")
        training = formats.read_report(self._out / "training" / RESULT_FILE)
        labels = {
            label: {
                "demonstrations": training["demonstrations"][label],
                **{key: value for key, value in rates.items() if key not in ONE_BY_ONE},
            }
            for label, rates in evaluation["labels"].items()
        }
        metrics = {
            "labels": labels,
            "seconds": {**self._seconds, "total": time.monotonic() - self._begun_s},
            "messages_lost": int(recorded.get("messages_lost", 0)),
            "ticks_asked_again": int(played.get("asked_again", 0)),
            "limits_exceeded": int(played.get("limits_exceeded", 0)),
            "speed_fraction_max": float(played.get("speed_fraction_max", "nan")),
            "torque_fraction_max": float(played.get("torque_fraction_max", "nan")),
            "recorded": {
                key: value for key, value in recorded.items() if key.startswith(("kept", "rejected"))
            },
            "strategy_matrix": training["strategy_matrix"],
            "robot": load_robot(self._robot).name,
            "seed": self._values["seed"],
            "subjects": self._values["subjects"],
            "iterations": training["iterations"],
        }
        formats.write_report(self._out / "metrics.json", metrics)
        return metrics

    def _run(self, stage: Stage, monitor: Monitor) -> None:
        number = len(self._seconds) + 1
        print(f"\n[{number}/{len(self._stages)}] {stage.title}", flush=True)
        begun_s = time.monotonic()
        monitor.clear()

        def start(call: NodeCall) -> NodeProcess:
            log = self._out / "logs" / f"{number}_{call.executable}.log"
            output = self._console if call.part is Part.ENDS else log
            return NodeProcess(call.executable, call.parameters, self._environment, output)

        with StageRun(stage, start, lambda line: self._console.say("up", line)) as run:
            run.wait()
            monitor.settle()
        self._seconds[stage.name] = time.monotonic() - begun_s


def _clear(out: Path) -> None:
    """Remove what an earlier demo left; nothing else that may lie in the folder."""
    for name in ("bags", "training", "played", "logs"):
        shutil.rmtree(out / name, ignore_errors=True)
    for name in ("evaluation.json", "metrics.json", "report.html"):
        (out / name).unlink(missing_ok=True)
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(
            f"demo out:={out}: cannot be written ({error.strerror}); give another folder"
        ) from None


def run_demo(values: Values, stages: tuple[Stage, ...], console: Console) -> None:
    """Run the demo, write its report and print its figures.

    Raises
    ------
    UserError
        If a node fails, or the folder cannot be written.
    """
    metrics = Demo(values, stages, console).run()
    from msrd_ros.demo.report import write_report

    out = Path(values.text("out"))
    write_report(out, metrics, load_robot(values.text("robot") or DEFAULT_ROBOT))
    print(_summary(metrics), flush=True)
    print(f"\nreport: {out / 'report.html'}", flush=True)


def _summary(metrics: dict[str, Any]) -> str:
    lines = [f"\n{'strategy':<18}{'taught':>8}{'fed':>6}{'struck':>9}{'returned':>10}{'spin class':>12}"]
    for label in map(str, ALL_LABELS):
        row = metrics["labels"][label]
        right = row["spin_class_right_share"]
        lines.append(
            f"{label:<18}{row['demonstrations']:>8}{row['fed']:>6}{row['struck_share']:>9.0%}"
            f"{row['returned_share']:>10.0%}{'-' if right is None else f'{right:.0%}':>12}"
        )
    seconds = metrics["seconds"]
    stages = ", ".join(f"{name} {value:.0f} s" for name, value in seconds.items())
    lines.append(f"\n{stages}; joint limits exceeded {metrics['limits_exceeded']} times")
    return "\n".join(lines)

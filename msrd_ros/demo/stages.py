"""The demo: six strokes are taught by hand, recorded, learned and played, every hop over ROS 2 topics.

Each stage starts its nodes as processes of their own and stops them afterwards.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
import time
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from msrd_ros.core.errors import UserError
from msrd_ros.core.files import write_text
from msrd_ros.learning.harness import RESULT_FILE
from msrd_ros.robots.loading import DEFAULT_ROBOT, load_robot
from msrd_ros.stack.monitor import Monitor
from msrd_ros.stack.processes import NodeProcess, own_domain
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS
from msrd_ros.table_tennis.strokes.training import POLICIES_FILE
from msrd_ros.table_tennis.teachers.planner import planned_strokes


@dataclass(frozen=True)
class DemoConfig:
    """Size of the demo.

    Attributes
    ----------
    out
        Folder of bags, policies, logs, metrics and report; what an earlier demo left there is replaced.
    subjects, recordings
        Teachers, and kept recordings of each of their six conditions.
    iterations, balls
        Training iterations, and balls played per strategy.
    seed
        Of the teachers, the training and the evaluation.
    robot
        Which arm: a name or a folder, as nodes take it.
    """

    out: Path
    subjects: int = 4
    recordings: int = 3
    iterations: int | None = None
    balls: int = 100
    seed: int = 0
    robot: str = DEFAULT_ROBOT


class Demo:
    """Runs the stages one after the other."""

    def __init__(self, config: DemoConfig) -> None:
        self.config = config
        self._environment = own_domain()
        self._seconds: dict[str, float] = {}
        self._begun_s = time.monotonic()

    def run(self) -> dict[str, Any]:
        """All stages; the metrics, which are also written beside the report."""
        config = self.config
        _clear(config.out)
        planned_strokes(load_robot(config.robot))
        with Monitor(self._environment) as monitor:
            self._stage("record", "Teach and record", monitor)
            recorded = monitor.values("recorder")
            self._stage("train", "Replay the bags into training", monitor)
            self._stage("play", "Play every strategy", monitor)
            played = monitor.values("simulator")
            self._stage("film", "Film one stroke of each", monitor)
        evaluation = json.loads((config.out / "evaluation.json").read_text())
        training = json.loads((config.out / "training" / RESULT_FILE).read_text())
        labels = {
            label: {
                "demonstrations": training["demonstrations"][label],
                **{key: value for key, value in rates.items() if key not in ("landing_points", "spins")},
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
            "robot": load_robot(config.robot).name,
            "seed": config.seed,
            "subjects": config.subjects,
            "iterations": training["iterations"],
        }
        write_text(config.out / "metrics.json", json.dumps(metrics, indent=1) + "\n")
        return metrics

    def _stage(self, name: str, title: str, monitor: Monitor) -> None:
        number = len(self._seconds) + 1
        print(f"\n[{number}/4] {title}", flush=True)
        begun_s = time.monotonic()
        monitor.clear()
        with ExitStack() as stack:
            getattr(self, f"_{name}")(stack)
            monitor.settle()
        self._seconds[name] = time.monotonic() - begun_s

    def _start(self, stack: ExitStack, name: str, parameters: dict[str, Any]) -> NodeProcess:
        """Start a node in the background; its log lies in `out`."""
        log = self.config.out / "logs" / f"{len(self._seconds) + 1}_{name}.log"
        return stack.enter_context(NodeProcess(name, parameters, self._environment, log))

    def _follow(self, stack: ExitStack, name: str, parameters: dict[str, Any]) -> NodeProcess:
        """Start the node that the stage is about; it writes to the terminal."""
        return stack.enter_context(NodeProcess(name, parameters, self._environment, None))

    def _record(self, stack: ExitStack) -> None:
        config = self.config
        simulator = self._start(stack, "simulator", {"robot": config.robot, "seed": config.seed})
        recorder = self._start(stack, "recorder", {"robot": config.robot, "directory": config.out / "bags"})
        study = {
            "robot": config.robot,
            "subjects": config.subjects,
            "recordings": config.recordings,
            "seed": config.seed,
        }
        self._follow(stack, "demonstrator", study).wait((simulator, recorder))

    def _train(self, stack: ExitStack) -> None:
        config = self.config
        parameters: dict[str, Any] = {
            "robot": config.robot,
            "source": "played",
            "wanted": config.subjects * config.recordings,
            "out": config.out / "training",
            "idle_start_s": 15.0,
            "seed": config.seed,
        }
        if config.iterations is not None:
            parameters["iterations"] = config.iterations
        trainer = self._follow(stack, "trainer", parameters)
        self._start(
            stack, "player", {"bags": [config.out / "bags"], "rate": 0.0, "max_messages_per_s": 1500.0}
        )
        trainer.wait()

    def _play(self, stack: ExitStack) -> None:
        config = self.config
        policies = config.out / "training" / POLICIES_FILE
        simulator = self._start(stack, "simulator", {"robot": config.robot, "seed": config.seed + 1})
        executor = self._start(
            stack,
            "executor",
            {
                "robot": config.robot,
                "checkpoint": policies,
                "ready_noise_rad": 0.03,
                "accept_policy": False,
                "seed": config.seed,
            },
        )
        evaluation = {
            "robot": config.robot,
            "balls": config.balls,
            "seed": config.seed,
            "checkpoint": policies,
            "report": config.out / "evaluation.json",
        }
        self._follow(stack, "evaluator", evaluation).wait((simulator, executor))

    def _film(self, stack: ExitStack) -> None:
        """Record a few played strokes, as anybody would who wants to look at them later."""
        config = self.config
        policies = config.out / "training" / POLICIES_FILE
        simulator = self._start(stack, "simulator", {"robot": config.robot, "seed": config.seed + 2})
        executor = self._start(
            stack, "executor", {"robot": config.robot, "checkpoint": policies, "accept_policy": False}
        )
        recorder = self._start(
            stack,
            "recorder",
            {
                "robot": config.robot,
                "directory": config.out / "played",
                "subject": "robot",
                "keep": "all",
            },
        )
        evaluation = {"robot": config.robot, "balls": 2, "seed": config.seed + 1}
        self._follow(stack, "evaluator", evaluation).wait((simulator, executor, recorder))


def _clear(out: Path) -> None:
    """Remove what an earlier demo left; nothing else that may lie in the folder."""
    for name in ("bags", "training", "played", "logs"):
        shutil.rmtree(out / name, ignore_errors=True)
    for name in ("evaluation.json", "metrics.json", "report.html"):
        (out / name).unlink(missing_ok=True)
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"--out {out}: cannot be written ({error.strerror}); give another folder") from None


def main(argv: list[str] | None = None) -> int:
    """Run the demo; see `--help`."""
    parser = argparse.ArgumentParser(prog="demo", description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("out/demo"), help="folder for everything it writes")
    parser.add_argument("--subjects", type=int, default=DemoConfig.subjects, help="teachers")
    parser.add_argument("--recordings", type=int, default=DemoConfig.recordings, help="kept per condition")
    parser.add_argument(
        "--iterations", type=int, default=None, help="training iterations; default: the trainer's"
    )
    parser.add_argument("--balls", type=int, default=DemoConfig.balls, help="balls played per strategy")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--robot", default=DEFAULT_ROBOT, help="name of an arm, or a folder with robot.yaml")
    words = parser.parse_args(argv)
    config = DemoConfig(
        words.out,
        words.subjects,
        words.recordings,
        words.iterations,
        words.balls,
        words.seed,
        words.robot,
    )
    try:
        metrics = Demo(config).run()
        from msrd_ros.demo.report import write_report

        write_report(config.out, metrics, load_robot(config.robot))
    except UserError as error:
        print(f"demo: error: {error}", file=sys.stderr, flush=True)
        return 2
    except KeyboardInterrupt:
        print("demo: stopped", file=sys.stderr, flush=True)
        return 130
    print(_summary(metrics), flush=True)
    print(f"\nreport: {config.out / 'report.html'}", flush=True)
    return 0


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

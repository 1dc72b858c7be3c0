"""The study over topics: learning through the nodes, and policies exchanged while the robot plays."""

from __future__ import annotations

import shutil
import time
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from msrd_ros.core.errors import UserError
from msrd_ros.core.formats import read_report
from msrd_ros.stack.monitor import Monitor
from msrd_ros.stack.processes import NodeProcess, own_domain
from msrd_ros.studies.table_tennis.recording import Progress
from msrd_ros.table_tennis.strokes.training import POLICIES_FILE

_FIRST_POLICIES_S = 300.0


@dataclass(frozen=True)
class LivePlan:
    """How much is played through the nodes, where a ball takes half a second.

    Learning starts from plain cloning here: better clones leave nothing to be seen of it.

    Attributes
    ----------
    iterations, episodes
        Of the training whose every rollout goes through simulator and executor.
    swap_iterations, swap_every
        Of the training that goes on while its policies are played, and iterations between exchanges.
    swap_balls
        Balls per label in each point of its curve.
    """

    iterations: int = 5
    episodes: int = 20
    swap_iterations: int = 30
    swap_every: int = 2
    swap_balls: int = 4


@dataclass(frozen=True)
class Lesson:
    """Where the recordings lie, whose they are, and the folder of this lesson's runs and logs alone."""

    bags: Path
    subjects: tuple[str, ...]
    folder: Path
    seed: int

    def parameters(self, out: Path, **others: Any) -> dict[str, Any]:
        """Of the trainer."""
        return {
            "bags": self.bags,
            "subjects": list(self.subjects),
            "out": out,
            "seed": self.seed,
            "checkpoint_every": 0,
            "corrective_cloning": False,
            "spread": "standard",
            **others,
        }

    def log(self, name: str) -> Path:
        """Where a node writes."""
        return self.folder / "logs" / f"{name}.log"


def learn_with_rollouts(lesson: Lesson, plan: LivePlan, rollouts: str, progress: Progress) -> Path:
    """Train with rollouts from where `rollouts` says (``batched`` or ``topics``); the policies' file."""
    out = lesson.folder / rollouts
    policies = out / POLICIES_FILE
    if policies.exists():
        return policies
    progress(f"trains {plan.iterations} iterations of {plan.episodes} rollouts a strategy, {rollouts}")
    environment = own_domain()
    # Evaluations are not part of the lesson, and only the whole run counts: it is kept once it is over.
    draft = out.with_name(f"{rollouts}.part")
    shutil.rmtree(draft, ignore_errors=True)
    parameters = lesson.parameters(
        draft,
        rollouts=rollouts,
        iterations=plan.iterations,
        episodes=plan.episodes,
        evaluate_every=plan.iterations,
    )
    with ExitStack() as stack:
        others = tuple(
            stack.enter_context(NodeProcess(name, {"seed": lesson.seed}, environment, lesson.log(name)))
            for name in (("simulator", "executor") if rollouts == "topics" else ())
        )
        log = lesson.log(f"trainer_{rollouts}")
        stack.enter_context(NodeProcess("trainer", parameters, environment, log)).wait(others)
    draft.rename(out)
    return policies


def exchange_while_playing(lesson: Lesson, plan: LivePlan, progress: Progress) -> list[dict[str, Any]]:
    """Play ball after ball while a trainer sends better and better policies; a point for every few balls.

    Returns
    -------
    list of dict
        ``seconds`` since the first policies were in force, ``policies`` that have been, ``fed``, ``struck``
        and ``returned`` over all labels. The last point was played when training was over.

    Raises
    ------
    UserError
        If a node fails, or no policies arrive.
    """
    environment = own_domain()
    out = lesson.folder / "exchange"
    shutil.rmtree(out, ignore_errors=True)
    parameters = lesson.parameters(out, iterations=plan.swap_iterations, evaluate_every=plan.swap_every)
    noise = {"ready_noise_rad": 0.03, "seed": lesson.seed}
    points: list[dict[str, Any]] = []
    with (
        Monitor(environment) as monitor,
        NodeProcess("simulator", {"seed": lesson.seed}, environment, lesson.log("simulator")) as simulator,
        NodeProcess("executor", noise, environment, lesson.log("executor")) as executor,
        NodeProcess("trainer", parameters, environment, lesson.log("trainer_exchange")) as trainer,
    ):
        deadline = time.monotonic() + _FIRST_POLICIES_S
        while not (begun := int(monitor.values("executor").get("swaps", 0))):
            for node in (simulator, executor, trainer):
                node.require_alive()
            if time.monotonic() > deadline:
                raise UserError(f"study: the trainer sent no policies; see {lesson.log('trainer_exchange')}")
            time.sleep(0.2)
        begun_s = time.monotonic()
        while True:
            is_last = trainer.has_ended()
            report = lesson.folder / "point.json"
            asked = {
                "balls": plan.swap_balls,
                "seed": 6000 + 100 * lesson.seed + len(points),
                "report": report,
            }
            at_s = time.monotonic() - begun_s
            with NodeProcess("evaluator", asked, environment, lesson.log("evaluator")) as evaluator:
                evaluator.wait((simulator, executor))
            rows = read_report(report)["labels"].values()
            point = {name: sum(row[name] for row in rows) for name in ("fed", "struck", "returned")}
            played = int(monitor.values("executor").get("swaps", begun))
            points.append({"seconds": 0.5 * (at_s + time.monotonic() - begun_s), "policies": played, **point})
            progress(f"policies {played}: {point['returned']} of {point['fed']} returned")
            if is_last:
                return points

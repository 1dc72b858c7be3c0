"""The trainer as a child of the studio: one at a time, and never ended without a checkpoint."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node

from msrd_ros.core.errors import UserError
from msrd_ros.core.formats import read_report
from msrd_ros.learning.harness import RESULT_FILE
from msrd_ros.nodes.common import EVENT
from msrd_ros.stack.processes import NodeProcess
from msrd_ros.stack.sets import SETS, NodeCall, RosOptions

PROGRESS_TOPIC = "training/progress"
LOG_FILE = "trainer.log"
CHECKPOINT_EVERY = 5
"""Iterations between two evaluations, after each of which policies, checkpoint and matrix are written: so
often is there something new to see and to play, for a tenth of the time."""


class Training:
    """Starts a trainer, watches it and has it end.

    Parameters
    ----------
    node
        Whose graph and namespace it is started into.
    files
        Parameter files that it is given.

    Attributes
    ----------
    run
        The folder of the run that is under way, or was last.
    """

    def __init__(self, node: Node, files: Sequence[Path] = ()) -> None:
        self._node, self._files = node, files
        self.run = Path()
        self._process: NodeProcess | None = None
        self._asked_to_end = False
        self._progress: dict[str, float] = {}
        self._ended, self._failed = "", False
        node.create_subscription(DiagnosticArray, PROGRESS_TOPIC, self._on_progress, EVENT)

    @property
    def runs(self) -> bool:
        """Whether a trainer of this studio is at work."""
        return self._process is not None and self._process.exit_status is None

    @property
    def is_elsewhere(self) -> bool:
        """Whether somebody else's trainer is in the graph."""
        return not self.runs and self._node.count_publishers(PROGRESS_TOPIC) > 0

    def require_free(self) -> None:
        """Refuse a second trainer.

        Raises
        ------
        UserError
            If there is one already; says how to end it.
        """
        if self.runs:
            raise UserError(f"run {self.run.name} is under way; stop it first, or wait for its end")
        if self.is_elsewhere:
            raise UserError(
                "somebody else's trainer is in the graph, and both would send policies; end it first, or wait"
            )

    def start(self, run: Path, arguments: Mapping[str, str], strategies: str = "") -> None:
        """Start a trainer.

        Parameters
        ----------
        run
            The folder that it writes to.
        arguments
            Of ``up train``, beside ``out``.
        strategies
            The file that lists the task's strategies; empty for the package's own.

        Raises
        ------
        UserError
            If there is a trainer already, or an argument is not allowed.
        """
        self.require_free()
        chosen = SETS["train"]
        (stage,) = chosen.stages(chosen.read({**arguments, "out": str(run)}))
        call = stage.nodes[0].having(evaluate_every=CHECKPOINT_EVERY, checkpoint_every=CHECKPOINT_EVERY)
        if strategies:
            call = call.having(strategies=strategies)
        self.run, self._asked_to_end, self._progress = run, False, {}
        self._process = NodeProcess(
            call.executable, call.parameters, os.environ, run / LOG_FILE, self._options(call)
        )
        # Last, as whoever asks meanwhile would take the end of the one before for the end of this one.
        self._ended, self._failed = "", False

    def ask_to_end(self) -> str:
        """Have it end after its iteration, with a checkpoint; what will happen.

        Raises
        ------
        UserError
            If there is none of this studio's.
        """
        if not self.runs or self._process is None:
            raise UserError("no training of this studio is under way")
        self._asked_to_end = True
        self._process.ask_to_end()
        return f"{self.run.name} ends after this iteration, with a checkpoint"

    def close(self) -> None:
        """End it in order and wait for it."""
        if self._process is not None:
            self._process.stop()

    def state(self) -> dict[str, Any]:
        """How far it is.

        Returns
        -------
        ``phase``: empty, ``begins``, ``learns``, ``ends`` or ``elsewhere``; the name of the ``run``;
        ``iteration`` of ``planned``, ``seconds_left`` and the shares ``returned`` by label of the last
        evaluation, as far as they are known; ``ended``, what became of the last one, and whether it has
        ``failed``.
        """
        self._notice_end()
        progress = self._progress
        returned = {
            name.removeprefix("returned_"): share
            for name, share in progress.items()
            if name.startswith("returned_")
        }
        return {
            "phase": self._phase(),
            "run": self.run.name if self.runs else "",
            "iteration": int(progress.get("iteration", 0)),
            "planned": int(progress.get("of", 0)),
            "seconds_left": round(progress.get("seconds_left", 0.0)),
            "returned": returned,
            "ended": self._ended,
            "failed": self._failed,
        }

    def _phase(self) -> str:
        if self.is_elsewhere:
            return "elsewhere"
        if not self.runs:
            return ""
        if self._asked_to_end:
            return "ends"
        return "learns" if self._progress else "begins"

    def _notice_end(self) -> None:
        process = self._process
        if process is None or process.exit_status is None or self._ended:
            return
        self._failed = process.exit_status != 0 and not self._asked_to_end
        if self._failed:
            self._ended = process.describe_end()
        else:
            how = "was stopped" if self._asked_to_end else "is done"
            self._ended = f"{self.run.name} {how} {self._when_it_ended()}"

    def _when_it_ended(self) -> str:
        """As its checkpoint says: of the last iteration before a signal nobody is told any more."""
        try:
            report = read_report(self.run / RESULT_FILE)
        except UserError:
            return "before anything was learned"
        return f"after iteration {report['iterations']} of {report['config']['iterations']}"

    def _options(self, call: NodeCall) -> list[str]:
        """ROS arguments: the studio's own namespace, and the parameter files."""
        words = RosOptions(self._node.get_namespace().rstrip("/")).words(call.executable)
        for file in self._files:
            words += ["--params-file", str(file)]
        return words

    def _on_progress(self, message: DiagnosticArray) -> None:
        for status in message.status:
            self._progress = {pair.key: float(pair.value) for pair in status.values}

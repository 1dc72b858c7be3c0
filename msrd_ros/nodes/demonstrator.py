"""Demonstrator node: synthetic teachers lead the arm by the hand, in the paper's within-subjects design."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from rclpy.parameter_client import AsyncParameterClient
from rclpy.task import Future
from std_srvs.srv import Trigger
from tqdm import tqdm

from msrd_ros.core.errors import UserError
from msrd_ros.core.parameters import parameter
from msrd_ros.nodes.common import Finished, StackNode, robot_parameter, run, steady_timer
from msrd_ros.nodes.lead import VERDICT_PATIENCE_S, Lead
from msrd_ros.nodes.led_stroke import Led, Stage
from msrd_ros.robots.loading import load_robot
from msrd_ros.table_tennis.ball.feeder import SPREADS, Feeder
from msrd_ros.table_tennis.teachers.population import Teacher, compile_ahead
from msrd_ros.table_tennis.teachers.study_design import (
    StudyConfig,
    StudySession,
    Trial,
    Verdict,
    judge_stroke,
    subject_name,
)


@dataclass(frozen=True)
class DemonstratorConfig:
    """Parameters of the demonstrator."""

    robot: str = robot_parameter()
    subjects: int = parameter(10, "Teachers in the population", low=1, high=1000)
    first_subject: int = parameter(0, "Index of the first one that takes part", low=0, high=100_000)
    recordings: int = parameter(3, "Kept recordings of each subject's six conditions", low=1, high=1000)
    attempts: int = parameter(40, "Most strokes for one condition", low=1, high=10_000)
    seed: int = parameter(0, "Seed of the population, the orders, the feeds and the slips", low=0)
    spread: str = parameter("standard", "Spread of the feeds", choices=tuple(SPREADS))
    recorder: str = parameter("recorder", "Node whose verdict on each stroke is awaited; empty: none")
    timeout_s: float = parameter(
        60.0, "How long to wait for simulator, recorder and each answer", unit="s", low=0.5, high=600.0
    )


class Demonstrator(StackNode):
    """Runs the study: one trial after the other, tick by tick."""

    config: DemonstratorConfig

    def __init__(self) -> None:
        super().__init__("demonstrator", DemonstratorConfig)
        config = self.config
        self._rng = np.random.default_rng(config.seed)
        study = StudyConfig(config.subjects, config.recordings, practice=0, attempts=config.attempts)
        self._session = StudySession(study, self._rng)
        self._teachers: dict[int, Teacher] = {}
        self._feeder = Feeder()
        self._robot = load_robot(config.robot)
        compile_ahead(self._make_teacher(config.first_subject), self._feeder)
        self._trial: Trial | None = None
        recorder = AsyncParameterClient(self, config.recorder) if config.recorder else None
        self._lead = Lead(self, self._robot, self._judge, recorder)
        self._discard = self.create_client(Trigger, f"{config.recorder or 'recorder'}/discard")
        _, wanted = self._session.progress
        self._bar = tqdm(total=wanted, unit="stroke", desc="record", smoothing=0.05)
        self._watch_timer = steady_timer(self, 0.5, self._watch)
        self._start_timer = steady_timer(self, 0.05, self._start)

    def _make_teacher(self, index: int) -> Teacher:
        return Teacher(index, self.config.seed, robot=self._robot)

    def close(self) -> None:
        """Leave the terminal tidy."""
        self._bar.close()

    def diagnose(self) -> tuple[str, dict[str, object]]:
        """What is shown, and how far it is."""
        kept, wanted = self._session.progress
        trial = self._trial
        values: dict[str, object] = {"kept": kept, "wanted": wanted}
        if trial is not None:
            values |= {"subject": self._name(trial), "strategy": trial.label, "attempt": trial.attempt}
        return self._lead.stage.value, values

    def waits_for(self) -> list[str]:
        """Who is not there yet, or whose answer is due for longer than an answer takes."""
        missing = []
        if not self._lead.floats:
            missing.append("service simulator/teach: start a simulator")
        if not self._lead.recorder_is_there:
            missing.append(f"a recorder called {self.config.recorder}: start it, or say recorder:=''")
        if not missing and time.monotonic() - self._lead.since_s > VERDICT_PATIENCE_S:
            missing.append(f"progress: {self._lead.stage.value}; look after simulator and recorder")
        return missing

    def _name(self, trial: Trial) -> str:
        return subject_name(self.config.first_subject + trial.subject)

    # -- the study -----------------------------------------------------------------------------

    def _start(self) -> None:
        """Begin as soon as everyone is there."""
        if not self._lead.is_heard:
            return
        self._start_timer.cancel()
        self._next_trial()

    def _next_trial(self) -> None:
        before, self._trial = self._trial, self._session.trial
        trial = self._trial
        if trial is None:
            self._finish()
            return
        index = self.config.first_subject + trial.subject
        if index not in self._teachers:
            self._teachers[index] = self._make_teacher(index)
        # Each attempt draws from a stream of its own: what one subject does leaves the others as they are.
        rng = np.random.default_rng(
            (
                self.config.seed,
                index,
                list(self._session.orders[trial.subject]).index(trial.label),
                trial.attempt,
            )
        )
        stroke = self._teachers[index].begin(trial.label, rng)
        feed = self._feeder.sample(trial.label.side, SPREADS[self.config.spread], rng)
        self._bar.set_postfix_str(f"{self._name(trial)} {trial.label} attempt {trial.attempt}")
        is_another = self.config.recorder and (before is None or before.subject != trial.subject)
        self._lead.begin(trial.label, stroke, feed, {"subject": self._name(trial)} if is_another else {})

    def _judge(self, led: Led) -> None:
        """The ball is decided and the recorder has spoken: enter it, and go on."""
        assert self._trial is not None
        verdict = judge_stroke(self._trial.label, led.outcome, led.peak_speed)
        if self.config.recorder and led.recorded is None:
            # On a busy machine a recorder may not yet have been connected when the ball was decided.
            self.get_logger().warning("the recorder says nothing about this stroke; it is repeated")
            verdict = Verdict.ABORTED
        elif led.recorded is not None:
            if led.recorded.kept and verdict is not Verdict.KEPT:
                self._have_moved_aside(verdict)
                return
            if not led.recorded.kept and verdict is Verdict.KEPT:
                self.get_logger().warning(f"the recorder did not keep a good stroke: {led.recorded.reason}")
                verdict = Verdict.ABORTED
        self._conclude(verdict)

    def _have_moved_aside(self, verdict: Verdict) -> None:
        """Returned, but not what was asked for: go on once the recorder has moved the recording aside.

        With the next stroke under way the recorder would drop that one instead.
        """
        trial = self._trial

        def answered(_: Future) -> None:
            if self._trial is trial:
                self._conclude(verdict)

        self._discard.call_async(Trigger.Request()).add_done_callback(answered)

    def _conclude(self, verdict: Verdict) -> None:
        self._session.tell(verdict)
        self._bar.n = self._session.progress[0]
        self._bar.refresh()
        self._next_trial()

    def _finish(self) -> None:
        self._bar.close()
        kept, wanted = self._session.progress
        counts: dict[Verdict, int] = {}
        for verdicts in self._session.verdicts.values():
            for verdict, count in verdicts.items():
                counts[verdict] = counts.get(verdict, 0) + count
        told = ", ".join(f"{count} {verdict}" for verdict, count in counts.items())
        print(f"recorded {kept} of {wanted} strokes ({told})", flush=True)
        for subject, label in self._session.short:
            print(f"incomplete: {subject_name(self.config.first_subject + subject)} {label}", flush=True)
        raise Finished(0 if kept == wanted else 1)

    # -- watchdog ------------------------------------------------------------------------------

    def _watch(self) -> None:
        waited_s = time.monotonic() - self._lead.since_s
        awaits_verdict = self._lead.stage is Stage.JUDGING and waited_s > VERDICT_PATIENCE_S
        if awaits_verdict and self._lead.recorder_is_there:
            self._lead.give_up_on_recorder()
            return
        if waited_s < self.config.timeout_s:
            return
        domain = self.context.get_domain_id()
        if not self._lead.floats:
            raise UserError(
                f"no simulator on domain {domain}: nobody offers simulator/teach; "
                f"start it, or set the same ROS_DOMAIN_ID"
            )
        if not self._lead.recorder_is_there:
            raise UserError(
                f"no recorder on domain {domain}: nobody is called {self.config.recorder!r}; "
                f"start it, or set recorder:='' to teach without one"
            )
        raise UserError(f"no progress for {self.config.timeout_s:g} s while {self._lead.stage.value}")


def main(argv: list[str] | None = None) -> int:
    """Start the demonstrator."""
    return run("demonstrator", Demonstrator, argv, __doc__)

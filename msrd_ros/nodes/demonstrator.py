"""Demonstrator node: synthetic teachers lead the arm by the hand, in the paper's within-subjects design."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry
from numpy.typing import NDArray
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from rclpy.task import Future
from rclpy.time import Time
from std_msgs.msg import Header
from std_srvs.srv import SetBool, Trigger
from tqdm import tqdm
from trajectory_msgs.msg import JointTrajectory, MultiDOFJointTrajectory

from msrd_ros.contract.episode import CONTROL_PERIOD_S
from msrd_ros.contract.outcome import Outcome
from msrd_ros.contract.translation import NANOSECONDS, read_outcome
from msrd_ros.core.errors import UserError
from msrd_ros.core.parameters import parameter
from msrd_ros.nodes.common import (
    COMMAND,
    EVENT,
    LATCHED,
    Finished,
    StackNode,
    referee_hears,
    robot_parameter,
    run,
    steady_timer,
)
from msrd_ros.nodes.messages import (
    command_to_message,
    feed_to_message,
    gesture_to_message,
    strategy_message,
)
from msrd_ros.nodes.tick_inputs import TickInput, TickInputs
from msrd_ros.robots.loading import load_robot
from msrd_ros.table_tennis.ball.feeder import SPREADS, Feeder
from msrd_ros.table_tennis.strokes.player import Phase as PlayerPhase
from msrd_ros.table_tennis.strokes.player import StrokePlayer
from msrd_ros.table_tennis.teachers.guided_stroke import GuidedStroke
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


VERDICT_PATIENCE_S = 10.0
"""A stroke on which the recorder gives no verdict for so long is repeated."""
MOST_TAKEOVERS = 3


class Stage(Enum):
    """Where the current trial stands."""

    CALLING = "waiting for a service"
    MOVING = "moving to the ready pose"
    SHOWING = "leading the paddle"
    JUDGING = "waiting for the recorder's verdict"


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
        self._stage = Stage.CALLING
        self._since_s = time.monotonic()
        self._trial: Trial | None = None
        self._stroke: GuidedStroke | None = None
        self._came_from: NDArray[np.float64] | None = None
        self._player: StrokePlayer | None = None
        self._outcome: Outcome | None = None
        self._verdicts: dict[int, tuple[bool, str]] = {}
        self._peak_speed = 0.0
        self._fed = False
        self._last: JointTrajectory | MultiDOFJointTrajectory | None = None
        self._strategy = self.create_publisher(Header, "strategy", LATCHED)
        self._feed = self.create_publisher(Odometry, "feed", EVENT)
        self._command = self.create_publisher(JointTrajectory, "joint_command", COMMAND)
        self._hand = self.create_publisher(MultiDOFJointTrajectory, "teach/hand", COMMAND)
        self.create_subscription(DiagnosticArray, "rally/outcome", self._on_outcome, EVENT)
        self.create_subscription(DiagnosticArray, "recorder/verdict", self._on_verdict, EVENT)
        self._inputs = TickInputs(self, self._robot, True, self._act, self._repeat, self.complain)
        self._teach = self.create_client(SetBool, "simulator/teach")
        self._reset = self.create_client(Trigger, "simulator/reset")
        self._takeovers = 0
        self._discard = self.create_client(Trigger, f"{config.recorder or 'recorder'}/discard")
        self._recorder = AsyncParameterClient(self, config.recorder or "recorder")
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
        return self._stage.value, values

    def waits_for(self) -> list[str]:
        """Who is not there yet, or whose answer is due for longer than an answer takes."""
        missing = []
        if not self._teach.service_is_ready():
            missing.append("service simulator/teach: start a simulator")
        if self.config.recorder and not self._recorder.services_are_ready():
            missing.append(f"a recorder called {self.config.recorder}: start it, or say recorder:=''")
        if not missing and time.monotonic() - self._since_s > VERDICT_PATIENCE_S:
            missing.append(f"progress: {self._stage.value}; look after simulator and recorder")
        return missing

    def _name(self, trial: Trial) -> str:
        return subject_name(self.config.first_subject + trial.subject)

    # -- the study -----------------------------------------------------------------------------

    def _start(self) -> None:
        """Begin as soon as everyone is there."""
        if not self._teach.service_is_ready() or not referee_hears(self, self._feed):
            return
        if self.config.recorder and not (
            self._recorder.services_are_ready() and self.count_publishers("recorder/verdict")
        ):
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
        self._stroke_rng = np.random.default_rng(
            (
                self.config.seed,
                index,
                list(self._session.orders[trial.subject]).index(trial.label),
                trial.attempt,
            )
        )
        # The way back to where the last stroke began is free, whatever side comes next.
        self._came_from = self._stroke.ready_posture if self._stroke is not None else None
        self._stroke = self._teachers[index].begin(trial.label, self._stroke_rng)
        # Practice takes its time, above all while compiled code is made for the first time.
        self._enter(Stage.CALLING)
        self._strategy.publish(strategy_message(trial.label, self.get_clock().now().to_msg()))
        self._bar.set_postfix_str(f"{self._name(trial)} {trial.label} attempt {trial.attempt}")
        if self.config.recorder and (before is None or before.subject != trial.subject):
            name = Parameter("subject", Parameter.Type.STRING, self._name(trial))
            future = self._recorder.set_parameters([name])
            future.add_done_callback(lambda _: self._let_go())
        else:
            self._let_go()

    def _let_go(self) -> None:
        """Leave zero-g, so that the arm can be sent to the ready pose."""
        self._call_teach(False, self._begin_to_move)

    def _begin_to_move(self) -> None:
        self._player = None
        self._outcome = None
        self._peak_speed = 0.0
        self._fed = False
        self._enter(Stage.MOVING)

    def _begin_to_show(self) -> None:
        self._enter(Stage.SHOWING)

    def _judge(self) -> None:
        """The ball is decided and the recorder has spoken: enter it, and go on."""
        assert self._trial is not None
        assert self._outcome is not None
        verdict = judge_stroke(self._trial.label, self._outcome, self._peak_speed)
        if self.config.recorder:
            if self._outcome.ball_id not in self._verdicts:
                self._enter(Stage.JUDGING)
                return
            kept, reason = self._verdicts.pop(self._outcome.ball_id)
            if kept and verdict is not Verdict.KEPT:
                self._have_moved_aside(verdict)
                return
            if not kept and verdict is Verdict.KEPT:
                self.get_logger().warning(f"the recorder did not keep a good stroke: {reason}")
                verdict = Verdict.ABORTED
        self._conclude(verdict)

    def _have_moved_aside(self, verdict: Verdict) -> None:
        """Returned, but not what was asked for: go on once the recorder has moved the recording aside.

        With the next stroke under way the recorder would drop that one instead.
        """
        trial = self._trial
        self._enter(Stage.JUDGING)

        def answered(_: Future) -> None:
            if self._stage is Stage.JUDGING and self._trial is trial:
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

    # -- ticks ---------------------------------------------------------------------------------

    def _act(self, tick: TickInput) -> None:
        if self._stage is Stage.MOVING:
            self._move(tick)
        elif self._stage in (Stage.SHOWING, Stage.JUDGING):
            # While the recorder judges, time goes on: what follows a stroke tells that it is whole.
            self._show(tick)

    def _move(self, tick: TickInput) -> None:
        assert self._stroke is not None
        if self._player is None:
            self._player = StrokePlayer(self._robot, tick.joint_position)
            self._player.prepare(None, self._stroke.ready_posture, self._came_from)
        if self._player.phase is PlayerPhase.READY and not np.abs(tick.joint_velocity).max():
            self._enter(Stage.CALLING)
            self._call_teach(True, self._begin_to_show)
            return
        reference = self._player.tick(tick.joint_position, tick.ball_position, tick.ball_stamp_ns)
        stamp = Time(nanoseconds=tick.time_ns).to_msg()
        self._send(command_to_message(self._robot, reference, None, stamp, CONTROL_PERIOD_S))

    def _show(self, tick: TickInput) -> None:
        assert self._stroke is not None
        assert self._trial is not None
        if not self._fed:
            self._fed = True
            feed = self._feeder.sample(self._trial.label.side, SPREADS[self.config.spread], self._stroke_rng)
            self._feed.publish(feed_to_message(feed))
        speed = float(np.abs(tick.joint_velocity / self._robot.limits.speed_rad_s).max())
        self._peak_speed = max(self._peak_speed, speed)
        self._stroke.see(tick.ball_stamp_ns / NANOSECONDS, tick.ball_position)
        gesture = self._stroke.hand_at(tick.time_ns / NANOSECONDS, tick.joint_position)
        self._send(gesture_to_message(gesture, Time(nanoseconds=tick.time_ns).to_msg()))

    def _send(self, message: JointTrajectory | MultiDOFJointTrajectory) -> None:
        self._last = message
        self._repeat()

    def _repeat(self) -> None:
        if isinstance(self._last, JointTrajectory):
            self._command.publish(self._last)
        elif self._last is not None:
            self._hand.publish(self._last)

    # -- what comes in -------------------------------------------------------------------------

    def _on_outcome(self, message: DiagnosticArray) -> None:
        if self._stage is not Stage.SHOWING:
            return
        try:
            _, self._outcome = read_outcome(message)
        except UserError as error:
            self.complain(error)
            return
        self._judge()

    def _on_verdict(self, message: DiagnosticArray) -> None:
        for item in message.status:
            values = {pair.key: pair.value for pair in item.values}
            try:
                self._verdicts[int(values["ball_id"])] = values["kept"] == "true", values["reason"]
            except (KeyError, ValueError):
                self.complain(UserError("topic recorder/verdict: a verdict is malformed; it is passed over"))
        if self._stage is Stage.JUDGING:
            self._judge()

    def _call_teach(self, teaching: bool, then: Callable[[], None]) -> None:
        def answered(future: Future) -> None:
            response = future.result()
            if not response.success:
                self._take_over(response.message, lambda: self._call_teach(teaching, then))
                return
            self._takeovers = 0
            self._last = None
            then()
            # The world has stood still since the last tick; it is answered in the new mode.
            self._inputs.act_again()

        self._teach.call_async(SetBool.Request(data=teaching)).add_done_callback(answered)

    def _take_over(self, reason: str, then: Callable[[], None]) -> None:
        """Call off a ball that somebody else has left in play, perhaps this node before it was interrupted.

        In lockstep it never comes down by itself: nobody answers the ticks.
        """
        self._takeovers += 1
        if self._takeovers > MOST_TAKEOVERS:
            raise UserError(f"simulator/teach: {reason}; see who feeds balls, then start anew")
        self.get_logger().warning(f"simulator/teach: {reason}; the simulator is reset, the ball called off")
        self._reset.call_async(Trigger.Request()).add_done_callback(lambda _: then())

    def _enter(self, stage: Stage) -> None:
        self._stage = stage
        self._since_s = time.monotonic()

    def _watch(self) -> None:
        waited_s = time.monotonic() - self._since_s
        if (
            self._stage is Stage.JUDGING
            and waited_s > VERDICT_PATIENCE_S
            and self._recorder.services_are_ready()
        ):
            # On a busy machine a recorder may not yet have been connected when the ball was decided.
            self.get_logger().warning("the recorder says nothing about this stroke; it is repeated")
            self._session.tell(Verdict.ABORTED)
            self._next_trial()
            return
        if waited_s < self.config.timeout_s:
            return
        domain = self.context.get_domain_id()
        if not self._teach.service_is_ready():
            raise UserError(
                f"no simulator on domain {domain}: nobody offers simulator/teach; "
                f"start it, or set the same ROS_DOMAIN_ID"
            )
        if self.config.recorder and not self._recorder.services_are_ready():
            raise UserError(
                f"no recorder on domain {domain}: nobody is called {self.config.recorder!r}; "
                f"start it, or set recorder:='' to teach without one"
            )
        raise UserError(f"no progress for {self.config.timeout_s:g} s while {self._stage.value}")


def main(argv: list[str] | None = None) -> int:
    """Start the demonstrator."""
    return run("demonstrator", Demonstrator, argv, __doc__)

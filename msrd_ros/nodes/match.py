"""Match node: two arms at one table in Bullet, in lockstep, the topics of each in a namespace."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from std_msgs.msg import Header
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory

from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.contract.translation import stamp_to_ns
from msrd_ros.core.errors import UserError
from msrd_ros.core.formats import write_report
from msrd_ros.core.parameters import parameter
from msrd_ros.nodes.arm_output import ArmOutput
from msrd_ros.nodes.common import (
    COMMAND,
    EVENT,
    Finished,
    StackNode,
    robot_parameter,
    run,
    status,
    steady_timer,
)
from msrd_ros.nodes.latched import hear_latched
from msrd_ros.nodes.messages import command_from_message, to_stamp
from msrd_ros.nodes.pace import Pace
from msrd_ros.nodes.speakers import SoleSpeaker
from msrd_ros.robots.loading import load_robot
from msrd_ros.table_tennis.ball.camera import CameraConfig
from msrd_ros.table_tennis.ball.ends import End
from msrd_ros.table_tennis.ball.feeder import SPREADS, Feeder
from msrd_ros.table_tennis.simulation.rally import RallyConfig
from msrd_ros.table_tennis.simulation.two_arm_world import TwoArmWorld
from msrd_ros.table_tennis.simulation.two_arms import MOST_HITS, RallyRecord
from msrd_ros.table_tennis.simulation.world import WorldConfig, compile_ahead
from msrd_ros.table_tennis.strategies.table import DEFAULT_SIDE, Strategies

ASK_AGAIN_S = 0.25
SILENCE_S = 2.0
"""Without a command for so long, one is waited for."""
FEED_STREAM = 0x4A11
MATCH_STATUS = "match"
"""Name of the status in match/outcome that tells of a rally."""


@dataclass(frozen=True)
class MatchConfig:
    """Parameters of the match."""

    robot: str = robot_parameter()
    seed: int = parameter(0, "Seed of feeds and of the camera's noise", low=0)
    spread: str = parameter("standard", "Spread of the feeds", choices=tuple(SPREADS), live=True)
    rallies: int = parameter(0, "Rallies to play, then it ends; 0 waits for ~/serve", low=0)
    most_hits: int = parameter(MOST_HITS, "A rally is cut off after so many hits", low=1)
    report: str = parameter("", "JSON file for the lengths of rallies; empty writes none")
    camera_rate_hz: float = parameter(200.0, "Frames of the camera", unit="Hz", low=1.0, high=1000.0)
    camera_noise_m: float = parameter(
        0.001, "Standard deviation of each coordinate", unit="m", low=0.0, high=0.1
    )
    rate: float = parameter(
        0.0,
        "Simulated seconds a second at most, such as 1 to watch; 0 is as fast as ticks are answered",
        low=0.0,
        high=1.0,
        live=True,
    )

    def __post_init__(self) -> None:
        """Refuse what would have no effect."""
        if self.report and not self.rallies:
            raise UserError(
                "parameter report: is written once all rallies are played; say rallies:=NUMBER, too"
            )


class Match(StackNode):
    """One rally after the other; the world goes on once both executors have answered a tick."""

    config: MatchConfig

    def __init__(self) -> None:
        super().__init__("match", MatchConfig)
        config = self.config
        self.get_logger().info("starting; the first time after an installation this takes some seconds")
        self._robot = load_robot(config.robot)
        rally = RallyConfig(robot=self._robot)
        compile_ahead(rally)
        camera = CameraConfig(config.camera_rate_hz, config.camera_noise_m)
        self._world = TwoArmWorld(WorldConfig(rally, camera, config.seed), config.most_hits)
        self._rng = np.random.default_rng((FEED_STREAM, config.seed))
        self._strategies = Strategies.shipped()
        self._answered: set[End] = set()
        self._heard_s = dict.fromkeys(End, -SILENCE_S)
        self._tick_ns = -1
        self._asked_s = 0.0
        self._counts = {"ticks": 0, "asked_again": 0, "refused": 0}
        self._records: list[RallyRecord] = []
        self._fed = 0
        self._outputs = {end: ArmOutput(self, self._robot, end) for end in End}
        self._outcome = self.create_publisher(DiagnosticArray, "match/outcome", EVENT)
        for end in End:
            hear_latched(self, Header, f"{end}/strategy", partial(self._on_strategy, end))
            self.create_subscription(
                JointTrajectory, f"{end}/joint_command", partial(self._on_command, end), COMMAND
            )
        self.create_service(Trigger, "~/serve", self._on_serve)
        remedy = "stop it first, or start this match in a namespace or domain of its own"
        self._alone = SoleSpeaker(self, "match/outcome", "decides rallies on", remedy)
        self._pace = Pace(self, self._tick)
        steady_timer(self, ASK_AGAIN_S / 2, self._ask_again)
        self.on_change(self._pace.hurry, "rate")
        self.get_logger().info(f"ready: two arms {self._robot.name}, seed {config.seed}")

    def close(self) -> None:
        """Let go of Bullet."""
        if hasattr(self, "_world"):
            self._world.close()

    def diagnose(self) -> tuple[str, dict[str, object]]:
        """Whether a rally is under way, and what was counted."""
        arms = self._world.arms
        limits = [arm.limits for arm in arms.robots.values()]
        return f"a rally of {arms.hits} hits" if arms.in_play else "between rallies", {
            **self._counts,
            "rallies": len(self._records),
            "hits": sum(record.hits for record in self._records),
            "hits_most": max((record.hits for record in self._records), default=0),
            "feeds_waiting": self._world.feeds_waiting,
            "limits_exceeded": sum(one.limits_exceeded for one in limits),
            "speed_fraction_max": float(max(one.speed_fraction.max() for one in limits)),
            "torque_fraction_max": float(max(one.torque_fraction.max() for one in limits)),
        }

    def waits_for(self) -> list[str]:
        """Which arms are not commanded, and who names no strategy."""
        now_s = time.monotonic()
        missing = [
            f"a joint_command of the {end} arm: start an executor in namespace {end}; time stands still "
            "until then"
            for end in End
            if now_s - self._heard_s[end] > SILENCE_S
        ]
        missing += [
            f"a strategy of the {end} arm: start a chooser in namespace {end}, or publish one on "
            f"{end}/strategy"
            for end in End
            if self._world.strategies[end] is None
        ]
        return missing

    # -- time ----------------------------------------------------------------------------------

    def _tick(self) -> None:
        """Publish one tick to both ends; the world stands still until both have answered it."""
        self._tick_ns = self._world.time_ns
        self._answered.clear()
        self._counts["ticks"] += 1
        self._world.look()
        self._publish(End)

    def _publish(self, ends: type[End] | set[End]) -> None:
        self._asked_s = time.monotonic()
        for end in End:
            if end in ends:
                self._outputs[end].publish_tick(self._world.tick(end))

    def _ask_again(self) -> None:
        if self._alone.is_doubtful or self._pace.waits or time.monotonic() - self._asked_s < ASK_AGAIN_S:
            return
        if self._tick_ns < 0:
            self._tick()
            return
        self._counts["asked_again"] += 1
        self._publish(set(End) - self._answered)

    def _advance(self, period_s: float) -> None:
        self._feed_if_wanted()
        self._world.advance(period_s)
        finished = self._world.arms.finished
        while finished:
            shot = finished.popleft()
            label = self._world.strategies[shot.end]
            self._outputs[shot.end].publish_outcome(shot.outcome, label, self._world.time_ns)
        while self._world.results:
            self._tell(self._world.results.popleft())
        self._pace.follow(period_s, self.config.rate)

    def _feed_if_wanted(self) -> None:
        idle = self._world.is_ready and not self._world.feeds_waiting
        if idle and self._fed < self.config.rallies:
            self._feed()

    def _feed(self) -> bool:
        """Feed either arm, to the side on which it waits; whether both know what to play."""
        if None in self._world.strategies.values():
            return False
        end = list(End)[int(self._rng.integers(2))]
        label = self._world.strategies[end]
        side = (self._strategies.of(label).side if label else None) or DEFAULT_SIDE
        self._world.feed(Feeder().sample(side, SPREADS[self.config.spread], self._rng), end)
        self._fed += 1
        return True

    def _tell(self, record: RallyRecord) -> None:
        """Say how a rally ended; after the last one, all of them."""
        self._records.append(record)
        last = record.shots[-1]
        values = {"hits": record.hits, "end": str(last.end), "struck": last.outcome.struck}
        message = DiagnosticArray(status=[status(MATCH_STATUS, str(record.end_reason), values)])
        message.header.stamp = to_stamp(self._world.time_ns)
        self._outcome.publish(message)
        print(f"rally {len(self._records)}: {record.hits} hits, ended by {record.end_reason}", flush=True)
        if not self.config.rallies or len(self._records) < self.config.rallies:
            return
        lengths = [one.hits for one in self._records]
        if self.config.report:
            path = Path(self.config.report).expanduser()
            reasons = [str(one.end_reason) for one in self._records]
            write_report(path, {"seed": self.config.seed, "hits": lengths, "ends": reasons})
            print(f"written to {path}", flush=True)
        print(
            f"{len(lengths)} rallies: median {np.median(lengths):g} hits, longest {max(lengths)}", flush=True
        )
        raise Finished(0)

    # -- what comes in -------------------------------------------------------------------------

    def _on_strategy(self, end: End, message: Header) -> None:
        try:
            text = message.frame_id
            self._world.strategies[end] = StrategyLabel.parse(text, f"topic {end}/strategy") if text else None
        except UserError as error:
            self._refuse(error)

    def _on_command(self, end: End, message: JointTrajectory) -> None:
        if stamp_to_ns(message.header.stamp) != self._tick_ns or end in self._answered:
            return
        try:
            command = command_from_message(self._robot, message)
            self._world.command(end, command.position, command.velocity, command.period_s, command.label)
        except UserError as error:
            self._refuse(error)
            return
        self._heard_s[end] = time.monotonic()
        self._answered.add(end)
        if len(self._answered) == len(End):
            self._advance(command.period_s)

    def _refuse(self, error: UserError) -> None:
        self._counts["refused"] += 1
        self.complain(error)

    def _on_serve(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success = self._feed()
        response.message = (
            "a ball is launched once both arms rest in the ready poses of their strategies"
            if response.success
            else "an arm has no strategy; start a chooser in namespaces near and far"
        )
        return response


def main(argv: list[str] | None = None) -> int:
    """Start the match."""
    return run("match", Match, argv, __doc__)

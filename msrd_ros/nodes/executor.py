"""Executor node: plays the wanted strategy on the simulator or on the robot."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rclpy.time import Time
from std_msgs.msg import Header, UInt8MultiArray
from std_srvs.srv import SetBool
from trajectory_msgs.msg import JointTrajectory

from msrd_ros.contract.episode import CONTROL_PERIOD_S
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.contract.translation import NANOSECONDS
from msrd_ros.core.errors import UserError
from msrd_ros.core.parameters import parameter
from msrd_ros.nodes.common import COMMAND, LATCHED, StackNode, robot_parameter, run, steady_timer
from msrd_ros.nodes.messages import command_to_message
from msrd_ros.nodes.tick_inputs import TickInput, TickInputs
from msrd_ros.robots.limits import JointReference
from msrd_ros.robots.loading import load_robot
from msrd_ros.table_tennis.arm.via_point_path import find_path
from msrd_ros.table_tennis.strokes.ball_filter import BallFilter
from msrd_ros.table_tennis.strokes.player import TRACKING_TOLERANCE_RAD, Phase, StrokePlayer
from msrd_ros.table_tennis.strokes.policies import StrokeDraws, StrokePolicies

START_UP_S = 3.0
"""How long a starting executor looks for another one that is already there."""


@dataclass(frozen=True)
class ExecutorConfig:
    """Parameters of the executor."""

    checkpoint: str = parameter("", "Policy set to play (policies.safetensors); empty: wait for topic policy")
    mode: str = parameter(
        "lockstep",
        "lockstep answers every tick of the simulator; real_time runs on a robot, watchdogs on",
        choices=("lockstep", "real_time"),
    )
    robot: str = robot_parameter()
    accept_policy: bool = parameter(True, "Take policies from topic policy; set false on a real robot")
    enabled: bool = parameter(True, "Move from the start; otherwise wait for ~/enable")
    ready_noise_rad: float = parameter(
        0.0, "Spread of the start posture around the ready pose", unit="rad", low=0.0, high=0.2
    )
    seed: int = parameter(0, "Seed of the start postures", low=0)
    estimate_ball: bool = parameter(
        False, "Show policies a fit of the ball's flight instead of samples: for slow, late or noisy cameras"
    )
    camera_noise_m: float = parameter(
        0.001, "estimate_ball: standard deviation of the ball's samples", unit="m", low=0.0, high=0.1
    )
    stale_timeout_s: float = parameter(
        0.15, "Older joint states or ball positions make the arm stop", unit="s", low=0.02, high=5.0
    )
    tracking_tolerance_rad: float = parameter(
        TRACKING_TOLERANCE_RAD,
        "A joint further than this from its command makes the arm stop",
        unit="rad",
        low=0.01,
        high=1.0,
    )


class Executor(StackNode):
    """Listens to the robot and the ball, answers with joint commands."""

    config: ExecutorConfig

    def __init__(self) -> None:
        super().__init__("executor", ExecutorConfig)
        self._enabled = self.config.enabled
        self._player: StrokePlayer | None = None
        self._ball_filter: BallFilter | None = None
        self._robot = load_robot(self.config.robot)
        home = self._robot.home_rad
        # Compiled before an arm moves: the first time after an installation it takes seconds.
        find_path(self._robot, JointReference(home, np.zeros_like(home)), home)
        if self.config.estimate_ball:
            BallFilter.compile_ahead()
        self._policies: StrokePolicies | None = None
        self._arriving: StrokePolicies | None = None
        self._strategy: StrategyLabel | None = None
        self._wanted: StrategyLabel | None = None
        self._digest = ""
        self._acted_ns = -1
        self._heard_s = 0.0
        self._last_command: JointTrajectory | None = None
        self._strokes = 0
        self._swapped_at = 0
        self._counts = {"commands": 0, "swaps": 0, "stops": 0, "refused": 0}
        if self.config.checkpoint:
            self._arriving = StrokePolicies.load(Path(self.config.checkpoint), self._robot)
        self._command = self.create_publisher(JointTrajectory, "joint_command", COMMAND)
        lockstep = self.config.mode == "lockstep"
        self._inputs = TickInputs(self, self._robot, lockstep, self._act, self._send_again, self._refuse)
        self.create_subscription(Header, "strategy", self._on_strategy, LATCHED)
        if self.config.accept_policy:
            self.create_subscription(UInt8MultiArray, "policy", self._on_policy, LATCHED)
        self.create_service(SetBool, "~/enable", self._on_enable)
        self._started_s = time.monotonic()
        self._look = steady_timer(self, 0.1, self._look_for_another_executor)
        if self.config.mode == "real_time":
            steady_timer(self, 0.02, self._watch)
        found = f"policies {self._arriving.digest}" if self._arriving else "no policies yet"
        self.get_logger().info(f"ready: {self.config.mode}, {found}")

    def diagnose(self) -> tuple[str, dict[str, object]]:
        """The phase of the stroke, and what is played."""
        phase = self._player.phase.value if self._player else "no joint_states yet"
        return phase, {"strategy": self._strategy or "", "policies": self._digest, **self._counts}

    # -- what comes in -------------------------------------------------------------------------

    def _on_strategy(self, message: Header) -> None:
        if not message.frame_id:
            self._wanted = None
            return
        try:
            self._wanted = StrategyLabel.parse(message.frame_id, "topic strategy")
        except UserError as error:
            self._refuse(error)

    def _on_policy(self, message: UInt8MultiArray) -> None:
        data = bytes(message.data)
        try:
            layout = message.layout.dim[0].label if message.layout.dim else ""
            if layout != "safetensors":
                raise UserError(f"topic policy: layout.dim[0].label is {layout!r}, wanted is 'safetensors'")
            policies = StrokePolicies.from_bytes(data, "topic policy", self._robot)
        except UserError as error:
            self._refuse(error)
            return
        self._arriving = policies

    def _on_enable(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        self._enabled = request.data
        response.success = True
        response.message = "moving" if request.data else "holding still"
        return response

    # -- what goes out -------------------------------------------------------------------------

    def _act(self, tick: TickInput) -> None:
        self._heard_s = time.monotonic()
        if self.config.mode == "real_time":
            period_ns = round(CONTROL_PERIOD_S * NANOSECONDS)
            if 0 <= tick.time_ns - self._acted_ns < 0.9 * period_ns:
                return  # a driver that publishes faster than the control rate
        self._acted_ns = tick.time_ns
        self._send(self._decide(tick), Time(nanoseconds=tick.time_ns).to_msg())

    def _decide(self, tick: TickInput) -> JointReference:
        player = self._follow(tick.joint_position)
        self._adopt(player)
        stale = tick.time_ns - tick.ball_stamp_ns > self.config.stale_timeout_s * NANOSECONDS
        if not self._enabled or (stale and player.phase is Phase.STROKE):
            self._counts["stops"] += 1
            return player.hold()
        try:
            return player.tick(tick.joint_position, *self._see(tick))
        except UserError as error:
            self._counts["stops"] += 1
            self._refuse(UserError(f"{error} (strategy {self._strategy})"))
            return player.hold()

    def _see(self, tick: TickInput) -> tuple[NDArray[np.float64], int]:
        """Where policies see the ball, (3,) in m, and of when that is in nanoseconds."""
        if self._ball_filter is None:
            return tick.ball_position, tick.ball_stamp_ns
        return self._ball_filter.see(tick.time_ns, tick.ball_stamp_ns, tick.ball_position)

    def _follow(self, position: NDArray[np.float64]) -> StrokePlayer:
        """The player; led on from where the arm is if it has strayed from its command."""
        if self._player is None:
            self._player = StrokePlayer(self._robot, position, self.config.tracking_tolerance_rad)
        joint = self._robot.joint_names[int(np.abs(position - self._player.reference.position).argmax())]
        error = self._player.follow(position)
        if error > self.config.tracking_tolerance_rad:
            self._counts["stops"] += 1
            self._refuse(UserError(f"joint {joint} is {error:.2f} rad from its command; going on from there"))
        return self._player

    def _adopt(self, player: StrokePlayer) -> None:
        """Exchange policies and strategy, only between strokes."""
        if not player.between_strokes:
            return
        swapped = self._arriving is not None
        if self._arriving is not None:
            self._policies, self._arriving = self._arriving, None
            self._digest = self._policies.digest
            self._counts["swaps"] += 1
            # At once: a trainer that rolls out over topics waits for its policies to be in force.
            self.publish_diagnostics()
        finished = player.strokes_begun != self._strokes
        if self._wanted is None or self._policies is None:
            return
        if not swapped and not finished and self._wanted == self._strategy:
            return
        try:
            facts = self._policies.require(self._wanted)
        except UserError as error:
            self._refuse(error)
            self._wanted = None
            return
        self._strategy = self._wanted
        self._strokes = player.strokes_begun
        if swapped:
            self._swapped_at = self._strokes
        exploring = self._policies.exploration_seed
        seed, noise_rad = self.config.seed, self.config.ready_noise_rad
        if exploring is not None:
            seed, noise_rad = exploring, self._policies.ready_noise_rad
        draws = StrokeDraws.of(seed, self._strokes - self._swapped_at, self._robot.joint_count)
        policy = self._policies.play(self._wanted, draws)
        ready_pose = facts.ready_pose + noise_rad * draws.ready
        player.prepare(policy, ready_pose)
        if self.config.estimate_ball:
            self._ball_filter = BallFilter(self.config.camera_noise_m)

    def _send(self, reference: JointReference, stamp: Any) -> None:
        command = command_to_message(self._robot, reference, self._strategy, stamp, CONTROL_PERIOD_S)
        self._last_command = command
        self._send_again()
        self._counts["commands"] += 1

    def _send_again(self) -> None:
        if self._last_command is not None:
            self._command.publish(self._last_command)

    # -- watchdogs -----------------------------------------------------------------------------

    def _watch(self) -> None:
        """Bring the arm to rest when joint states stay away; runs on the steady clock."""
        if self._player is None or time.monotonic() - self._heard_s < self.config.stale_timeout_s:
            return
        if np.any(self._player.reference.velocity):
            self._counts["stops"] += 1
            self._send(self._player.hold(), self.get_clock().now().to_msg())

    def _look_for_another_executor(self) -> None:
        if time.monotonic() - self._started_s > START_UP_S:
            self._look.cancel()
        if self.count_publishers("joint_command") > 1:
            topic = self.resolve_topic_name("joint_command")
            names = {info.node_name for info in self.get_publishers_info_by_topic("joint_command")}
            raise UserError(
                f"another node already commands {topic} ({', '.join(sorted(names))}); "
                f"stop it first, or start this executor in a namespace of its own"
            )

    def _refuse(self, reason: UserError) -> None:
        self._counts["refused"] += 1
        self.complain(reason)


def main(argv: list[str] | None = None) -> int:
    """Start the executor."""
    return run("executor", Executor, argv, __doc__)

"""Executor node: plays the wanted strategy on the simulator or on the robot."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from geometry_msgs.msg import PointStamped
from numpy.typing import NDArray
from sensor_msgs.msg import JointState
from std_msgs.msg import Header, UInt8MultiArray
from std_srvs.srv import SetBool
from trajectory_msgs.msg import JointTrajectory

from msrd_ros.facts.episode import CONTROL_PERIOD_S
from msrd_ros.facts.errors import UserError
from msrd_ros.facts.labels import StrategyLabel
from msrd_ros.facts.motion_limits import JointReference
from msrd_ros.facts.parameters import parameter
from msrd_ros.facts.sawyer import JOINT_NAMES
from msrd_ros.facts.translation import NANOSECONDS, JointStateTranslator, read_ball_position, stamp_to_ns
from msrd_ros.learning.stroke_policies import StrokeDraws, StrokePolicies
from msrd_ros.nodes.common import COMMAND, LATCHED, STATE, StackNode, run, steady_timer
from msrd_ros.nodes.messages import command_to_message
from msrd_ros.table_tennis.stroke_player import Phase, StrokePlayer

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
    accept_policy: bool = parameter(True, "Take policies from topic policy; set false on a real robot")
    enabled: bool = parameter(True, "Move from the start; otherwise wait for ~/enable")
    ready_noise_rad: float = parameter(
        0.0, "Spread of the start posture around the ready pose", unit="rad", low=0.0, high=0.2
    )
    seed: int = parameter(0, "Seed of the start postures", low=0)
    stale_timeout_s: float = parameter(
        0.15, "Older joint states or ball positions make the arm stop", unit="s", low=0.02, high=5.0
    )
    tracking_tolerance_rad: float = parameter(
        0.25, "A joint further than this from its command makes the arm stop", unit="rad", low=0.01, high=1.0
    )


class Executor(StackNode):
    """Listens to the robot and the ball, answers with joint commands."""

    config: ExecutorConfig

    def __init__(self) -> None:
        super().__init__("executor", ExecutorConfig)
        self._enabled = self.config.enabled
        self._joints = JointStateTranslator()
        self._player: StrokePlayer | None = None
        self._policies: StrokePolicies | None = None
        self._arriving: StrokePolicies | None = None
        self._strategy: StrategyLabel | None = None
        self._wanted: StrategyLabel | None = None
        self._digest = ""
        self._ball: tuple[NDArray[np.float64], int] | None = None
        self._pending: JointState | None = None
        self._has_new_ball = False
        self._answered_ns = -1
        self._heard_s = 0.0
        self._last_command: JointTrajectory | None = None
        self._strokes = 0
        self._swapped_at = 0
        self._counts = {"commands": 0, "swaps": 0, "stops": 0, "refused": 0}
        if self.config.checkpoint:
            self._arriving = StrokePolicies.load(Path(self.config.checkpoint))
            self._digest = self._arriving.digest
        self._command = self.create_publisher(JointTrajectory, "joint_command", COMMAND)
        # The ball first: within a tick it is sent first, and is then taken first.
        self.create_subscription(PointStamped, "ball/position", self._on_ball, STATE)
        self.create_subscription(JointState, "joint_states", self._on_joint_state, STATE)
        self.create_subscription(Header, "strategy", self._on_strategy, LATCHED)
        if self.config.accept_policy:
            self.create_subscription(UInt8MultiArray, "policy", self._on_policy, LATCHED)
        self.create_service(SetBool, "~/enable", self._on_enable)
        self._started_s = self._steady_s()
        self._look = steady_timer(self, 0.1, self._look_for_another_executor)
        if self.config.mode == "real_time":
            steady_timer(self, 0.02, self._watch)
        self.get_logger().info(
            f"ready: {self.config.mode}, {'policies ' + self._digest if self._digest else 'no policies yet'}"
        )

    def diagnose(self) -> tuple[str, dict[str, object]]:
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
            self._refuse(str(error))

    def _on_policy(self, message: UInt8MultiArray) -> None:
        data = bytes(message.data)
        try:
            layout = message.layout.dim[0].label if message.layout.dim else ""
            if layout != "safetensors":
                raise UserError(f"topic policy: layout.dim[0].label is {layout!r}, wanted is 'safetensors'")
            policies = StrokePolicies.from_bytes(data, "topic policy")
        except UserError as error:
            self._refuse(str(error))
            return
        self._arriving, self._digest = policies, policies.digest

    def _on_ball(self, message: PointStamped) -> None:
        try:
            self._ball = read_ball_position(message), stamp_to_ns(message.header.stamp)
        except UserError as error:
            # The last good sample stays; a longer gap makes it stale and the arm stops.
            self._refuse(str(error))
        self._has_new_ball = True
        self._act_if_complete()

    def _on_joint_state(self, message: JointState) -> None:
        self._heard_s = self._steady_s()
        if stamp_to_ns(message.header.stamp) == self._answered_ns:
            # The simulator asks again: its ball sample was the old one as well.
            self._has_new_ball = False
            if self._last_command is not None:
                self._command.publish(self._last_command)
            return
        self._pending = message
        self._act_if_complete()

    def _on_enable(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        self._enabled = request.data
        response.success = True
        response.message = "moving" if request.data else "holding still"
        return response

    # -- what goes out -------------------------------------------------------------------------

    def _act_if_complete(self) -> None:
        lockstep = self.config.mode == "lockstep"
        if self._pending is None or self._ball is None or (lockstep and not self._has_new_ball):
            return
        message, self._pending, self._has_new_ball = self._pending, None, False
        now_ns = stamp_to_ns(message.header.stamp)
        period_ns = round(CONTROL_PERIOD_S * NANOSECONDS)
        if not lockstep and 0 <= now_ns - self._answered_ns < 0.9 * period_ns:
            return  # a driver that publishes faster than the control rate
        try:
            position, _ = self._joints.read(message)
        except UserError as error:
            self._refuse(str(error))
            return
        self._answered_ns = now_ns
        self._send(self._decide(position, now_ns), message.header.stamp)

    def _decide(self, position: NDArray[np.float64], now_ns: int) -> JointReference:
        player = self._follow(position)
        self._adopt(player)
        assert self._ball is not None
        ball, ball_ns = self._ball
        stale = now_ns - ball_ns > self.config.stale_timeout_s * NANOSECONDS
        if not self._enabled or (stale and player.phase is Phase.STROKE):
            self._counts["stops"] += 1
            return player.hold()
        try:
            return player.tick(position, ball, ball_ns)
        except UserError as error:
            self._counts["stops"] += 1
            self._refuse(f"{error} (strategy {self._strategy})")
            return player.hold()

    def _follow(self, position: NDArray[np.float64]) -> StrokePlayer:
        """The player; begun anew from where the arm is if it has strayed from its command."""
        if self._player is not None:
            error = np.abs(position - self._player.reference.position)
            if error.max() <= self.config.tracking_tolerance_rad:
                return self._player
            joint = JOINT_NAMES[int(error.argmax())]
            self._refuse(f"joint {joint} is {error.max():.2f} rad from its command; starting anew from there")
        self._player = StrokePlayer(position)
        self._strategy = None
        return self._player

    def _adopt(self, player: StrokePlayer) -> None:
        """Exchange policies and strategy, only between strokes."""
        if not player.between_strokes:
            return
        swapped = self._arriving is not None
        if self._arriving is not None:
            self._policies, self._arriving = self._arriving, None
            self._counts["swaps"] += 1
        finished = player.strokes_begun != self._strokes
        if self._wanted is None or self._policies is None:
            return
        if not swapped and not finished and self._wanted == self._strategy:
            return
        try:
            facts = self._policies.require(self._wanted)
        except UserError as error:
            self._refuse(str(error))
            self._wanted = None
            return
        self._strategy = self._wanted
        self._strokes = player.strokes_begun
        if swapped:
            self._swapped_at = self._strokes
        exploring = self._policies.exploration_seed
        seed = self.config.seed if exploring is None else exploring
        draws = StrokeDraws.of(seed, self._strokes - self._swapped_at)
        policy = self._policies.play(self._wanted, draws)
        ready_pose = facts.ready_pose + self.config.ready_noise_rad * draws.ready
        player.prepare(policy, ready_pose)

    def _send(self, reference: JointReference, stamp: Any) -> None:
        command = command_to_message(reference, self._strategy, stamp, CONTROL_PERIOD_S)
        self._command.publish(command)
        self._last_command = command
        self._counts["commands"] += 1

    # -- watchdogs -----------------------------------------------------------------------------

    def _watch(self) -> None:
        """Bring the arm to rest when joint states stay away; runs on the steady clock."""
        if self._player is None or self._steady_s() - self._heard_s < self.config.stale_timeout_s:
            return
        if np.any(self._player.reference.velocity):
            self._counts["stops"] += 1
            self._send(self._player.hold(), self.get_clock().now().to_msg())

    def _look_for_another_executor(self) -> None:
        if self._steady_s() - self._started_s > START_UP_S:
            self._look.cancel()
        if self.count_publishers("joint_command") > 1:
            topic = self.resolve_topic_name("joint_command")
            names = {info.node_name for info in self.get_publishers_info_by_topic("joint_command")}
            raise UserError(
                f"another node already commands {topic} ({', '.join(sorted(names))}); "
                f"stop it first, or start this executor in a namespace of its own"
            )

    def _refuse(self, reason: str) -> None:
        self._counts["refused"] += 1
        self.get_logger().error(reason, throttle_duration_sec=1.0)

    @staticmethod
    def _steady_s() -> float:
        return time.monotonic()


def main(argv: list[str] | None = None) -> int:
    """Start the executor."""
    return run("executor", Executor, argv, __doc__)

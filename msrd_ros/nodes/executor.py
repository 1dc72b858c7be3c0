"""Executor node: plays the wanted strategy on the simulator or on the robot."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from geometry_msgs.msg import PointStamped
from numpy.typing import NDArray
from std_msgs.msg import Header, UInt8MultiArray
from std_srvs.srv import SetBool
from visualization_msgs.msg import MarkerArray

from msrd_ros.contract.episode import CONTROL_PERIOD_S
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.contract.translation import NANOSECONDS
from msrd_ros.core.errors import UserError
from msrd_ros.core.parameters import parameter
from msrd_ros.nodes.command_output import CommandOutput
from msrd_ros.nodes.common import COMMAND, SIDE_OF, robot_parameter, run, steady_timer
from msrd_ros.nodes.latched import hear_latched
from msrd_ros.nodes.managed import ManagedNode, autostart_parameter
from msrd_ros.nodes.messages import target_from_message
from msrd_ros.nodes.scene_markers import target_markers
from msrd_ros.nodes.speakers import SoleSpeaker
from msrd_ros.nodes.tick_inputs import TickInput, TickInputs
from msrd_ros.robots.limits import JointReference
from msrd_ros.robots.loading import load_robot
from msrd_ros.robots.rest import RestFinder
from msrd_ros.table_tennis.arm.via_point_path import find_path
from msrd_ros.table_tennis.strokes.ball_filter import BallFilter
from msrd_ros.table_tennis.strokes.exchange import PolicyExchange
from msrd_ros.table_tennis.strokes.player import TRACKING_TOLERANCE_RAD, Phase, StrokePlayer
from msrd_ros.table_tennis.strokes.policies import StrokePolicies
from msrd_ros.table_tennis.strokes.reach import say_point

RESUME_S = 0.5
"""In real time an arm that rests and was not commanded for so long may have been moved by others since."""
PERIOD_NS = round(CONTROL_PERIOD_S * NANOSECONDS)
SHOW_PERIOD_S = 1.0
"""Between two markers of the same target."""
SOONEST = 0.9
"""Share of the control period that passes at least between two commands."""
SOONEST_ARRIVAL = 0.5
"""The same by the clock on the wall: what has waited in a queue must not make the arm hurry."""


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
    accept_policy: bool = parameter(
        True, "Take policies from topic policy; set false on a real robot", live=True
    )
    enabled: bool = parameter(True, "Whether the arm moves; ~/enable sets it, too", live=True)
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
        0.15,
        "Older joint states or ball positions make the arm stop",
        unit="s",
        low=0.02,
        high=5.0,
        live=True,
    )
    tracking_tolerance_rad: float = parameter(
        TRACKING_TOLERANCE_RAD,
        "A joint further than this from its command makes the arm stop",
        unit="rad",
        low=0.01,
        high=1.0,
    )
    in_rally: bool = parameter(
        False, "Balls come back: a stroke ends with its ball, and the arm makes for the next one at once"
    )
    autostart: bool = autostart_parameter()


class Executor(ManagedNode):
    """Listens to the robot and the ball, answers with joint commands.

    In real time the arm is braked at once when an input falls silent or cannot be relied on, and nothing is
    sent any more once it rests. Inactive is as not enabled, except that in real time an arm that has never
    been commanded is left alone. In lockstep, where every tick is answered, an executor that is not enabled
    leaves the answers of an arm at rest to whoever else commands it, and is not enabled before they are gone.

    Attributes
    ----------
    gives_way
        Whether it does so now.
    """

    config: ExecutorConfig

    def __init__(self) -> None:
        super().__init__("executor", ExecutorConfig)

    def configure(self) -> None:
        """Load robot and policies, and open topics and services."""
        self._now_s = time.monotonic
        self._player: StrokePlayer | None = None
        self._ball_filter: BallFilter | None = None
        self._robot = load_robot(self.config.robot)
        home = self._robot.home_rad
        # Compiled before an arm moves: the first time after an installation it takes seconds.
        find_path(self._robot, JointReference(home, np.zeros_like(home)), home)
        if self.config.estimate_ball:
            BallFilter.compile_ahead()
        self._exchange = PolicyExchange(self.config.seed, self.config.ready_noise_rad)
        self._acted_ns = -1
        self._rest = RestFinder()
        self._heard_s = self._distrusted_s = -np.inf
        self._answered = True
        self.gives_way = self._gave_way = False
        self._counts = {"swaps": 0, "stops": 0, "refused": 0}
        if self.config.checkpoint:
            self._exchange.arriving = StrokePolicies.load(Path(self.config.checkpoint), self._robot)
        self._lockstep = self.config.mode == "lockstep"
        self._output = CommandOutput(self, self._robot, self._lockstep, lambda: self._now_s())
        self._inputs = TickInputs(
            self,
            self._robot,
            self._lockstep,
            self._act,
            self._send_again,
            self._refuse,
            lambda: self.config.stale_timeout_s,
            self._distrust,
            lambda: self._now_s(),
        )
        hear_latched(self, Header, "strategy", self._on_strategy)
        hear_latched(self, UInt8MultiArray, "policy", self._on_policy)
        hear_latched(self, PointStamped, "target", self._on_target)
        self._scene = self.create_publisher(MarkerArray, "scene", COMMAND)
        steady_timer(self, SHOW_PERIOD_S, self._show_target)
        self.create_service(SetBool, "~/enable", self._on_enable)
        remedy = "stop it first, or start this executor in a namespace of its own"
        self._alone = SoleSpeaker(self, "joint_command", "commands", remedy)
        if not self._lockstep:
            steady_timer(self, CONTROL_PERIOD_S, self._watch)
        arriving = self._exchange.arriving
        found = f"policies {arriving.digest}" if arriving else "no policies yet"
        self.get_logger().info(f"ready: {self.config.mode}, {found}")

    def diagnose(self) -> tuple[str, dict[str, object]]:
        """The phase of the stroke, and what is played."""
        phase = self._player.phase.value if self._player else "no joint_states yet"
        playable = self._exchange.policies.facts if self._exchange.policies else {}
        return phase, {
            "enabled": self.config.enabled,
            "gives_way": self.gives_way,
            "strategy": self._exchange.strategy or "",
            "target": "" if self._exchange.target is None else say_point(self._exchange.target),
            "target_refused": self._exchange.refusal,
            "policies": self._exchange.digest,
            "commands": self._output.sent,
            **self._counts,
            **{SIDE_OF + label: facts.side for label, facts in playable.items()},
        }

    def waits_for(self) -> list[str]:
        """What is missing until a stroke can be played."""
        missing = self._inputs.missing
        if not self.config.enabled:
            missing.append("leave to move: call ~/enable, or set parameter enabled")
        if self._exchange.policies is None and self._exchange.arriving is None:
            missing.append("policies: start it with checkpoint:=FILE, or start a trainer")
        if self._exchange.wanted is None:
            missing.append("a strategy: publish one on topic strategy")
        return missing

    @property
    def _may_move(self) -> bool:
        """Whether the arm may do anything but come to rest and stay there."""
        return self.active and self.config.enabled

    # -- what comes in -------------------------------------------------------------------------

    def _on_strategy(self, message: Header) -> None:
        if not message.frame_id:
            self._exchange.wanted = None
            return
        try:
            self._exchange.wanted = StrategyLabel.parse(message.frame_id, "topic strategy")
        except UserError as error:
            self._refuse(error)

    def _on_policy(self, message: UInt8MultiArray) -> None:
        data = bytes(message.data)
        try:
            if not self.config.accept_policy:
                raise UserError("topic policy: not taken; set parameter accept_policy if it may be")
            layout = message.layout.dim[0].label if message.layout.dim else ""
            if layout != "safetensors":
                raise UserError(f"topic policy: layout.dim[0].label is {layout!r}, wanted is 'safetensors'")
            self._exchange.arriving = StrokePolicies.from_bytes(data, "topic policy", self._robot)
        except UserError as error:
            self._refuse(error)

    def _on_target(self, message: PointStamped) -> None:
        try:
            self._exchange.aim(target_from_message(message))
        except UserError as error:
            self._exchange.aim(None, str(error))
            self._refuse(error)

    def _on_enable(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        if request.data and self.gives_way:
            response.success = False
            response.message = f"{', '.join(self._alone.others)} commands the arm; wait until that is over"
            return response
        self.change("enabled", request.data)
        response.success = True
        response.message = "enabled" if request.data else "holding still"
        return response

    # -- what goes out -------------------------------------------------------------------------

    def _act(self, tick: TickInput) -> None:
        now_s = self._now_s()
        silent_s, self._heard_s = now_s - self._heard_s, now_s
        self._answered = False
        if self._alone.is_doubtful or self._leaves_it_to_others():
            return
        if not self._lockstep:
            early = 0 <= tick.time_ns - self._acted_ns < SOONEST * PERIOD_NS
            if early or now_s - self._output.sent_s < SOONEST_ARRIVAL * CONTROL_PERIOD_S:
                return  # a driver that publishes faster than the control rate, or messages that have waited
        rests = self._lockstep or self._rest.see(tick.joint_position, now_s)
        if self._begins() and not rests:
            return  # commands lead on from where the arm is: one state that tells another place is not enough
        self._acted_ns = tick.time_ns
        player = self._follow(tick.joint_position)
        if tick.time_went_back or (not self._lockstep and silent_s > self.config.stale_timeout_s):
            self._lose_ball(player)
        self._adopt(player)
        self._send(self._decide(player, tick), tick.time_ns)

    def _leaves_it_to_others(self) -> bool:
        """Look whether somebody else commands an arm that this one has brought to rest, in lockstep."""
        last = self._output.last
        rests = self.gives_way or (last is not None and not np.any(last.velocity))
        gives_way = self._lockstep and not self._may_move and rests and bool(self._alone.others)
        if gives_way != self.gives_way:
            self.gives_way = gives_way
            self.publish_diagnostics()  # they wait for it
        self._gave_way |= gives_way
        return gives_way

    def _decide(self, player: StrokePlayer, tick: TickInput) -> JointReference:
        if not self._may_move or self._is_distrustful():
            self._counts["stops"] += 1
            return player.hold()
        if not tick.ball_is_present:
            if player.phase is Phase.STROKE:
                self._counts["stops"] += 1
                self._refuse(UserError("ball/position is stale in mid-stroke; the arm comes to rest"))
            self._lose_ball(player)
            return player.tick(tick.joint_position, None)
        try:
            return player.tick(tick.joint_position, *self._see(tick))
        except UserError as error:
            self._counts["stops"] += 1
            self._refuse(UserError(f"{error} (strategy {self._exchange.strategy})"))
            return player.hold()

    def _see(self, tick: TickInput) -> tuple[NDArray[np.float64], int]:
        """Where policies see the ball, (3,) in m, and of when that is in nanoseconds."""
        if self._ball_filter is None:
            return tick.ball_position, tick.ball_stamp_ns
        return self._ball_filter.see(tick.time_ns, tick.ball_stamp_ns, tick.ball_position)

    def _lose_ball(self, player: StrokePlayer) -> None:
        """Let the ball through that was watched; what is seen next is another one, or of another time."""
        player.forget_ball()
        if self._ball_filter is not None:
            self._ball_filter = BallFilter(self.config.camera_noise_m)

    def _follow(self, position: NDArray[np.float64]) -> StrokePlayer:
        """The player; led back to where the arm is if that has strayed from its command."""
        if self._player is None:
            config = self.config
            self._player = StrokePlayer(self._robot, position, config.tracking_tolerance_rad, config.in_rally)
        player = self._player
        if self._has_paused(player):
            player.begin_at(position)
            self._output.forget()
            self._gave_way = False
        if not self._may_move:
            return player  # it may be led by hand meanwhile
        joint = self._robot.joint_names[int(np.abs(position - player.reference.position).argmax())]
        error = player.follow(position)
        if error > self.config.tracking_tolerance_rad:
            self._counts["stops"] += 1
            self._refuse(UserError(f"joint {joint} is {error:.2f} rad from its command; going back to it"))
        return player

    def _begins(self) -> bool:
        """Whether the next command leads on from where the arm is, and not from the one before."""
        return self._player is None or self._has_paused(self._player)

    def _has_paused(self, player: StrokePlayer) -> bool:
        if self._lockstep:
            return self._gave_way
        paused = self._now_s() - self._output.sent_s > RESUME_S
        return paused and self._may_move and not np.any(player.reference.velocity)

    def _adopt(self, player: StrokePlayer) -> None:
        """Exchange policies and strategy, only between strokes."""
        swapped = self._exchange.swap(player)
        if swapped:
            self._counts["swaps"] += 1
            # At once: a trainer that rolls out over topics waits for its policies to be in force.
            self.publish_diagnostics()
        aimed_at, refusal = self._exchange.target, self._exchange.refusal
        try:
            if self._exchange.prepare(player, swapped) and self.config.estimate_ball:
                self._ball_filter = BallFilter(self.config.camera_noise_m)
        except UserError as error:
            self._refuse(error)
        if self._exchange.refusal not in ("", refusal):
            self._refuse(UserError(self._exchange.refusal))
        if self._exchange.target is not aimed_at:
            self.publish_diagnostics()  # who measures how targets are hit waits for it
            self._scene.publish(target_markers(self._exchange.target))

    def _show_target(self) -> None:
        """Again and again, for those who begin to look later."""
        if self._exchange.target is not None and self._scene.get_subscription_count():
            self._scene.publish(target_markers(self._exchange.target))

    def _send(self, reference: JointReference, time_ns: int) -> None:
        """Send a command, or one that brakes if it does not pass the gate."""
        if not self._lockstep and not self._may_move:
            untold = self._output.last is None and not self.active
            if untold or self._output.rests_at(reference):
                return  # said once, or never in command
        label = self._exchange.strategy
        try:
            self._output.send(reference, label, time_ns)
        except UserError as error:
            self._counts["stops"] += 1
            self._refuse(error)
            if self._player is None or self._output.last is None:
                return
            self._player.go_on_from(self._output.last)
            try:
                self._output.send(self._player.hold(), label, time_ns)
            except UserError as braking:
                # The command before it brings the arm to rest by itself; the next tick tries again.
                self._refuse(braking)
                return
        self._answered = True

    def _send_again(self) -> None:
        if self._answered:
            self._output.repeat()
        else:
            self._inputs.act_again()

    # -- watchdogs -----------------------------------------------------------------------------

    def _distrust(self) -> None:
        """A joint state cannot be relied on: as if nothing had been heard for too long."""
        self._distrusted_s = self._now_s()
        self._heard_s = -np.inf
        self._rest.forget()

    def _is_distrustful(self) -> bool:
        return not self._lockstep and self._now_s() - self._distrusted_s < self.config.stale_timeout_s

    def _watch(self) -> None:
        """Bring the arm to rest when joint states stay away; runs on the steady clock."""
        now_s = self._now_s()
        if self._player is None or now_s - self._heard_s < self.config.stale_timeout_s:
            return
        if now_s - self._output.sent_s < SOONEST * CONTROL_PERIOD_S:
            return
        if np.any(self._player.reference.velocity):
            self._counts["stops"] += 1
            self._send(self._player.hold(), 0)

    def _refuse(self, reason: UserError) -> None:
        self._counts["refused"] += 1
        self.complain(reason)


def main(argv: list[str] | None = None) -> int:
    """Start the executor."""
    return run("executor", Executor, argv, __doc__)

"""Simulator node: arm, table, ball, feeder and referee in Bullet, over topics."""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from nav_msgs.msg import Odometry
from std_msgs.msg import Header
from std_srvs.srv import SetBool, Trigger
from trajectory_msgs.msg import JointTrajectory, MultiDOFJointTrajectory

from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.contract.translation import stamp_to_ns
from msrd_ros.core.errors import UserError
from msrd_ros.core.parameters import parameter
from msrd_ros.nodes.common import (
    COMMAND,
    EVENT,
    robot_parameter,
    run,
    steady_timer,
)
from msrd_ros.nodes.latched import hear_latched
from msrd_ros.nodes.managed import ManagedNode, autostart_parameter
from msrd_ros.nodes.messages import (
    command_from_message,
    feed_from_message,
    gesture_from_message,
)
from msrd_ros.nodes.pace import Pace
from msrd_ros.nodes.speakers import SoleSpeaker
from msrd_ros.nodes.world_output import WorldOutput
from msrd_ros.robots.loading import load_robot
from msrd_ros.table_tennis.ball.camera import CameraConfig
from msrd_ros.table_tennis.ball.feeder import SPREADS, Feeder
from msrd_ros.table_tennis.simulation import teach_mode
from msrd_ros.table_tennis.simulation.bullet_arm import ArmConfig
from msrd_ros.table_tennis.simulation.rally import RallyConfig
from msrd_ros.table_tennis.simulation.world import World, WorldConfig, compile_ahead
from msrd_ros.table_tennis.strategies.table import DEFAULT_SIDE, SIDE_HELP, STRATEGIES_HELP, Side, Strategies

TEACH_PERIOD_S = 0.004
ASK_AGAIN_S = 0.25
SILENCE_S = 2.0
"""Without a command for so long, one is waited for."""
SERVE_STREAM = 0xFEED


@dataclass(frozen=True)
class SimulatorConfig:
    """Parameters of the simulator."""

    mode: str = parameter(
        "lockstep",
        "lockstep waits for an answer to every tick; real_time follows the wall clock, watchdogs on",
        choices=("lockstep", "real_time"),
    )
    robot: str = robot_parameter()
    gui: bool = parameter(False, "Show Bullet's window")
    seed: int = parameter(0, "Seed of the camera's noise and of ~/serve", low=0)
    spread: str = parameter("standard", "Spread of the feeds of ~/serve", choices=tuple(SPREADS), live=True)
    strategies: str = parameter("", STRATEGIES_HELP)
    side: str = parameter(DEFAULT_SIDE.value, SIDE_HELP, choices=tuple(Side), live=True)
    camera_rate_hz: float = parameter(200.0, "Frames of the camera", unit="Hz", low=1.0, high=1000.0)
    camera_noise_m: float = parameter(
        0.001, "Standard deviation of each coordinate", unit="m", low=0.0, high=0.1, live=True
    )
    camera_latency_s: float = parameter(
        0.0, "Age of the newest frame", unit="s", low=0.0, high=0.5, live=True
    )
    camera_dropout: float = parameter(0.0, "Share of frames lost", low=0.0, high=0.9, live=True)
    joint_state_rate_hz: float = parameter(
        250.0, "Joint states and ball in real time", unit="Hz", low=10.0, high=1000.0, live=True
    )
    command_timeout_s: float = parameter(
        0.1,
        "In real time: without a command for so long the arm stops, and no ball is launched",
        unit="s",
        low=0.02,
        high=5.0,
    )
    mass_scale: float = parameter(1.0, "Factor on the arm's masses", low=0.5, high=2.0)
    joint_friction_nm: float = parameter(0.0, "Dry friction of every joint", unit="Nm", low=0.0, high=10.0)
    rate: float = parameter(
        0.0,
        "In lockstep: simulated seconds a second at most, such as 1 to watch and 0.1 for slow motion; "
        "0 is as fast as ticks are answered",
        low=0.0,
        high=1.0,
        live=True,
    )
    show: bool = parameter(True, "Publish TF, markers and ball/odometry", live=True)
    autostart: bool = autostart_parameter()

    def __post_init__(self) -> None:
        """Refuse what would have no effect."""
        if self.rate and self.mode == "real_time":
            raise UserError(f"parameter rate: {self.rate:g} is for mode lockstep; leave it at 0")


class Simulator(ManagedNode):
    """One rally after the other, tick by tick."""

    config: SimulatorConfig

    def __init__(self) -> None:
        super().__init__("simulator", SimulatorConfig)

    def configure(self) -> None:
        """Build the world, and open topics and services; its time stands still."""
        config = self.config
        self._strategies = Strategies.load(config.strategies)
        self.get_logger().info("starting; the first time after an installation this takes some seconds")
        self._robot = load_robot(config.robot)
        arm = ArmConfig(mass_scale=config.mass_scale, joint_friction_nm=config.joint_friction_nm)
        rally = RallyConfig(arm=arm, robot=self._robot)
        compile_ahead(rally)
        self._world = World(WorldConfig(rally, self._camera_config(), config.seed), gui=config.gui)
        self._held.callback(self._world.close)
        self._feeder = Feeder()
        self._serve_rng = np.random.default_rng((SERVE_STREAM, config.seed))
        self._paused = self._steps_once = False
        self._is_commanded = False
        self._tick_ns = 0
        self._asked_s = 0.0
        self._answered_s = -SILENCE_S
        self._counts = {"returned": 0, "ticks": 0, "asked_again": 0, "refused": 0}
        self._output = WorldOutput(self, self._world, self._robot)
        self._open_topics()
        self._open_services()
        self.get_logger().info(f"ready: {config.mode}, seed {config.seed}")
        # After an installation this takes seconds as well; until a hand comes nobody has to wait for it.
        threading.Thread(target=teach_mode.compile_ahead, args=(self._robot,)).start()
        remedy = "stop it first, or start this simulator in a namespace or domain of its own"
        self._alone = SoleSpeaker(self, "rally/outcome", "decides rallies on", remedy)
        self._pace = Pace(self, self._tick)
        if config.mode == "lockstep":
            steady_timer(self, ASK_AGAIN_S / 2, self._ask_again)
            self.on_change(self._pace.hurry, "rate")
        else:
            self._real_time_s = time.monotonic()
            self._clockwork = steady_timer(self, 1.0 / config.joint_state_rate_hz, self._follow_wall_clock)
            self.on_change(self._change_rate, "joint_state_rate_hz")
        self.on_change(self._change_camera, "camera_noise_m", "camera_latency_s", "camera_dropout")

    def activate(self) -> None:
        """Let time go on."""
        # After a pause the last tick is asked again.
        if self.config.mode == "lockstep" and not self._counts["ticks"] and not self._alone.is_doubtful:
            self._tick()

    def _camera_config(self) -> CameraConfig:
        config = self.config
        return CameraConfig(
            config.camera_rate_hz, config.camera_noise_m, config.camera_latency_s, config.camera_dropout
        )

    def _change_camera(self) -> None:
        self._world.change_camera(self._camera_config())

    def _change_rate(self) -> None:
        self.destroy_timer(self._clockwork)
        self._clockwork = steady_timer(self, 1.0 / self.config.joint_state_rate_hz, self._follow_wall_clock)

    def waits_for(self) -> list[str]:
        """Who would have to speak for the world to go on, or the arm to move."""
        if self._paused:
            return ["leave to go on: call ~/pause with false"]
        if time.monotonic() - self._answered_s < SILENCE_S:
            return []
        if self._world.teaching:
            return ["a hand on topic teach/hand: start a demonstrator, or call ~/teach with false"]
        stands = "; in lockstep time stands still until then" if self.config.mode == "lockstep" else ""
        return [f"a joint_command: start an executor{stands}"]

    def diagnose(self) -> tuple[str, dict[str, object]]:
        """Whether it teaches or plays, and what it counted."""
        world, limits = self._world, self._world.rally.limits
        return "teaching" if world.teaching else "playing", {
            "balls": world.balls,
            **self._counts,
            "strategy": world.strategy or "",
            "paused": self._paused,
            "rate": self.config.rate,
            "feeds_waiting": world.feeds_waiting,
            "limits_exceeded": limits.limits_exceeded,
            "speed_fraction_max": float(limits.speed_fraction.max()),
            "torque_fraction_max": float(limits.torque_fraction.max()),
        }

    def _open_topics(self) -> None:
        hear_latched(self, Header, "strategy", self._on_strategy)
        self.create_subscription(Odometry, "feed", self._on_feed, EVENT)
        self.create_subscription(JointTrajectory, "joint_command", self._on_command, COMMAND)
        self.create_subscription(MultiDOFJointTrajectory, "teach/hand", self._on_hand, COMMAND)

    def _open_services(self) -> None:
        self.create_service(Trigger, "~/reset", self._on_reset)
        self.create_service(Trigger, "~/serve", self._on_serve)
        self.create_service(SetBool, "~/teach", self._on_teach)
        self.create_service(SetBool, "~/pause", self._on_pause)
        self.create_service(Trigger, "~/step", self._on_step)

    # -- time ----------------------------------------------------------------------------------

    @property
    def _stands(self) -> bool:
        """Whether time stands still by order."""
        return (self._paused and not self._steps_once) or not self.active

    def _tick(self) -> None:
        """Publish one tick; in lockstep the world stands still until it is answered."""
        self._tick_ns = self._world.time_ns
        self._asked_s = time.monotonic()
        self._counts["ticks"] += 1
        self._output.publish_tick(self.config.show)

    def _ask_again(self) -> None:
        if self._stands or self._alone.is_doubtful or self._pace.waits:
            return
        if time.monotonic() - self._asked_s < ASK_AGAIN_S:
            return
        if not self._counts["ticks"]:
            self._tick()
            return
        self._counts["asked_again"] += 1
        self._asked_s = time.monotonic()
        self._output.publish_tick(self.config.show)

    def _advance(self, period_s: float) -> None:
        """Let the world go on for one period and publish the next tick."""
        self._world.advance(period_s)
        self._publish_results()
        self._steps_once = False
        # What answers the tick before once more must not move the world again.
        self._tick_ns = self._world.time_ns
        self._pace.follow(period_s, self.config.rate)

    def _follow_wall_clock(self) -> None:
        now_s = time.monotonic()
        behind_s = now_s - self._real_time_s
        if self._stands or self._alone.is_doubtful or behind_s < 0.001:
            self._real_time_s = self._real_time_s if behind_s < 0.001 else now_s
            return
        self._miss_commands(now_s)
        # After a long stall the world does not rush to catch up.
        period_s = min(round(behind_s, 3), 0.05)
        self._real_time_s = now_s if behind_s > 0.05 else self._real_time_s + period_s
        self._advance(period_s)

    def _miss_commands(self, now_s: float) -> None:
        """Have the arm stop, and launch no ball, once commands stay away."""
        if self._is_commanded and now_s - self._answered_s > self.config.command_timeout_s:
            self._is_commanded = False
            self._world.miss_commands()
            self.complain(
                UserError(f"no joint_command in {self.config.command_timeout_s:g} s; the arm comes to rest")
            )

    def _publish_results(self) -> None:
        while self._world.results:
            label, outcome = self._world.results.popleft()
            self._counts["returned"] += outcome.returned
            self._output.publish_outcome(label, outcome)

    # -- what comes in -------------------------------------------------------------------------

    def _on_strategy(self, message: Header) -> None:
        try:
            text = message.frame_id
            self._world.strategy = StrategyLabel.parse(text, "topic strategy") if text else None
        except UserError as error:
            self._refuse(error)

    def _on_feed(self, message: Odometry) -> None:
        try:
            self.require_active()
            self._world.feed(feed_from_message(message), stamp_to_ns(message.header.stamp))
        except UserError as error:
            self._refuse(error)

    def _on_command(self, message: JointTrajectory) -> None:
        if self._world.teaching or self._stands or not self._answers_tick(message.header.stamp):
            return
        try:
            command = command_from_message(self._robot, message)
        except UserError as error:
            self._refuse(error)
            return
        self._answered_s = time.monotonic()
        self._is_commanded = True
        self._world.command(command.position, command.velocity, command.period_s, command.label)
        if self.config.mode == "lockstep":
            self._advance(command.period_s)

    def _on_hand(self, message: MultiDOFJointTrajectory) -> None:
        if not self._world.teaching or self._stands or not self._answers_tick(message.header.stamp):
            return
        try:
            gesture = gesture_from_message(message)
        except UserError as error:
            self._refuse(error)
            return
        self._answered_s = time.monotonic()
        if gesture is not None:
            self._world.lead_hand(gesture)
        if self.config.mode == "lockstep":
            self._advance(TEACH_PERIOD_S)

    def _answers_tick(self, stamp: Any) -> bool:
        return self.config.mode != "lockstep" or stamp_to_ns(stamp) == self._tick_ns

    def _refuse(self, error: UserError) -> None:
        self._counts["refused"] += 1
        self.complain(error)

    # -- services ------------------------------------------------------------------------------

    def _on_reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self.refuses(response):
            return response
        self._world.reset()
        self._publish_results()
        self._tick()
        response.success, response.message = True, "arm at home, no ball in play"
        return response

    def _on_serve(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self.refuses(response):
            return response
        strategy = self._world.strategy
        side = (self._strategies.of(strategy).side if strategy else None) or Side(self.config.side)
        self._world.feed(self._feeder.sample(side, SPREADS[self.config.spread], self._serve_rng))
        response.success = True
        response.message = (
            f"a ball to the {side.value} is launched once the arm rests in the ready pose of strategy "
            f"{strategy or '(none)'}; {self._world.feeds_waiting} wait"
        )
        return response

    def _on_teach(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        if self._world.rally.ball_in_play:
            response.success, response.message = False, "a ball is in play; ask again after it"
            return response
        self._world.set_teaching(request.data)
        response.success = True
        response.message = "arm in zero-g, led by teach/hand" if request.data else "arm follows joint_command"
        return response

    def _on_pause(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        self._paused = request.data
        response.success, response.message = True, "paused" if request.data else "running"
        self.publish_diagnostics()
        return response

    def _on_step(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self.refuses(response):
            return response
        if not self._paused:
            response.success, response.message = False, "time goes on; call ~/pause with true first"
            return response
        response.success = True
        if self.config.mode == "lockstep":
            self._steps_once = True
            self._output.publish_tick(self.config.show)
            response.message = "one tick, once it is answered"
        else:
            self._advance(1.0 / self.config.joint_state_rate_hz)
            response.message = "one tick"
        return response


def main(argv: list[str] | None = None) -> int:
    """Start the simulator."""
    return run("simulator", Simulator, argv, __doc__)

"""Leading strokes by the hand over the topics: to the ready pose, through the stroke, to the verdict."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry
from numpy.typing import NDArray
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from std_msgs.msg import Header

from msrd_ros.contract.episode import CONTROL_PERIOD_S
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.contract.outcome import Outcome
from msrd_ros.contract.translation import NANOSECONDS, read_outcome
from msrd_ros.core.errors import UserError
from msrd_ros.nodes.command_output import CommandOutput
from msrd_ros.nodes.common import EVENT, LATCHED, StackNode, referee_hears
from msrd_ros.nodes.hand_output import HandOutput
from msrd_ros.nodes.led_stroke import Kept, Led, LedStroke, Stage, read_verdicts
from msrd_ros.nodes.messages import feed_to_message, strategy_message
from msrd_ros.nodes.teach_mode import TeachMode
from msrd_ros.nodes.tick_inputs import TickInput, TickInputs
from msrd_ros.robots.robot import Robot
from msrd_ros.table_tennis.ball.feeder import Feed
from msrd_ros.table_tennis.strokes.player import Phase, StrokePlayer

Array = NDArray[np.float64]

VERDICT_PATIENCE_S = 10.0
"""A stroke on which the recorder gives no verdict for so long is not recorded."""
SLOW_RAD_S = 0.01
"""In real time an arm that is measured no faster than this rests."""
_PERIOD_NS = round(0.9 * CONTROL_PERIOD_S * NANOSECONDS)


class Lead:
    """Leads one stroke after the other: answers ticks with commands on the way, with the hand from then on.

    In lockstep nobody else may answer meanwhile.

    Parameters
    ----------
    node
        Whose topics they are.
    robot
        The arm, of N joints.
    done
        Called when the ball is decided and the recorder has spoken. The arm is still led; go on with `begin`
        or `end`.
    recorder
        Parameters of the recorder whose verdict is awaited; None: of none.
    lockstep
        Whether commands answer the ticks of a simulator.
    """

    def __init__(
        self,
        node: StackNode,
        robot: Robot,
        done: Callable[[Led], None],
        recorder: AsyncParameterClient | None,
        lockstep: bool = True,
    ) -> None:
        self._node, self._robot, self._done = node, robot, done
        self._recorder, self._lockstep = recorder, lockstep
        self.stage = Stage.OVER
        self.since_s = time.monotonic()
        self._stroke: LedStroke | None = None
        self._came_from: Array | None = None
        self._player: StrokePlayer | None = None
        self._due: Feed | None = None
        self._outcome: Outcome | None = None
        self._verdicts: dict[int, Kept] = {}
        self._peak_speed = 0.0
        self._has_let_go = self._ends = self._in_play = self._awaits_verdict = False
        self._at_rest: Callable[[], None] = lambda: None
        self._acted_ns = 0
        self._strategy = node.create_publisher(Header, "strategy", LATCHED)
        self._feed = node.create_publisher(Odometry, "feed", EVENT)
        self._command = CommandOutput(node, robot, lockstep, time.monotonic)
        self._hand = HandOutput(node, robot)
        self._subscriptions = [
            node.create_subscription(DiagnosticArray, "rally/outcome", self._on_outcome, EVENT),
            node.create_subscription(DiagnosticArray, "recorder/verdict", self._on_verdict, EVENT),
        ]
        self._inputs = TickInputs(node, robot, lockstep, self._act, self._repeat, node.complain)
        self._teach = TeachMode(node)

    @property
    def floats(self) -> bool:
        """Whether somebody is there who lets the arm float in zero-g."""
        return self._teach.is_there

    @property
    def recorder_is_there(self) -> bool:
        """Whether a recorder takes parameters, or none is awaited."""
        return self._recorder is None or self._recorder.services_are_ready()

    @property
    def is_heard(self) -> bool:
        """Whether everyone is there and connected whom a stroke needs."""
        if not (self.floats and referee_hears(self._node, self._feed) and self.recorder_is_there):
            return False
        return self._recorder is None or self._node.count_publishers("recorder/verdict") > 0

    def close(self) -> None:
        """Lead no more, and let others command."""
        self._enter(Stage.OVER)
        self._inputs.close()
        for subscription in self._subscriptions:
            self._node.destroy_subscription(subscription)
        self._command.close()
        self._hand.close()
        for publisher in (self._strategy, self._feed):
            self._node.destroy_publisher(publisher)
        self._teach.close()

    @property
    def awaits_ball(self) -> bool:
        """Whether the hand has the paddle, and no ball has been launched."""
        return self.stage is Stage.SHOWING and not self._in_play and self._due is None

    # -- one stroke ----------------------------------------------------------------------------

    def begin(
        self, label: StrategyLabel, stroke: LedStroke, feed: Feed | None, said: Mapping[str, str]
    ) -> None:
        """Lead a stroke, from wherever the arm is.

        Parameters
        ----------
        label
            What it is called.
        stroke
            What the hand does.
        feed
            The ball that is launched as soon as the hand has the paddle; None waits for `launch`.
        said
            Parameters that the recorder is given first, such as the subject; none if empty.
        """
        # The way back to where the last stroke began is free, whatever side comes next.
        self._came_from = self._stroke.ready_posture if self._stroke is not None else None
        self._stroke, self._due = stroke, feed
        self._outcome, self._peak_speed = None, 0.0
        self._has_let_go = self._ends = self._in_play = self._awaits_verdict = False
        # It may take its time, above all while compiled code is made for the first time.
        self._enter(Stage.CALLING)
        self._strategy.publish(strategy_message(label, self._node.get_clock().now().to_msg()))
        if not said or self._recorder is None:
            self._begin_to_move()
            return
        values = [Parameter(name, Parameter.Type.STRING, text) for name, text in said.items()]
        self._recorder.set_parameters(values).add_done_callback(lambda _: self._begin_to_move())

    def launch(self, feed: Feed) -> None:
        """Launch the ball of a stroke that was begun without one."""
        self._due = feed

    def let_go(self) -> None:
        """Take the hand off the paddle: the arm comes to rest. A ball that flies is still decided."""
        self._has_let_go = True
        self._due = None

    def end(self, then: Callable[[], None]) -> None:
        """Let go, wait until no ball flies and the arm rests, and have it held; then call `then`."""
        self.let_go()
        self._ends, self._at_rest = True, then
        if self.stage in (Stage.SHOWING, Stage.JUDGING):
            self._enter(Stage.RESTING)
        elif self.stage is Stage.OVER:
            then()

    def _begin_to_move(self) -> None:
        """Leave zero-g, so that the arm can be sent to the ready pose."""
        self._switch(False, lambda: self._enter(Stage.MOVING))

    def _begin_to_show(self) -> None:
        self._enter(Stage.RESTING if self._ends else Stage.SHOWING)

    def _judge(self) -> None:
        """The ball is decided; as soon as the recorder has spoken as well, it is done."""
        assert self._outcome is not None
        recorded = self._verdicts.pop(self._outcome.ball_id, None)
        self._awaits_verdict = self._recorder is not None and recorded is None
        if self.stage is not Stage.JUDGING:
            self._enter(Stage.JUDGING)
        if not self._awaits_verdict:
            self._done(Led(self._outcome, recorded, self._peak_speed))

    def give_up_on_recorder(self) -> None:
        """Have it done without the recorder's verdict."""
        assert self._outcome is not None
        self._awaits_verdict = False
        self._done(Led(self._outcome, None, self._peak_speed))

    def _enter(self, stage: Stage) -> None:
        if stage in (Stage.CALLING, Stage.OVER):
            self._player = None
        self.stage = stage
        self.since_s = time.monotonic()

    # -- ticks ---------------------------------------------------------------------------------

    def _act(self, tick: TickInput) -> None:
        if self.stage is Stage.MOVING:
            self._move(tick)
        elif self.stage in (Stage.SHOWING, Stage.JUDGING, Stage.RESTING):
            # While the recorder judges, time goes on: what follows a stroke tells that it is whole.
            self._show(tick)

    def _rests(self, tick: TickInput) -> bool:
        return bool(np.abs(tick.joint_velocity).max() <= (0.0 if self._lockstep else SLOW_RAD_S))

    def _move(self, tick: TickInput) -> None:
        assert self._stroke is not None
        if not self._lockstep and 0 <= tick.time_ns - self._acted_ns < _PERIOD_NS:
            return
        self._acted_ns = tick.time_ns
        if self._player is None:
            self._command.forget()
            self._player = StrokePlayer(self._robot, tick.joint_position)
            self._player.prepare(None, self._stroke.ready_posture, self._came_from)
        if self._has_let_go:
            reference = self._player.hold()
            if self._rests(tick) and not np.any(reference.velocity):
                self._has_ended()
                return
        elif self._player.phase is Phase.READY and self._rests(tick):
            self._enter(Stage.CALLING)
            self._switch(True, self._begin_to_show)
            return
        else:
            reference = self._player.tick(tick.joint_position, tick.ball_position, tick.ball_stamp_ns)
        self._command.send(reference, None, tick.time_ns)

    def _show(self, tick: TickInput) -> None:
        assert self._stroke is not None
        if self._due is not None:
            self._feed.publish(feed_to_message(self._due))
            self._due, self._in_play = None, True
        if self.stage is Stage.RESTING and self._rests(tick) and not self._in_play:
            self._enter(Stage.CALLING)
            self._switch(False, self._has_ended)
            return
        speed = float(np.abs(tick.joint_velocity / self._robot.limits.speed_rad_s).max())
        self._peak_speed = max(self._peak_speed, speed)
        self._stroke.see(tick.ball_stamp_ns / NANOSECONDS, tick.ball_position)
        gesture = None
        if not self._has_let_go:
            gesture = self._stroke.hand_at(tick.time_ns / NANOSECONDS, tick.joint_position)
        self._hand.send(gesture, tick.joint_position, tick.time_ns)

    def _has_ended(self) -> None:
        self._enter(Stage.OVER)
        self._at_rest()

    def _repeat(self) -> None:
        if self.stage is Stage.MOVING:
            self._command.repeat()
        else:
            self._hand.repeat()

    # -- what comes in -------------------------------------------------------------------------

    def _on_outcome(self, message: DiagnosticArray) -> None:
        if self.stage not in (Stage.SHOWING, Stage.RESTING):
            return
        try:
            _, self._outcome = read_outcome(message)
        except UserError as error:
            self._node.complain(error)
            return
        self._in_play = False
        if self.stage is Stage.SHOWING:
            self._judge()

    def _on_verdict(self, message: DiagnosticArray) -> None:
        try:
            self._verdicts.update(read_verdicts(message))
        except UserError as error:
            self._node.complain(error)
        if self._awaits_verdict:
            self._judge()

    def _switch(self, teaching: bool, then: Callable[[], None]) -> None:
        """Have the arm float or follow commands, then go on."""

        def switched() -> None:
            if self.stage is not Stage.CALLING:
                return  # closed meanwhile
            self._hand.forget()
            then()
            # The world has stood still since the last tick; it is answered in the new mode.
            self._inputs.act_again()

        self._teach.call(teaching, switched)

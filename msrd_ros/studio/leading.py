"""Who leads the arm by the hand, and how far that is: one browser, one stroke at a time."""

from __future__ import annotations

import time

from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from rclpy.task import Future
from std_srvs.srv import SetBool

from msrd_ros.core.errors import UserError
from msrd_ros.nodes.common import StackNode, steady_timer
from msrd_ros.nodes.lead import VERDICT_PATIENCE_S, Lead
from msrd_ros.nodes.led_stroke import Led, Stage
from msrd_ros.robots.robot import Robot
from msrd_ros.studio.control import Control
from msrd_ros.studio.task import FULL_SPEED, Done, Task, Turn
from msrd_ros.studio.watch import Watch

LOOK_PERIOD_S = 0.05
PATIENCE_S = 30.0
"""What has not come about by then is given up: rest, a service's answer, the way to the ready pose."""
GONE_S = 10.0
"""A simulator of which nothing is heard for so long is gone; on a busy machine it speaks late."""
RECORDER = "recorder"
NO_NOTE = Parameter("note", Parameter.Type.STRING, "")


class Leading:
    """Takes the arm from the executor, has strokes led, and gives it back as it was.

    Parameters
    ----------
    node
        Whose topics they are.
    robot
        The arm.
    watch, control
        What is known of the stack, and what is sent to it.
    lockstep
        Whether commands answer the ticks of a simulator.

    Attributes
    ----------
    turn
        Whose turn it is.
    leader
        Number of the browser that leads; None while nobody does.
    trouble
        Why it ended last, if it ended badly.
    """

    def __init__(self, node: StackNode, robot: Robot, watch: Watch, control: Control, lockstep: bool) -> None:
        self._node, self._robot, self._watch, self._control = node, robot, watch, control
        self._lockstep = lockstep
        self.turn = Turn.FREE
        self.leader: int | None = None
        self.trouble = ""
        self._armed: int | None = None
        self._since_s = time.monotonic()
        self._lead: Lead | None = None
        self._task: Task | None = None
        self._done: Done = lambda task, led: None
        self._is_over = False
        self._was_enabled = False
        self._rate_before: float | None = None
        self._rate = 0.0
        self._simulated_s = -GONE_S
        self._asks_teach = False
        self._recorder = AsyncParameterClient(node, RECORDER)
        self._teach = node.create_client(SetBool, "simulator/teach")
        steady_timer(node, LOOK_PERIOD_S, self._look)

    # -- what a page may ask for ---------------------------------------------------------------

    @property
    def is_simulated(self) -> bool:
        """Whether a simulator moves the arm, or did a moment ago."""
        return time.monotonic() - self._simulated_s < GONE_S

    def is_armed(self, browser: int) -> bool:
        """Whether a page may lead: a simulated arm any, a real one only the page that has been told so."""
        return self.is_simulated or self._armed == browser

    def arm(self, browser: int) -> None:
        """Give a page leave to lead a real arm."""
        self._armed = browser

    def require_free(self, browser: int) -> None:
        """Refuse a second hand on the paddle.

        Raises
        ------
        UserError
            If somebody leads.
        """
        if self.leader is not None:
            who = "this page" if self.leader == browser else f"the page in browser {self.leader}"
            raise UserError(f"{who} leads the arm; wait until that stroke is over, or stop it")

    def lead(self, browser: int, task: Task, done: Done) -> None:
        """Have strokes led, beginning with this one, until `done` gives no next.

        Raises
        ------
        UserError
            If somebody leads already, or somebody is missing; nothing moves then.
        """
        self.require_free(browser)
        if not self.is_armed(browser):
            raise UserError("no simulator is heard of, so this may be a real arm; press Enable leading first")
        if not self._teach.service_is_ready():
            raise UserError("nobody lets the arm float: no simulator/teach; start a simulator")
        if not self._watch.is_alive(RECORDER):
            raise UserError("nobody records: no recorder is heard of; start one, so that the stroke is kept")
        if self._watch.values("simulator").get("paused") == "true":
            raise UserError("the simulator's time stands; press Go on first")
        self.leader, self._task, self._done, self.trouble = browser, task, done, ""
        self._is_over = False
        self._was_enabled = self._executor("enabled") == "true"
        self._enter(Turn.TAKING)
        if self._was_enabled:
            self._control.enable(False, _nothing)

    def launch(self) -> None:
        """Launch the ball of a stroke that waits for it."""
        if self._lead is not None and self._task is not None and self._lead.awaits_ball:
            self._lead.launch(self._task.feed)

    def stop(self, why: str) -> None:
        """Take the hand off the paddle; the arm comes to rest and is given back."""
        if self.turn in (Turn.FREE, Turn.RETURNING):
            return
        self.trouble = why
        self._return()

    def halt(self) -> None:
        """As `stop`, and the executor gets no leave to move either."""
        self._was_enabled = False
        self.stop("stopped")

    def forget(self, browser: int) -> None:
        """A browser is gone: what it led ends, and it has no leave any more."""
        self._armed = None if self._armed == browser else self._armed
        if self.leader == browser:
            self.stop("the page that led is gone; the hand has let go")

    @property
    def told(self) -> str:
        """Where it stands, for a person."""
        if self.turn is Turn.LEADING and self._lead is not None:
            return self._lead.stage.value
        return self.turn.value

    @property
    def leads(self) -> bool:
        """Whether the hand has the paddle."""
        return self._lead is not None and self._lead.stage is Stage.SHOWING

    # -- taking, leading, giving back ----------------------------------------------------------

    def _executor(self, name: str) -> str:
        return self._watch.values("executor").get(name, "")

    def _enter(self, turn: Turn) -> None:
        self.turn = turn
        self._since_s = time.monotonic()

    def _pace(self, rate: float) -> None:
        """Let simulated time go on at a rate; where it goes as fast as it can, full speed is no less."""
        told = self._watch.values("simulator").get("rate")
        if told is None or not self._lockstep:
            return
        if self._rate_before is None:
            self._rate_before = self._rate = float(told)
        if rate == FULL_SPEED and self._rate_before == 0.0:
            rate = 0.0
        if rate != self._rate:
            self._rate = rate
            self._control.set_rate(rate, _nothing)

    def _look(self) -> None:
        """Go on as soon as what is waited for is there."""
        if self._watch.is_alive("simulator"):
            self._simulated_s = time.monotonic()
        if self.turn is not Turn.FREE:
            self._pace(self._task.rate if self._task is not None and self.leads else FULL_SPEED)
        if self.turn is Turn.TAKING:
            self._take()
        elif self.turn is Turn.LEADING:
            self._watch_over()
        elif self.turn is Turn.RETURNING:
            self._give_back()
        if self.turn is Turn.TAKING and time.monotonic() - self._since_s > PATIENCE_S:
            self.stop("the arm could not be taken: it does not come to rest, or a ball stays in play")

    def _take(self) -> None:
        """The executor gives way to whom commands beside it, once no ball flies and the arm rests."""
        if self._lead is None:
            if self._executor("enabled") != "true" and not self._asks_teach:
                self._asks_teach = True
                self._teach.call_async(SetBool.Request(data=False)).add_done_callback(self._may_take)
            return
        driven = bool(self._watch.values("executor")) and self._lockstep
        if self._lead.is_heard and (not driven or self._executor("gives_way") == "true"):
            self._enter(Turn.LEADING)
            self._begin()

    def _may_take(self, answered: Future) -> None:
        self._asks_teach = False
        if self.turn is Turn.TAKING and answered.result().success:
            self._lead = Lead(self._node, self._robot, self._judge, self._recorder, self._lockstep)

    def _begin(self) -> None:
        assert self._lead is not None
        assert self._task is not None
        task = self._task
        self._lead.begin(task.label, task.stroke, task.feed if task.at_once else None, {"note": task.note})

    def _judge(self, led: Led) -> None:
        assert self._task is not None
        following = self._done(self._task, led)
        if following is None or self.turn is not Turn.LEADING:
            self._return()
            return
        self._task = following
        self._begin()

    def _watch_over(self) -> None:
        assert self._lead is not None
        waited_s = time.monotonic() - self._lead.since_s
        stage = self._lead.stage
        if not self.is_simulated and self._armed is None:
            self.stop("the simulator is gone")
        elif stage is Stage.JUDGING and waited_s > VERDICT_PATIENCE_S:
            self._lead.give_up_on_recorder()
        elif stage in (Stage.CALLING, Stage.MOVING) and waited_s > PATIENCE_S:
            self.stop(f"no progress while {stage.value}")

    def _return(self) -> None:
        self._is_over = self._lead is None
        self._enter(Turn.RETURNING)
        if self._lead is not None:
            self._lead.end(self._has_ended)

    def _has_ended(self) -> None:
        self._is_over = True

    def _give_back(self) -> None:
        """Let others command; the executor is enabled again once it has the arm."""
        if self._lead is not None:
            if not self._is_over and time.monotonic() - self._since_s < PATIENCE_S:
                return
            self._lead.close()
            self._lead = None
            self._control.choose(self._control.wanted)
            self._recorder.set_parameters([NO_NOTE])
        if self._executor("gives_way") == "true":
            return
        if self._rate_before is not None:
            self._control.set_rate(self._rate_before, _nothing)
            self._rate_before = None
        if self._was_enabled:
            self._control.enable(True, _nothing)
        self.leader = None
        self._enter(Turn.FREE)


def _nothing(ok: bool, text: str, **values: object) -> None:
    """Nobody asked for it by itself."""

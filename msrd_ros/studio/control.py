"""What a page may have done, over the stack's own topics and services."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from nav_msgs.msg import Odometry
from rclpy.client import Client
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from rclpy.task import Future
from std_msgs.msg import Header
from std_srvs.srv import SetBool, Trigger

from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.core.errors import UserError
from msrd_ros.nodes.common import EVENT, LATCHED
from msrd_ros.nodes.messages import feed_to_message, strategy_message
from msrd_ros.studio.requests import Request
from msrd_ros.table_tennis.ball.aim import aimed_feed
from msrd_ros.table_tennis.ball.feeder import SPREADS, Feed, Feeder
from msrd_ros.table_tennis.strategies.table import DEFAULT_SIDE, Side, Strategies


class Answer(Protocol):
    """Takes whether it was done, what is to be said of it, and values for the page."""

    def __call__(self, ok: bool, text: str, **values: object) -> None:
        """Send the answer; from any thread."""


SLOWEST, FASTEST = 0.05, 1.0
"""Rates of the simulator that a page offers; beside them 0, as fast as it goes."""


class Control:
    """Sends what a page asks for.

    Parameters
    ----------
    node
        Whose publishers and clients they are.
    strategies
        Tells which side a strategy is fed to.
    rng
        Draws the feeds.
    """

    def __init__(self, node: Node, strategies: Strategies, rng: np.random.Generator) -> None:
        self._node, self._strategies, self._rng = node, strategies, rng
        self._feeder = Feeder()
        self._feed = node.create_publisher(Odometry, "feed", EVENT)
        self._strategy = node.create_publisher(Header, "strategy", LATCHED)
        self._pause = node.create_client(SetBool, "simulator/pause")
        self._step = node.create_client(Trigger, "simulator/step")
        self._reset = node.create_client(Trigger, "simulator/reset")
        self._enable = node.create_client(SetBool, "executor/enable")
        self._simulator = AsyncParameterClient(node, "simulator")
        self.wanted: StrategyLabel | None = None
        self.own: Feed | None = None
        """A feed of the person's own making, in place of drawn ones."""
        self.spread = "standard"

    # -- play ----------------------------------------------------------------------------------

    def choose(self, label: StrategyLabel | None) -> None:
        """Have a strategy played from the next ball on; none for rest."""
        self.wanted = label
        self._strategy.publish(strategy_message(label, self._node.get_clock().now().to_msg()))

    def set_feed(self, request: Request) -> str:
        """Which balls come from now on: of a spread, or all alike of the person's own making."""
        kind = request.choice("kind", ("easy", "standard", "wide", "own"))
        if kind == "own":
            place = request.within("x", -1.3, -0.1, "m"), request.within("y", -0.7, 0.7, "m")
            speed, spin = (
                request.within("speed", 3.0, 9.0, "m/s"),
                request.within("backspin", -200, 200, "rad/s"),
            )
            self.own = aimed_feed(place, speed, spin)
            return f"balls of {speed:g} m/s, backspin {spin:g} rad/s, to x {place[0]:g}, y {place[1]:g} m"
        self.own, self.spread = None, kind
        return f"balls of spread {kind}"

    def feed(self, side: Side | None = None) -> str:
        """Feed one ball.

        Parameters
        ----------
        side
            Where the policy of the wanted strategy stands; None where nobody says.

        Raises
        ------
        UserError
            If nobody would launch it.
        """
        if not self._feed.get_subscription_count():
            raise UserError("nobody launches balls: topic feed has no subscriber; start a simulator")
        listed = self._strategies.of(self.wanted).side if self.wanted else None
        side = listed or side or Side(DEFAULT_SIDE)
        self._feed.publish(
            feed_to_message(self.own or self._feeder.sample(side, SPREADS[self.spread], self._rng))
        )
        return "a ball is launched once the arm rests ready"

    # -- time, and the arm's leave to move -----------------------------------------------------

    def enable(self, wanted: bool, answer: Answer) -> None:
        """Give the arm leave to move, or have it come to rest within its limits."""
        self._call(self._enable, SetBool.Request(data=wanted), "an executor", answer)

    def pause(self, wanted: bool, answer: Answer) -> None:
        """Let the simulator's time stand, or go on."""
        self._call(self._pause, SetBool.Request(data=wanted), "a simulator", answer)

    def step(self, answer: Answer) -> None:
        """Let a standing simulator go on by one tick."""
        self._call(self._step, Trigger.Request(), "a simulator", answer)

    def reset(self, answer: Answer) -> None:
        """Arm at home, no ball in play."""
        self._call(self._reset, Trigger.Request(), "a simulator", answer)

    def set_rate(self, rate: float, answer: Answer) -> None:
        """Simulated seconds a second; 0 for as fast as it goes."""
        if not self._simulator.services_are_ready():
            answer(False, "there is no simulator; start one")
            return
        wanted = Parameter("rate", Parameter.Type.DOUBLE, rate)

        def done(future: Future) -> None:
            result = future.result().results[0]
            shown = f"time goes at {rate:g}" if rate else "time goes as fast as it can"
            answer(result.successful, shown if result.successful else result.reason)

        self._simulator.set_parameters([wanted]).add_done_callback(done)

    def _call(self, client: Client, request: Any, who: str, answer: Answer) -> None:
        if not client.service_is_ready():
            answer(False, f"{client.srv_name} is not there; start {who}")
            return

        def done(future: Future) -> None:
            response = future.result()
            answer(response.success, response.message)

        client.call_async(request).add_done_callback(done)

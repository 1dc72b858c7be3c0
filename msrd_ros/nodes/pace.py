"""How fast simulated time may pass in lockstep."""

from __future__ import annotations

import time
from collections.abc import Callable

from rclpy.node import Node

from msrd_ros.contract.translation import NANOSECONDS
from msrd_ros.nodes.common import steady_timer


class Pace:
    """Holds ticks back, so that simulated time passes no faster than is asked for.

    Parameters
    ----------
    node
        Whose timer it uses.
    tick
        Called when the next tick is due.
    """

    def __init__(self, node: Node, tick: Callable[[], None]) -> None:
        self._tick = tick
        self._due_s = 0.0
        self._timer = steady_timer(node, 1.0, self.hurry)
        self._timer.cancel()

    @property
    def waits(self) -> bool:
        """Whether a tick is held back."""
        return not self._timer.is_canceled()

    def follow(self, period_s: float, rate: float) -> None:
        """Have the next tick called when `period_s` of simulated time may have passed at `rate`; 0: now.

        What was lost to slow answers is not caught up with.
        """
        now_s = time.monotonic()
        self._due_s = max(self._due_s + period_s / rate, now_s) if rate else now_s
        if self._due_s == now_s:
            self._tick()
            return
        self._timer.timer_period_ns = int((self._due_s - now_s) * NANOSECONDS)
        self._timer.reset()

    def hurry(self) -> None:
        """Call a tick that is held back, now."""
        if self.waits:
            self._timer.cancel()
            self._tick()

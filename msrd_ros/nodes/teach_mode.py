"""Asking the simulator to let the arm float, or to have it follow commands."""

from __future__ import annotations

from collections.abc import Callable

from rclpy.task import Future
from std_srvs.srv import SetBool, Trigger

from msrd_ros.core.errors import UserError
from msrd_ros.nodes.common import StackNode

MOST_TAKEOVERS = 3


class TeachMode:
    """Calls simulator/teach, and clears away what keeps it from being obeyed.

    Parameters
    ----------
    node
        Whose clients they are.
    """

    def __init__(self, node: StackNode) -> None:
        self._node = node
        self._teach = node.create_client(SetBool, "simulator/teach")
        self._reset = node.create_client(Trigger, "simulator/reset")
        self._takeovers = 0

    @property
    def is_there(self) -> bool:
        """Whether somebody lets the arm float."""
        ready: bool = self._teach.service_is_ready()
        return ready

    def close(self) -> None:
        """Call no more."""
        for client in (self._teach, self._reset):
            self._node.destroy_client(client)

    def call(self, teaching: bool, then: Callable[[], None]) -> None:
        """Let the arm float, or not; `then` is called once it does as it is told.

        Raises
        ------
        UserError
            Later, out of the node's loop: if balls stay in play whatever is called off.
        """

        def answered(future: Future) -> None:
            response = future.result()
            if not response.success:
                self._take_over(response.message, lambda: self.call(teaching, then))
                return
            self._takeovers = 0
            then()

        self._teach.call_async(SetBool.Request(data=teaching)).add_done_callback(answered)

    def _take_over(self, reason: str, then: Callable[[], None]) -> None:
        """Call off a ball that somebody else has left in play, perhaps this node before it was interrupted.

        In lockstep it never comes down by itself: nobody answers the ticks.
        """
        self._takeovers += 1
        if self._takeovers > MOST_TAKEOVERS:
            raise UserError(f"simulator/teach: {reason}; see who feeds balls, then start anew")
        self._node.get_logger().warning(
            f"simulator/teach: {reason}; the simulator is reset, the ball called off"
        )
        self._reset.call_async(Trigger.Request()).add_done_callback(lambda _: then())

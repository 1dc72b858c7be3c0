"""Demonstrations that arrive on topics: bags being played, or a live recording session."""

from __future__ import annotations

import re
from collections.abc import Callable

from rclpy.node import Node

from msrd_ros.bags.devices import ArmMessages
from msrd_ros.bags.stroke_buffer import StrokeBuffer
from msrd_ros.bags.strokes import Arrival, CutSettings
from msrd_ros.contract.episode import Episode
from msrd_ros.contract.labels import WITHOUT_LABEL
from msrd_ros.core.errors import UserError
from msrd_ros.nodes.common import steady_timer
from msrd_ros.nodes.recorder_inputs import RecorderInputs
from msrd_ros.recordings.inspection import judge
from msrd_ros.recordings.limits import InspectionLimits
from msrd_ros.recordings.verdict import Refusal, Verdict
from msrd_ros.robots.robot import Robot

SETTLE_PERIOD_S = 0.02
ADAPT_PERIOD_S = 0.2
COUNT = re.compile(r" \(\d+ messages?\)$")


class PlayedBags:
    """Hears, cuts and inspects strokes just as the recorder does, and hands them on as episodes.

    Parameters
    ----------
    node
        Whose subscriptions they are.
    robot
        The arm that is heard.
    take
        Called with every accepted stroke.
    refuse
        Called with what is wrong with one that is not.
    unlabelled
        Whether strokes without a label are accepted.
    """

    def __init__(
        self,
        node: Node,
        robot: Robot,
        take: Callable[[Episode], None],
        refuse: Callable[[UserError], None],
        unlabelled: bool = False,
    ) -> None:
        self._robot = robot
        self._take, self._refuse = take, refuse
        self._unlabelled = unlabelled
        self._node = node
        self._is_arms = ArmMessages(robot)
        self._notes: set[str] = set()
        self._buffer = StrokeBuffer(CutSettings(), self._is_arms)
        self._inputs: RecorderInputs | None = RecorderInputs(node, [], self._hear)
        self._settle = steady_timer(node, SETTLE_PERIOD_S, self._cut_settled)
        self._adapt = steady_timer(node, ADAPT_PERIOD_S, self._inputs.adapt)

    @property
    def lost(self) -> int:
        """Messages that went missing on their way."""
        return self._inputs.lost if self._inputs else 0

    def close(self) -> None:
        """Listen no more."""
        if self._inputs is None:
            return
        self._inputs.close()
        self._inputs = None
        self._settle.cancel()
        self._adapt.cancel()

    def _hear(self, arrival: Arrival) -> None:
        if self._inputs is not None:
            self._buffer.add(arrival)

    def _cut_settled(self) -> None:
        self._buffer.tick()
        while self._inputs is not None and self._buffer.settled():
            stroke = self._buffer.cut()
            verdict, episode = judge(stroke, self._robot, InspectionLimits())
            if episode is not None and episode.label is None and not self._unlabelled:
                verdict, episode = Verdict(Refusal.NO_LABEL, WITHOUT_LABEL, verdict.notes), None
            self._tell([*self._is_arms.news(), *verdict.notes])
            if episode is not None:
                self._take(episode)
            else:
                self._refuse(
                    UserError(f"ball {stroke.ball_id} is left out: {verdict.reason}, {verdict.detail}")
                )

    def _tell(self, notes: list[str]) -> None:
        """Say what should be known, once: how many messages it concerns changes from stroke to stroke."""
        for note in notes:
            kind = COUNT.sub("", note)
            if kind not in self._notes:
                self._notes.add(kind)
                self._node.get_logger().warning(note)

"""The nodes of one stage, from their start to their end."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import ExitStack
from typing import Self

from msrd_ros.stack.processes import NodeLostError, NodeProcess
from msrd_ros.stack.sets import NodeCall, Part, Stage

LOOK_PERIOD_S = 0.1
AT_ONCE_S = 20.0
"""Who ends sooner after its start ends at once: it has hardly begun to work."""
FIRST_PAUSE_S = 1.0
MOST_AT_ONCE = 6
"""So many ends at once in a row, with pauses of 1, 2, 4, 8 and 16 s between them, are too many. The place of
a killed node is taken until the middleware forgets it, which takes it 20 s."""


class WatchedNode:
    """One node of a stage: its process, and when it is to be started again.

    Parameters
    ----------
    call
        What is started.
    start
        Starts it.
    """

    def __init__(self, call: NodeCall, start: Callable[[NodeCall], NodeProcess]) -> None:
        self.call = call
        self._start = start
        self._at_once = 0
        self._again_s: float | None = None
        self.process = start(call)

    @property
    def has_finished(self) -> bool:
        """Whether it has done its work, as far as its part allows it to."""
        return self.call.part is not Part.STAYS and self.process.exit_status == 0

    @property
    def is_lost(self) -> bool:
        """Whether it has ended although it is needed."""
        return self._again_s is None and self.process.exit_status is not None and not self.has_finished

    def plan_restart(self) -> float:
        """Decide when it is started again; the pause until then in s.

        Raises
        ------
        NodeLostError
            If it has ended at once too often.
        """
        self._at_once = self._at_once + 1 if self.process.ran_s < AT_ONCE_S else 1
        if self._at_once >= MOST_AT_ONCE:
            raise NodeLostError(
                f"{self.process.describe_end()}; it has ended within {AT_ONCE_S:g} s of its start "
                f"{self._at_once} times in a row and is not started again"
            )
        pause_s = FIRST_PAUSE_S * 2.0 ** (self._at_once - 1)
        self._again_s = time.monotonic() + pause_s
        return pause_s

    def start_if_due(self) -> None:
        """Start it again if its pause is over."""
        if self._again_s is not None and time.monotonic() >= self._again_s:
            self._again_s = None
            self.process = self._start(self.call)

    def stop(self) -> None:
        """End it."""
        self.process.stop()


class StageRun:
    """Starts the nodes of a stage in their order, watches them, and ends them the other way round.

    Parameters
    ----------
    stage
        What is started.
    start
        Starts one node.
    tell
        Gets a line about what happens.
    respawn
        Whether a node that is lost is started again.
    """

    def __init__(
        self,
        stage: Stage,
        start: Callable[[NodeCall], NodeProcess],
        tell: Callable[[str], None],
        respawn: bool = False,
    ) -> None:
        self._stage, self._start, self._tell, self._respawn = stage, start, tell, respawn
        self._nodes: list[WatchedNode] = []
        self._stack = ExitStack()

    def __enter__(self) -> Self:
        with ExitStack() as started:
            for call in self._stage.nodes:
                node = WatchedNode(call, self._start)
                started.callback(node.stop)
                self._nodes.append(node)
            self._stack = started.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        names = [node.call.label for node in reversed(self._nodes) if node.process.exit_status is None]
        if names:
            self._tell(f"ends {', '.join(names)}")
        self._stack.close()

    def wait(self) -> None:
        """Wait for the end of the stage: of the node that ends it, or for ever.

        Raises
        ------
        NodeLostError
            If a node is lost; names it, how it ended and what it said last.
        """
        while not any(node.has_finished and node.call.part is Part.ENDS for node in self._nodes):
            for node in self._nodes:
                if node.is_lost:
                    self._lose(node)
                node.start_if_due()
            time.sleep(LOOK_PERIOD_S)

    def _lose(self, node: WatchedNode) -> None:
        if not self._respawn:
            raise NodeLostError(node.process.describe_end())
        pause_s = node.plan_restart()
        self._tell(f"{node.process.describe_end()}; it is started again in {pause_s:g} s")

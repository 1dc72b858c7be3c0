"""After training: every stroke that the recorder keeps is taken into what was learned, and played then."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable
from pathlib import Path

from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry
from trajectory_msgs.msg import JointTrajectory

from msrd_ros.contract.topics import FEED
from msrd_ros.core.errors import UserError
from msrd_ros.nodes.common import COMMAND, EVENT, StackNode
from msrd_ros.nodes.led_stroke import read_verdicts
from msrd_ros.table_tennis.strokes.newcomer_session import NewcomerSession, Taken
from msrd_ros.table_tennis.strokes.policies import StrokePolicies

_VERDICT = "recorder/verdict"


class NewcomerService:
    """Hears of bags from the beginning, and takes them one by one on a thread of its own once it may.

    Strokes that the robot itself played are left alone, recorded or not.

    Parameters
    ----------
    node
        Whose subscription it is.
    publish
        Called, on the node's thread, with the policies after each bag.

    Attributes
    ----------
    failure
        What the thread ended with, for the node to raise; None while all is well.
    """

    def __init__(self, node: StackNode, publish: Callable[[StrokePolicies], None]) -> None:
        self._node, self._publish = node, publish
        self._bags: queue.SimpleQueue[Path | None] = queue.SimpleQueue()
        self._results: queue.SimpleQueue[tuple[Taken | UserError, StrokePolicies]] = queue.SimpleQueue()
        self._thread: threading.Thread | None = None
        self._taken = self._refused = 0
        self._strategies: tuple[str, ...] = ()
        self._latest = ""
        self.failure: BaseException | None = None
        self._own_strokes, self._is_own = 0, False
        node.create_subscription(DiagnosticArray, _VERDICT, self._on_verdict, EVENT)
        node.create_subscription(Odometry, FEED, self._on_feed, EVENT)
        node.create_subscription(JointTrajectory, "joint_command", self._on_command, COMMAND)

    @property
    def serves(self) -> bool:
        """Whether it has begun."""
        return self._thread is not None

    def begin(self, session: NewcomerSession) -> None:
        """Take what is in the session's journal, then what has been recorded meanwhile, then what comes."""
        self._thread = threading.Thread(target=self._run, args=(session,), name="newcomers")
        self._thread.start()

    def close(self) -> None:
        """End after the present bag."""
        self._bags.put(None)
        if self._thread is not None:
            self._thread.join()

    def report(self) -> None:
        """Tell and publish, on the node's thread, what came of bags."""
        while not self._results.empty():
            result, policies = self._results.get()
            if isinstance(result, UserError):
                self._refused += 1
                self._node.get_logger().error(f"not learned: {result}")
                continue
            self._taken += 1
            self._latest = str(result)
            self._strategies = tuple(map(str, policies.labels))
            self._node.get_logger().info(f"taken: {result}")
            self._publish(policies)

    def diagnose(self) -> tuple[str, dict[str, object]]:
        """What was taken."""
        return "learning from newcomers", {
            "taken": self._taken,
            "refused": self._refused,
            "waiting": self._bags.qsize(),
            "played_by_robot": self._own_strokes,
            "strategies": " ".join(self._strategies),
            "latest": self._latest,
        }

    def waits_for(self) -> list[str]:
        """Who is missing."""
        if self._node.count_publishers(_VERDICT):
            return []
        return [f"{_VERDICT}: start a recorder; every stroke that it keeps is learned from"]

    def _on_feed(self, _: Odometry) -> None:
        self._is_own = False

    def _on_command(self, message: JointTrajectory) -> None:
        # Whoever leads by hand names no strategy in commands.
        self._is_own |= bool(message.header.frame_id)

    def _on_verdict(self, message: DiagnosticArray) -> None:
        try:
            verdicts = read_verdicts(message)
        except UserError as error:
            self._node.complain(error)
            return
        for kept in verdicts.values():
            if not (kept.kept and kept.path):
                continue
            if self._is_own:
                # What the robot has learned must not teach it.
                self._own_strokes += 1
            else:
                self._bags.put(Path(kept.path))

    def _run(self, session: NewcomerSession) -> None:
        try:
            for again in session.take_again():
                self._results.put((again, session.policies))
            while (bag := self._bags.get()) is not None:
                try:
                    self._results.put((session.take(bag), session.policies))
                except UserError as error:
                    self._results.put((error, session.policies))
        except BaseException as error:  # handed on to the main thread, which raises it
            self.failure = error

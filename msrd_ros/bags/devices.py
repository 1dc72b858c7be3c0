"""Whose a serialised joint state is: the arm's, or that of another device on the same topic."""

from __future__ import annotations

from msrd_ros.bags.cdr import read_joint_names
from msrd_ros.contract.joint_states import JointStateTranslator
from msrd_ros.contract.topics import JOINT_STATES
from msrd_ros.robots.robot import Robot


class ArmMessages:
    """Tells an arm's joint states from others', which it counts.

    Parameters
    ----------
    robot
        The arm.
    """

    def __init__(self, robot: Robot) -> None:
        self._translator = JointStateTranslator(robot, JOINT_STATES)

    def __call__(self, data: bytes) -> bool:
        """Whether a serialised joint state is the arm's; one that cannot be read may be."""
        try:
            return self._translator.belongs(read_joint_names(data))
        except ValueError:
            return True

    @property
    def passed_over(self) -> int:
        """How many were others'."""
        return self._translator.passed_over

    def remarks(self) -> list[str]:
        """What was passed over so far, and how often."""
        return self._translator.remarks()

    def news(self) -> list[str]:
        """What of it has not been said yet."""
        return self._translator.news()

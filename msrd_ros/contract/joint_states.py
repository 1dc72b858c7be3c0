"""Joint states of an arm, whoever else speaks on their topic and whatever else their driver leaves out.

The topic is shared by devices: a gripper's driver publishes on it, too, and simulators send an empty message
first. All arrays of a sensor_msgs/JointState may be empty, and ros2_control's broadcaster writes NaN for an
interface that the arm lacks. What is certain is read; the rest is passed over, counted and said once.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from msrd_ros.contract.stamps import NANOSECONDS, stamp_to_ns
from msrd_ros.core.errors import UserError
from msrd_ros.robots.robot import Robot

SPARSEST_S = 0.045
"""Positions further apart than this do not tell velocities: a stroke is fastest for a tenth of a second."""

_MOST_KINDS = 16
"""Sets of names that are remembered; a source that makes up new ones must not fill the memory."""
_MOST_LETTERS = 80


class JointSample(NamedTuple):
    """The arm's state: positions (N,) in rad and velocities (N,) in rad/s."""

    position: NDArray[np.float64]
    velocity: NDArray[np.float64]


class JointStateTranslator:
    """Reads sensor_msgs/JointState: the robot's joints by name, in any order, extra joints ignored.

    Velocities that the driver does not tell are differences of positions over stamps.

    Parameters
    ----------
    robot
        Whose joints, N of them.
    where
        What to blame in errors, for example ``topic joint_states``.

    Attributes
    ----------
    passed_over
        How many messages did not tell the positions of all joints.
    derived
        How many samples have velocities from positions and stamps.
    """

    def __init__(self, robot: Robot, where: str = "topic joint_states") -> None:
        self._wanted = robot.joint_names
        self._robot = robot.name
        self._where = where
        self._orders: dict[tuple[str, ...], NDArray[np.intp] | None] = {}
        self._last: tuple[int, NDArray[np.float64]] | None = None
        self._remarks: Counter[str] = Counter()
        self._told: set[str] = set()
        self.passed_over = 0
        self.derived = 0

    def owns(self, names: Sequence[str]) -> bool:
        """Whether a message with these joints tells of the whole arm."""
        return self._order(tuple(names)) is not None

    def belongs(self, names: Sequence[str]) -> bool:
        """The same of a message that has come in; one that does not is counted as passed over."""
        if self.owns(names):
            return True
        self._pass_over(f"messages with {_listed(names)} are passed over: they lack {self._lacking(names)}")
        return False

    def sample(self, message: Any, time_ns: int | None = None) -> JointSample | None:
        """The state that a message tells.

        Parameters
        ----------
        message
            A sensor_msgs/JointState.
        time_ns
            When it was so; the message's stamp if None.

        Returns
        -------
        None where the message does not tell it: another device's, one without positions, or, of a driver that
        fills in no velocities, the first one and one that is not newer than the last.

        Raises
        ------
        UserError
            If a joint is named twice, a field is neither empty nor whole, a value is not finite, or positions
            without velocities are too far apart; names the joint.
        """
        names = tuple(message.name)
        order = self._order(names)
        if order is None:
            self.belongs(names)
            return None
        for joint in self._wanted:
            if names.count(joint) > 1:
                raise UserError(f"{self._where}: joint {joint} is named twice; let one device publish it")
        position = self._take(message.position, order, names, "position")
        if position is None:
            self._pass_over("messages without positions are passed over")
            return None
        _require_finite(position, self._wanted, f"{self._where}: position")
        now_ns = stamp_to_ns(message.header.stamp) if time_ns is None else time_ns
        last, self._last = self._last, (now_ns, position)
        velocity = self._take(message.velocity, order, names, "velocity")
        if velocity is None or np.isnan(velocity).all():
            return self._differentiate(last, now_ns, position)
        _require_finite(velocity, self._wanted, f"{self._where}: velocity")
        return JointSample(position, velocity)

    def read(self, message: Any) -> JointSample:
        """The state that a message tells.

        Raises
        ------
        UserError
            As `sample`, and where that gives none.
        """
        sample = self.sample(message)
        if sample is not None:
            return sample
        names = tuple(message.name)
        if self._order(names) is None:
            raise self.missing(names)
        raise UserError(
            f"{self._where}: the message tells no positions and velocities; the driver must fill in both, "
            f"or positions and rising stamps"
        )

    def missing(self, names: Sequence[str]) -> UserError:
        """What is wrong where no message is of the whole arm, but some are like one with these joints."""
        return UserError(
            f"{self._where}: joint {self._lacking(names)} is missing (there is {_listed(names)}); publish "
            f"all of {self._robot} ({self._wanted[0]}..{self._wanted[-1]}) in one message, "
            f"or say robot:=<yours>"
        )

    def remarks(self) -> list[str]:
        """All that a person should know of what was read, with the number of messages."""
        return [
            f"{self._where}: {text} ({count} message{'s' * (count > 1)})"
            for text, count in self._remarks.items()
        ]

    def news(self) -> list[str]:
        """What of it has not been said yet, without numbers: each is given out once."""
        new = [text for text in self._remarks if text not in self._told]
        self._told.update(new)
        return [f"{self._where}: {text}" for text in new]

    def _order(self, names: tuple[str, ...]) -> NDArray[np.intp] | None:
        """Where the arm's joints stand among `names`; None if not all are there."""
        if names not in self._orders:
            if len(self._orders) >= _MOST_KINDS:
                self._orders.clear()
            whole = all(joint in names for joint in self._wanted)
            self._orders[names] = np.array([names.index(j) for j in self._wanted]) if whole else None
        return self._orders[names]

    def _lacking(self, names: Sequence[str]) -> str:
        return ", ".join(joint for joint in self._wanted if joint not in names)

    def _pass_over(self, remark: str) -> None:
        self.passed_over += 1
        self._remark(remark)

    def _remark(self, text: str) -> None:
        if text in self._remarks or len(self._remarks) < _MOST_KINDS:
            self._remarks[text] += 1

    def _take(
        self, values: Any, order: NDArray[np.intp], names: tuple[str, ...], field: str
    ) -> NDArray[np.float64] | None:
        array = np.asarray(values, dtype=np.float64)
        if not array.size:
            return None
        if array.size != len(names):
            raise UserError(
                f"{self._where}: {array.size} {field} values for {len(names)} joints; "
                f"the driver must fill in the {field} of every joint, or of none"
            )
        taken: NDArray[np.float64] = array[order]
        return taken

    def _differentiate(
        self, last: tuple[int, NDArray[np.float64]] | None, now_ns: int, position: NDArray[np.float64]
    ) -> JointSample | None:
        """Position with the velocity since the last one; None if there is none, or it is not older."""
        self._remark("no velocities; they are taken from positions and stamps")
        if last is None or now_ns <= last[0]:
            return None
        spacing_s = (now_ns - last[0]) / NANOSECONDS
        if spacing_s > SPARSEST_S:
            raise UserError(
                f"{self._where}: no velocities, and positions {spacing_s:.3g} s apart are too sparse to take "
                f"them from; publish at {1 / SPARSEST_S:.0f} Hz or more, or fill in the field velocity"
            )
        self.derived += 1
        return JointSample(position, (position - last[1]) / spacing_s)


def _require_finite(values: NDArray[np.float64], joints: Sequence[str], what: str) -> None:
    wrong = np.flatnonzero(~np.isfinite(values))
    if wrong.size:
        raise UserError(f"{what} of joint {joints[int(wrong[0])]} is not finite; check the driver")


def _listed(names: Sequence[str]) -> str:
    """Names from elsewhere, as a part of one line."""
    text = ", ".join(name if name.isprintable() else repr(name) for name in names[:_MOST_KINDS])
    return (text if len(text) <= _MOST_LETTERS else f"{text[:_MOST_LETTERS]}...") or "no joints"

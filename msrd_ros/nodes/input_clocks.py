"""Whether joint states and ball samples are of now: by their stamps and, in real time, by their arrival.

Nothing is known of the clocks behind the stamps but that they must agree with each other and go forward.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

from msrd_ros.contract.translation import NANOSECONDS

LEAP_S = 1.0
"""A stamp further ahead than the time that has passed, by this, leaps."""
CONVINCING = 5
"""So many joint states in a row that follow each other tell that their clock has been set."""


class Order(Enum):
    """How a joint state's stamp follows the last one's."""

    NEW = "new"
    AGAIN = "the same stamp again"
    LATE = "a stamp that is older than the last"
    LEAPT = "a stamp that does not follow"
    SET = "another time"


@dataclass
class _Heard:
    """The newest message of a topic: its stamp, when it came in, and when its stamp was new, in s."""

    stamp_ns: int
    came_s: float
    changed_s: float


class InputClocks:
    """Compares the stamps of joint states and ball samples with each other and with their arrival.

    In lockstep the world waits for answers, so that arrival tells nothing, and a stamp that goes back is of a
    world that was started again. In real time a single stamp that does not follow is a mistake of its sender.

    Parameters
    ----------
    real_time
        Whether to judge by arrival, too.
    timeout_s
        Gives the age in s beyond which an input is stale.
    """

    def __init__(self, real_time: bool, timeout_s: Callable[[], float]) -> None:
        self._real_time, self._timeout_s = real_time, timeout_s
        self._joints: _Heard | None = None
        self._leapt: _Heard | None = None
        self._followers = 0
        self._ball: _Heard | None = None
        self._faults: dict[str, str] = {}

    @property
    def fault(self) -> str:
        """What is wrong with the stamps, in the same words as long as it lasts; empty if nothing is."""
        return "; ".join(self._faults.values())

    def joints(self, stamp_ns: int, now_s: float) -> Order:
        """Take the stamp of a joint state that came in now."""
        last = self._joints
        if last is None:
            order = Order.NEW
        elif stamp_ns == last.stamp_ns:
            order = Order.AGAIN
        elif self._real_time:
            order = self._follows(last, stamp_ns, now_s)
        else:
            order = Order.NEW if stamp_ns > last.stamp_ns else Order.SET
        stands = order is Order.AGAIN and last is not None and now_s - last.changed_s > self._timeout_s()
        self._say("stands", "stamps of joint_states stand still", self._real_time and stands)
        self._say("leap", "stamps of joint_states leap", order is Order.LEAPT)
        if order in (Order.NEW, Order.SET):
            self._joints = _Heard(stamp_ns, now_s, now_s)
            self._leapt, self._followers = None, 0
        return order

    def ball(self, stamp_ns: int, now_s: float) -> None:
        """Take the stamp of a ball sample that came in now."""
        same = self._ball is not None and self._ball.stamp_ns == stamp_ns
        changed_s = self._ball.changed_s if same and self._ball is not None else now_s
        self._ball = _Heard(stamp_ns, now_s, changed_s)

    def ball_agrees(self) -> bool:
        """Whether the newest ball sample's clock is that of the newest joint state; says what is wrong."""
        if self._ball is None or self._joints is None:
            return False
        ahead_s = (self._ball.stamp_ns - self._joints.stamp_ns) / NANOSECONDS
        stands = (
            self._real_time and self._ball.came_s - self._ball.changed_s > self._timeout_s() and ahead_s < 0.0
        )
        self._say("ball stands", "stamps of ball/position stand still", stands)
        for kind, words, off in (
            ("ahead", "ahead of", ahead_s > self._timeout_s()),
            ("behind", "behind", ahead_s < -self._timeout_s() and not self._silent and not stands),
        ):
            text = f"stamps of ball/position are {abs(ahead_s):.4g} s {words} those of joint_states"
            self._say(kind, f"{text}: let both machines keep the same time, or raise stale_timeout_s", off)
        return abs(ahead_s) <= self._timeout_s()

    def age_s(self, stamp_ns: int, came_s: float, now_s: float) -> float:
        """How old a ball sample is, by its stamp or, in real time, by its arrival if that is longer ago."""
        assert self._joints is not None
        by_stamp_s = (self._joints.stamp_ns - stamp_ns) / NANOSECONDS
        return max(by_stamp_s, now_s - came_s) if self._real_time else by_stamp_s

    @property
    def _silent(self) -> bool:
        """Whether no ball sample comes any more: its last stamp then falls behind by itself."""
        assert self._ball is not None
        assert self._joints is not None
        return self._real_time and self._joints.came_s - self._ball.came_s > 0.5 * self._timeout_s()

    def _follows(self, last: _Heard, stamp_ns: int, now_s: float) -> Order:
        if self._goes_on(last, stamp_ns, now_s):
            return Order.NEW if stamp_ns > last.stamp_ns else Order.LATE
        leapt, self._leapt = self._leapt, _Heard(stamp_ns, now_s, now_s)
        goes_on = leapt is not None and stamp_ns > leapt.stamp_ns and self._goes_on(leapt, stamp_ns, now_s)
        self._followers = self._followers + 1 if goes_on else 1
        return Order.SET if self._followers >= CONVINCING else Order.LEAPT

    def _goes_on(self, last: _Heard, stamp_ns: int, now_s: float) -> bool:
        change_s = (stamp_ns - last.stamp_ns) / NANOSECONDS
        return -self._timeout_s() <= change_s <= now_s - last.came_s + LEAP_S

    def _say(self, kind: str, text: str, wrong: bool) -> None:
        if not wrong:
            self._faults.pop(kind, None)
        else:
            # The numbers of the first time: it is the same fault as long as it lasts.
            self._faults.setdefault(kind, text)

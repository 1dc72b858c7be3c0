"""What leading a stroke by the hand is about: what the hand does, where it stands, and how it went."""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple, Protocol

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from numpy.typing import NDArray

from msrd_ros.contract.outcome import Outcome
from msrd_ros.core.errors import UserError
from msrd_ros.table_tennis.simulation.hand_gesture import HandGesture

Array = NDArray[np.float64]


class LedStroke(Protocol):
    """What somebody's hand does during one stroke; `GuidedStroke` is one."""

    @property
    def ready_posture(self) -> Array:
        """Joint angles (N,) in rad that the stroke starts from."""

    def see(self, stamp_s: float, position: Array) -> None:
        """Take in the camera's newest sample of the ball, (3,) in m."""

    def hand_at(self, time_s: float, joint_position: Array) -> HandGesture | None:
        """Where the hand leads the paddle now, joints being at (N,) rad; None once it has let go."""


class Stage(Enum):
    """Where the stroke stands."""

    CALLING = "waiting for a service"
    MOVING = "moving to the ready pose"
    SHOWING = "leading the paddle"
    JUDGING = "waiting for the recorder's verdict"
    RESTING = "coming to rest"
    OVER = "not leading"


class Kept(NamedTuple):
    """What the recorder says of a stroke: whether it is kept, why not, and where its bag is."""

    kept: bool
    reason: str = ""
    detail: str = ""
    path: str = ""


class Led(NamedTuple):
    """How a stroke went.

    Attributes
    ----------
    outcome
        Of its ball.
    recorded
        The recorder's verdict; None where none is awaited.
    peak_speed
        Of the joints, as a share of their limits.
    """

    outcome: Outcome
    recorded: Kept | None
    peak_speed: float


def read_verdicts(message: DiagnosticArray) -> dict[int, Kept]:
    """The recorder's verdicts by ball.

    Raises
    ------
    UserError
        If one is malformed.
    """
    found = {}
    for item in message.status:
        values = {pair.key: pair.value for pair in item.values}
        try:
            found[int(values["ball_id"])] = Kept(
                values["kept"] == "true",
                values["reason"],
                values.get("detail", ""),
                values.get("path", ""),
            )
        except (KeyError, ValueError):
            raise UserError("topic recorder/verdict: a verdict is malformed; it is passed over") from None
    return found

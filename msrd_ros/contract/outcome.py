"""What became of one ball: the referee's decision, as it travels on `rally/outcome` and into bags."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

from msrd_ros.core.errors import UserError

RETURNED = "returned"
"""The message of a ball that came back; every other message is a `MissReason`."""


class MissReason(StrEnum):
    """Why a ball does not count as returned."""

    MISSED = "missed"
    """Never touched by the paddle, and on the floor."""
    DOUBLE_BOUNCE = "double_bounce"
    """Bounced twice on the robot's half before the paddle touched it."""
    VOLLEY = "volley"
    """Touched by the paddle before it had bounced on the robot's half."""
    DOUBLE_HIT = "double_hit"
    """Touched by the paddle twice."""
    NET = "net"
    """Struck into the net, and down without reaching the far half."""
    OWN_HALF = "own_half"
    """Struck, and down on the robot's side of the net: on its half of the table or beside it."""
    LONG = "long"
    """Struck past the far end line."""
    WIDE = "wide"
    """Struck past a side line of the far half."""
    BAD_FEED = "bad_feed"
    """The feeder's fault: never bounced on the robot's half, and never touched."""
    UNDECIDED = "undecided"
    """Still in play when the rally was cut off."""


@dataclass(frozen=True)
class Outcome:
    """One ball, from launch to decision. Times count from the launch; world frame.

    A ball is returned exactly when there is no `miss_reason`: struck, and its next bounce on the table
    was on the far half. Numbers of things that did not happen are NaN.

    Parameters
    ----------
    ball_id
        Which ball, counted from the simulator's start.
    struck
        Whether the paddle touched it.
    miss_reason
        Why it was not returned, or None.
    hit_time_s, decision_time_s
        When the paddle touched it first, and when the referee decided.
    landing_x_m, landing_y_m
        The first bounce on the far half after the hit.
    spin_x_rad_s, spin_y_rad_s, spin_z_rad_s
        Right after the first touch of the paddle; positive y makes a ball that flies forward dip.
    velocity_x_m_s, velocity_y_m_s, velocity_z_m_s
        Right after the first touch of the paddle.
    net_touched
        Whether it touched the net after the hit.
    """

    ball_id: int
    struck: bool
    miss_reason: MissReason | None
    hit_time_s: float = math.nan
    decision_time_s: float = math.nan
    landing_x_m: float = math.nan
    landing_y_m: float = math.nan
    spin_x_rad_s: float = math.nan
    spin_y_rad_s: float = math.nan
    spin_z_rad_s: float = math.nan
    velocity_x_m_s: float = math.nan
    velocity_y_m_s: float = math.nan
    velocity_z_m_s: float = math.nan
    net_touched: bool = False

    @property
    def returned(self) -> bool:
        """Whether the ball came back onto the far half."""
        return self.miss_reason is None

    @property
    def message(self) -> str:
        """``returned`` or the reason why not."""
        return RETURNED if self.miss_reason is None else str(self.miss_reason)

    def to_values(self) -> dict[str, str]:
        """Everything but the message as text, keys in a fixed order; numbers read back exactly."""
        return {
            "ball_id": str(self.ball_id),
            "struck": _flag_to_text(self.struck),
            "returned": _flag_to_text(self.returned),
            "net_touched": _flag_to_text(self.net_touched),
            **{name: repr(float(getattr(self, name))) for name in NUMBER_NAMES},
        }

    @classmethod
    def from_values(cls, message: str, values: Mapping[str, str], where: str = "rally/outcome") -> Outcome:
        """Read what `to_values` wrote.

        Parameters
        ----------
        message
            ``returned`` or a `MissReason`.
        values
            Text by key; unknown keys are passed over.
        where
            What to blame in the error, for example a topic or a bag's path.

        Raises
        ------
        UserError
            If the message or a value is not understood, or a key is missing.
        """
        try:
            reason = None if message == RETURNED else MissReason(message)
        except ValueError:
            known = ", ".join((RETURNED, *MissReason))
            raise UserError(f"{where}: unknown outcome {message!r}; use one of {known}") from None
        for key in ("ball_id", "struck", "returned", "net_touched", *NUMBER_NAMES):
            if key not in values:
                raise UserError(f"{where}: outcome lacks {key}; write all keys of an outcome")
        try:
            outcome = cls(
                ball_id=int(values["ball_id"]),
                struck=_flag_from_text(values["struck"]),
                miss_reason=reason,
                net_touched=_flag_from_text(values["net_touched"]),
                **{name: float(values[name]) for name in NUMBER_NAMES},
            )
            agrees = _flag_from_text(values["returned"]) == outcome.returned
        except ValueError as error:
            raise UserError(f"{where}: outcome is not readable: {error}") from None
        if not agrees:
            raise UserError(f"{where}: outcome says {message!r} but returned is {values['returned']!r}")
        return outcome


NUMBER_NAMES: tuple[str, ...] = (
    "hit_time_s",
    "decision_time_s",
    "landing_x_m",
    "landing_y_m",
    "spin_x_rad_s",
    "spin_y_rad_s",
    "spin_z_rad_s",
    "velocity_x_m_s",
    "velocity_y_m_s",
    "velocity_z_m_s",
)
"""The floating point fields of an `Outcome`, in the order in which they are written."""


def _flag_to_text(flag: bool) -> str:
    return "true" if flag else "false"


def _flag_from_text(text: str) -> bool:
    if text not in ("true", "false"):
        raise ValueError(f"expected true or false, got {text!r}")
    return text == "true"

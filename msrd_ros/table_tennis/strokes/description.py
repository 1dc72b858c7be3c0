"""What a strategy does with the ball, in words and numbers, by which a person recognises it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from msrd_ros.contract.episode import Episode
from msrd_ros.contract.outcome import Outcome
from msrd_ros.table_tennis.ball.scene import Table
from msrd_ros.table_tennis.strategies.table import Side, Strategies

_SPIN = ("spin_x_rad_s", "spin_y_rad_s", "spin_z_rad_s")
_VELOCITY = ("velocity_x_m_s", "velocity_y_m_s", "velocity_z_m_s")
_LANDING = ("landing_x_m", "landing_y_m")


class Spread(NamedTuple):
    """Mean and standard deviation over several balls; the deviation of one ball is 0."""

    mean: float
    sd: float

    def say(self, digits: int, sign: str = "") -> str:
        """For people, with so many digits after the point; the deviation only where there is one."""
        around = f" ± {self.sd:.{digits}f}" if self.sd else ""
        return f"{round(self.mean, digits) + 0.0:{sign}.{digits}f}{around}"  # + 0.0: there is no -0


@dataclass(frozen=True)
class Description:
    """What becomes of the balls that one strategy returns. What nobody has told is None.

    Attributes
    ----------
    side
        That the ball is hit on.
    fed, returned
        How many balls there were, and how many of them came back: the others tell of no stroke.
    spin_rad_s
        Right after the hit, about x, y and z of `world`; positive about y is topspin.
    speed_m_s
        Right after the hit.
    landing_m
        Where it bounces first on the far half: x beyond the net and y to the robot's left.
    """

    side: Side
    fed: int
    returned: int
    spin_rad_s: tuple[Spread, ...] | None
    speed_m_s: Spread | None
    landing_m: tuple[Spread, ...] | None

    @classmethod
    def of(cls, side: Side, outcomes: Sequence[Outcome]) -> Description:
        """Describe a strategy by what a referee said of its balls.

        Parameters
        ----------
        side
            That its balls are hit on, such as `met_side` says.
        outcomes
            One per ball.
        """
        back = [outcome for outcome in outcomes if outcome.returned]
        speeds = _spreads(np.linalg.norm(_known(back, _VELOCITY), axis=1, keepdims=True))
        return cls(
            side,
            len(outcomes),
            len(back),
            _spreads(_known(back, _SPIN)),
            None if speeds is None else speeds[0],
            _spreads(_known(back, _LANDING)),
        )

    def __str__(self) -> str:
        """Words with their numbers, such as ``forehand, backspin (-105 ± 8 rad/s), lands ... left (...)``."""
        if not self.returned:
            return f"{self.side}, none of {self.fed} balls came back"
        said = [str(self.side)]
        if self.spin_rad_s is not None:
            _, about_y, about_z = self.spin_rad_s
            said.append(f"{spin_word(about_y.mean)} ({about_y.say(0, '+')} rad/s)")
            if abs(about_z.mean) > max(map(abs, _borders())):
                said.append(f"sidespin ({about_z.say(0, '+')} rad/s)")
        if self.speed_m_s is not None:
            said.append(f"{self.speed_m_s.say(1)} m/s")
        if self.landing_m is not None:
            beyond, across = self.landing_m
            said.append(f"lands {beyond.say(2)} m beyond the net")
            said.append(f"{landing_word(across.mean)} ({across.say(2, '+')} m)")
        return ", ".join(said)

    def to_json(self) -> dict[str, Any]:
        """All of it as plain data: `text` for people, `spin` and `lands` in a word, numbers as objects."""

        def plain(spreads: tuple[Spread, ...] | None) -> dict[str, list[float]] | None:
            if spreads is None:
                return None
            return {"mean": [one.mean for one in spreads], "sd": [one.sd for one in spreads]}

        return {
            "text": str(self),
            "side": self.side.value,
            "spin": None if self.spin_rad_s is None else spin_word(self.spin_rad_s[1].mean),
            "lands": None if self.landing_m is None else landing_word(self.landing_m[1].mean),
            "spin_rad_s": plain(self.spin_rad_s),
            "speed_m_s": None if self.speed_m_s is None else self.speed_m_s._asdict(),
            "landing_m": plain(self.landing_m),
        }


def met_side(episodes: Sequence[Episode]) -> Side:
    """The side on which strokes met the ball: by its mean y while it is nearest to the robot."""
    met_y = np.mean([e.ball_position[e.ball_position[:, 0].argmin(), 1] for e in episodes])
    return Side.at(float(met_y))


def spin_word(spin_y_rad_s: float) -> str:
    """Backspin, little spin or topspin, by the borders between the strategies that the package lists."""
    lowest, highest = _borders()
    return "backspin" if spin_y_rad_s < lowest else "topspin" if spin_y_rad_s > highest else "little spin"


def landing_word(y_m: float) -> str:
    """Left, middle or right third of the table, as the robot sees it."""
    third = Table().width_m / 6
    return "left" if y_m > third else "right" if y_m < -third else "middle"


def _borders() -> tuple[float, float]:
    borders = Strategies.shipped().spin_borders
    return borders[0], borders[-1]


def _known(outcomes: Sequence[Outcome], names: Sequence[str]) -> NDArray[np.float64]:
    """Some numbers of outcomes, (n, len(names)), of those that have them."""
    values: NDArray[np.float64] = np.array(
        [[getattr(one, name) for name in names] for one in outcomes]
    ).reshape(-1, len(names))
    return values[np.isfinite(values).all(axis=1)]


def _spreads(values: NDArray[np.float64]) -> tuple[Spread, ...] | None:
    """Of columns (n, K), K of them; None of no rows."""
    if not len(values):
        return None
    return tuple(Spread(float(column.mean()), float(column.std())) for column in values.T)

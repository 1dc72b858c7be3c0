"""A recorded stroke to scrub through."""

from __future__ import annotations

from typing import Any

import numpy as np

from msrd_ros.contract.episode import CONTROL_PERIOD_S, Episode
from msrd_ros.contract.labels import say_label
from msrd_ros.studio.scene import Picture

TRAIL_STEPS = 60


class Replay:
    """A recorded stroke, shown at any time of it.

    Parameters
    ----------
    episode, name
        The stroke, and how the page calls its bag.

    Attributes
    ----------
    time_s
        What is shown; it stays within the stroke.
    runs
        Whether time goes on by itself.
    """

    def __init__(self, episode: Episode, name: str) -> None:
        self._episode, self._name = episode, name
        self.time_s = 0.0
        self.runs = True

    @property
    def length_s(self) -> float:
        """From the ball's launch to the end."""
        return CONTROL_PERIOD_S * (len(self._episode.joint_position) - 1)

    def seek(self, time_s: float) -> None:
        """Show a time, and stay there."""
        self.time_s, self.runs = min(max(time_s, 0.0), self.length_s), False

    def advance(self, period_s: float) -> None:
        """Let time go on, if it runs; begin again at the end."""
        if self.runs:
            self.time_s = self.time_s + period_s if self.time_s < self.length_s else 0.0

    def picture(self) -> Picture:
        """What was to be seen at that time, between two samples on a straight line."""
        place = min(self.time_s, self.length_s) / CONTROL_PERIOD_S
        step = min(int(place), len(self._episode.joint_position) - 2)
        share = place - step
        joints, ball = (
            (1.0 - share) * values[step] + share * values[step + 1]
            for values in (self._episode.joint_position, self._episode.ball_position)
        )
        trail = np.vstack([self._episode.ball_position[max(step + 1 - TRAIL_STEPS, 0) : step + 1], ball])
        return Picture(joints, ball, trail, None)

    def state(self) -> dict[str, Any]:
        """What is told beside the picture."""
        outcome = self._episode.outcome
        return {
            "bag": self._name,
            "label": say_label(self._episode.label),
            "subject": self._episode.subject,
            "verdict": outcome.message if outcome else "",
            "time_s": round(self.time_s, 3),
            "length_s": round(self.length_s, 3),
            "runs": self.runs,
        }

"""Variations of one sketched stroke, recorded one after the other by a person's wish."""

from __future__ import annotations

from typing import Any

import numpy as np

from msrd_ros.nodes.led_stroke import Led
from msrd_ros.robots.robot import Robot
from msrd_ros.studio.task import FULL_SPEED, Task
from msrd_ros.table_tennis.ball.feeder import SPREADS, Feeder
from msrd_ros.table_tennis.teachers.sketch import Sketch
from msrd_ros.table_tennis.teachers.sketch_plan import SketchPlan, plan_variation
from msrd_ros.table_tennis.teachers.sketched_stroke import SketchedStroke


class Series:
    """Draws variations until enough are kept, or too many are not.

    Parameters
    ----------
    robot
        The arm that is led.
    sketch
        What is varied.
    base
        Bag that the variations come from; empty: the sketch has not been recorded.
    count
        How many shall be kept.
    spread
        Of the feeds.
    rng
        Draws feeds and variations.
    """

    def __init__(
        self, robot: Robot, sketch: Sketch, base: str, count: int, spread: str, rng: np.random.Generator
    ) -> None:
        self._robot, self._sketch, self._base, self._rng = robot, sketch, base, rng
        self._spread, self._feeder = SPREADS[spread], Feeder()
        self.wanted, self.kept, self.led, self.refused = count, 0, 0, 0

    @property
    def is_over(self) -> bool:
        """Whether enough are kept, or more than as many again were not."""
        return self.kept >= self.wanted or self.led >= 2 * self.wanted + 2

    def next(self) -> Task:
        """The next variation, of its own feed.

        Raises
        ------
        UserError
            If the arm can do none of some that were drawn.
        """
        plan = plan_variation(self._robot, self._sketch, self._rng, refused=self._refuse)
        feed = self._feeder.sample(self._sketch.side, self._spread, self._rng)
        note = f"sketched variation {self.led + 1} of {self._base or f'a sketch of {self._sketch.strategy}'}"
        stroke = SketchedStroke(self._robot, plan)
        return Task(self._sketch.strategy, stroke, feed, True, note, FULL_SPEED)

    def add(self, led: Led) -> None:
        """Enter how one went."""
        self.led += 1
        self.kept += led.recorded is not None and led.recorded.kept

    def told(self) -> dict[str, Any]:
        """How far it is, as JSON has it."""
        return {"wanted": self.wanted, "kept": self.kept, "led": self.led, "refused": self.refused}

    def _refuse(self, _: SketchPlan) -> None:
        self.refused += 1

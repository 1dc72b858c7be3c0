"""Plays planned strokes without a look at the ball, in the batched simulator."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from msrd_ros.contract.episode import ACTING_STEPS, CONTROL_PERIOD_S, FIRST_ACTING_STEP
from msrd_ros.robots.quintic import JointStroke
from msrd_ros.robots.robot import Robot
from msrd_ros.table_tennis.ball.feeder import NO_SPREAD, Feeder, FeedSpread
from msrd_ros.table_tennis.ball.scene import Scene
from msrd_ros.table_tennis.simulation.batched import (
    KinematicRallies,
    KinematicRalliesConfig,
    RallyPlan,
    RallyResults,
    RallyVariation,
)
from msrd_ros.table_tennis.strategies.paper import PaperLabel


def play_open_loop(
    robot: Robot,
    strokes: Mapping[PaperLabel, JointStroke],
    rng: np.random.Generator,
    *,
    rallies: int = 1,
    spread: FeedSpread = NO_SPREAD,
    scene: Scene | None = None,
    feeder: Feeder | None = None,
) -> RallyResults:
    """What becomes of balls against which strokes are played as they were planned.

    Parameters
    ----------
    robot
        Whose strokes, of N joints.
    strokes
        S of them; their labels say which side is fed.
    rng
        Draws the feeds.
    rallies, spread
        K balls for each stroke, and how they differ.
    scene, feeder
        The standard ones if None.

    Returns
    -------
    RallyResults
        Arrays (S, K), in the order of `strokes`.
    """
    config = KinematicRalliesConfig(
        scene or Scene(), feeder or Feeder(), RallyVariation(spread, 0.0, 0.0), threads=1, robot=robot
    )
    plans = [RallyPlan(label.side, stroke.start.position) for label, stroke in strokes.items()]
    batched = KinematicRallies(plans, config)
    batched.reset(len(plans), rallies, rng)
    ends_s = (FIRST_ACTING_STEP + 1.0 + np.arange(float(ACTING_STEPS))) * CONTROL_PERIOD_S
    rates = np.stack([stroke.sample(ends_s).velocity for stroke in strokes.values()])
    actions = rates / robot.limits.speed_rad_s
    batched.play(np.repeat(actions[:, None], rallies, axis=1))
    return batched.results()

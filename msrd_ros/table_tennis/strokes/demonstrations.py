"""Strokes as data sets: from episodes to what learning takes. Needs no simulator."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from msrd_ros.contract.episode import ACTING_STEPS, FIRST_ACTING_STEP, Episode
from msrd_ros.core.errors import UserError
from msrd_ros.learning.trajectories import Demonstrations
from msrd_ros.table_tennis.strategies.table import Strategies
from msrd_ros.table_tennis.strokes.policies import stroke_layout


def gather_demonstrations(episodes: Sequence[Episode], strategies: Strategies) -> Demonstrations:
    """Episodes as the datasets D(1)..D(N), in the order of `strategies`.

    Rows begin at `FIRST_ACTING_STEP`, where the policies begin to act.

    Raises
    ------
    UserError
        If there is no episode, or one has no label; names its source.
    """
    if not episodes:
        raise UserError("no demonstrations: record some, or give a folder of bags")
    by_label = {
        label: [episode for episode in episodes if episode.label == label]
        for label in strategies.sort(episode.strategy for episode in episodes)
    }
    most, robot = max(map(len, by_label.values())), episodes[0].robot
    horizon = len(episodes[0].joint_position) - 1 - FIRST_ACTING_STEP
    observations = np.zeros((len(by_label), most, horizon + 1, episodes[0].observations.shape[1]))
    actions = np.zeros((len(by_label), most, ACTING_STEPS, robot.joint_count))
    lengths = np.zeros((len(by_label), most), dtype=np.int64)
    for row, group in enumerate(by_label.values()):
        for column, episode in enumerate(group):
            observations[row, column] = episode.observations[FIRST_ACTING_STEP:]
            actions[row, column] = episode.actions[FIRST_ACTING_STEP : FIRST_ACTING_STEP + ACTING_STEPS]
            lengths[row, column] = horizon
    return Demonstrations(observations, actions, stroke_layout(robot, tuple(by_label)), lengths)

"""What the learned rewards say of strokes of people who were kept from training."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from torch import Tensor

from msrd_ros.contract.episode import FIRST_ACTING_STEP, Episode
from msrd_ros.core.errors import UserError
from msrd_ros.learning.rewards import RewardForm
from msrd_ros.studies.table_tennis.recording import StudyData
from msrd_ros.studies.table_tennis.statistics import diagonal_wins, friedman
from msrd_ros.studies.table_tennis.undone import undo_return
from msrd_ros.table_tennis.ball.camera import CameraConfig
from msrd_ros.table_tennis.strokes.training import StrokeTraining

UNDONE_STREAM = 0x0DD


def undone_pairs(data: StudyData, seed: int) -> list[tuple[Episode, Episode]]:
    """Every held-out stroke beside the same with its return undone."""
    rng = np.random.default_rng((UNDONE_STREAM, seed))
    noise_m = CameraConfig().noise_std_m
    pairs = []
    for episode in data.held_out:
        try:
            pairs.append((episode, undo_return(episode, noise_m, rng)))
        except UserError as error:
            raise UserError(f"{episode.source}: {error}") from None
    return pairs


def judge(
    training: StrokeTraining,
    rewards: dict[str, Tensor],
    data: StudyData,
    pairs: Sequence[tuple[Episode, Episode]],
) -> dict[str, Any]:
    """Matrix of strategy rewards, and the task reward of strokes with and without their return.

    Parameters
    ----------
    training
        Of the method; it takes up the rewards.
    rewards
        Weights of the method's averaged reward networks.
    pairs
        Of `undone_pairs`.

    Returns
    -------
    dict
        ``matrix`` (rows: rewards S_i, columns: strokes, rows scaled to [0, 1]), ``strategy_rewards`` (the
        names of its rows and columns), ``diagonal``, and ``undone`` with the mean reward a step of every
        pair. AIRL with one reward has no matrix; AIRL per strategy has no task reward, so that there each
        stroke's own reward is taken for it.
    """
    model = training.trainer.averaged_rewards
    model.load_state_dict(rewards)
    result: dict[str, Any] = {"matrix": None, "diagonal": None}
    if model.form is not RewardForm.TASK_ONLY:
        matrix = training.strategy_matrix(data.held_out)
        result |= {"matrix": matrix.tolist(), "diagonal": diagonal_wins(matrix)}
        result["strategy_rewards"] = list(training.reward_groups)
    values = np.zeros((len(pairs), 2))
    for column in range(2):
        seen = np.stack([pair[column].observations[FIRST_ACTING_STEP:] for pair in pairs])
        task, strategies = training.rewards_of(seen, 0)
        if model.form is RewardForm.STRATEGY_ONLY:
            own = [training.labels.index(pair[column].label) for pair in pairs]
            task = strategies[own, np.arange(len(pairs))]
        values[:, column] = task / (seen.shape[1] - 1)
    test = friedman(values)
    result["undone"] = {
        "real": values[:, 0].tolist(),
        "undone": values[:, 1].tolist(),
        "share_in_order": float((values[:, 0] > values[:, 1]).mean()),
        "friedman_chi2": test.statistic,
        "friedman_p": test.p,
    }
    return result

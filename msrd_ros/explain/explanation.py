"""What learned rewards say of one stroke: R0 and every S_i step by step, and whose stroke it is."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from msrd_ros.contract.episode import CONTROL_PERIOD_S, FIRST_ACTING_STEP, Episode
from msrd_ros.contract.labels import say_label
from msrd_ros.core.errors import UserError
from msrd_ros.learning.harness import CHECKPOINT_FILE
from msrd_ros.learning.layout import Layout
from msrd_ros.learning.learned import Learned
from msrd_ros.learning.rewards import RewardForm
from msrd_ros.recordings.paddle import paddle_poses
from msrd_ros.robots.loading import load_robot, shipped_robots
from msrd_ros.robots.robot import Robot
from msrd_ros.table_tennis.strokes.paddle_columns import PaddleColumns
from msrd_ros.table_tennis.strokes.policies import stroke_layout

Array = NDArray[np.float64]

FIRST_STEP = FIRST_ACTING_STEP + 1
"""Rewards look at the state that a step leads to: this is the first one that training has seen."""
UNCALIBRATED = 1.0
"""The temperature of sums of rewards as they are."""
_TEMPERATURES = np.geomspace(UNCALIBRATED, 1e4, 801)


@dataclass(frozen=True)
class Explanation:
    """One stroke as learned rewards see it. A step stands for the state that it leads to.

    Attributes
    ----------
    episode
        The stroke.
    labels
        The strategies that the rewards know, N of them.
    time_s
        Since the launch, shape (T,).
    ball, paddle
        Where the ball was seen and where the blade's centre was, shape (T, 3), m, in `world`.
    task
        R0, shape (T,), of no unit.
    strategy
        Every S_i, shape (T, N).
    evidence
        Sums of R_i - R0 (alpha_i S_i) over the stroke, shape (N,).
    hit_s
        When the paddle hit the ball, or would have: when they were nearest to each other.
    """

    episode: Episode
    labels: tuple[str, ...]
    time_s: Array
    ball: Array
    paddle: Array
    task: Array
    strategy: Array
    evidence: Array
    hit_s: float

    def posterior(self, temperature: float = UNCALIBRATED) -> Array:
        """Whose stroke it is: the softmax of `evidence` over `temperature`, shape (N,), 1 altogether.

        With maximum entropy a stroke of strategy i is as likely as exp(sum of R_i), but for a constant. R0 is
        in every R_i, which leaves this where all strategies count as equally likely a priori.

        Parameters
        ----------
        temperature
            By default the formula as it stands. It is not calibrated: the constants are left out, and T steps
            of one stroke count as if each were news, so that shares are much too near to 0 and 1 and only
            their order counts. `fit_temperature` finds one by which they are shares.
        """
        tempered = self.evidence / temperature
        likelihood = np.exp(tempered - tempered.max())
        return np.asarray(likelihood / likelihood.sum())

    @property
    def title(self) -> str:
        """What stroke it is, what became of it, and its R0: one line for people."""
        episode = self.episode
        who = f" of {episode.subject}" if episode.subject else ""
        became = "outcome not known" if episode.outcome is None else episode.outcome.message.replace("_", " ")
        return f"{say_label(episode.label)}{who}, {became}, R0 {self.mean_task:+.2f} a step"

    @property
    def mean_task(self) -> float:
        """R0 of an average step: what strokes are ranked by."""
        return float(self.task.mean())

    @property
    def struck(self) -> bool | None:
        """Whether the paddle touched the ball; None where no referee said so."""
        return None if self.episode.outcome is None else self.episode.outcome.struck


class Rank(NamedTuple):
    """How many of some returned strokes have a lower R0 than a stroke, and how many there are of them."""

    above: int
    of: int


def load_rewards(path: Path, robot: Robot) -> Learned:
    """The rewards of a run, for strokes of an arm.

    Parameters
    ----------
    path
        The folder of a trainer's run, its checkpoint, or a file of `Learned.save`.
    robot
        The arm whose strokes are to be explained.

    Raises
    ------
    UserError
        If the file cannot be read, holds no task and strategy rewards, or belongs to another arm or to other
        observations; names it.
    """
    file = path / CHECKPOINT_FILE if path.is_dir() else path
    learned = Learned.load(file)
    _require_columns(learned.layout, robot, str(file))
    if learned.rewards is None:
        raise UserError(
            f"{file}: holds policies and no trained rewards; give the {CHECKPOINT_FILE} of a run that learns "
            "some, such as method:=msrd"
        )
    if (
        learned.rewards.form in (RewardForm.TASK_ONLY, RewardForm.STRATEGY_ONLY)
        or learned.rewards.sees_action
    ):
        raise UserError(
            f"{file}: its rewards are not of states with R0 and S_i apart; train with method:=msrd or "
            "vanilla_distillation"
        )
    names = learned.layout.observation_names
    return replace(learned, rewards=learned.rewards.on(names, PaddleColumns(robot)))


def explain(learned: Learned, episode: Episode) -> Explanation:
    """Ask rewards of `load_rewards` about a stroke of the same arm."""
    seen = slice(FIRST_STEP, None)
    states, before = episode.observations[seen], episode.observations[FIRST_STEP - 1 : -1]
    task = learned.task_reward(states, before=before)
    time_s = CONTROL_PERIOD_S * np.arange(FIRST_STEP, len(episode.observations), dtype=np.float64)
    ball = episode.ball_position[seen]
    paddle = paddle_poses(episode.robot, episode.joint_position[seen]).place
    return Explanation(
        episode,
        learned.labels,
        time_s,
        ball,
        paddle,
        task,
        np.stack([learned.strategy_reward(name, states, before=before) for name in learned.labels], axis=1),
        np.array([(learned.reward(name, states, before=before) - task).sum() for name in learned.labels]),
        _hit_s(episode, time_s, ball, paddle),
    )


def rank(explained: Explanation, returned: Sequence[Explanation]) -> Rank:
    """Where a stroke stands among returned ones by its mean R0."""
    return Rank(sum(other.mean_task < explained.mean_task for other in returned), len(returned))


def fit_temperature(labelled: Sequence[Explanation]) -> float:
    """The temperature by which the posteriors of labelled strokes are most likely to name their labels.

    One that training has not seen makes it honest: of its own demonstrations rewards are too sure. Strokes of
    strategies that the rewards do not know do not count.

    Raises
    ------
    UserError
        If none is left.
    """
    known = [one for one in labelled if say_label(one.episode.label) in one.labels]
    if not known:
        raise UserError("no stroke of a strategy that the rewards know; give others to calibrate with")
    own = [one.labels.index(one.episode.strategy) for one in known]
    evidence = np.stack([one.evidence for one in known])[:, :, None] / _TEMPERATURES
    evidence -= evidence.max(axis=1, keepdims=True)
    of_own = evidence[np.arange(len(known)), own]
    likelihood = (of_own - np.log(np.exp(evidence).sum(axis=1))).sum(axis=0)
    return float(_TEMPERATURES[likelihood.argmax()])


def _hit_s(episode: Episode, time_s: Array, ball: Array, paddle: Array) -> float:
    told_s = math.nan if episode.outcome is None else episode.outcome.hit_time_s
    if time_s[0] <= told_s <= time_s[-1]:  # NaN, of a ball that was not hit, is not
        return told_s
    return float(time_s[np.linalg.norm(ball - paddle, axis=1).argmin()])


def _require_columns(layout: Layout, robot: Robot, where: str) -> None:
    """Refuse rewards of another arm by its name, and those of other observations by their columns."""
    seen = layout.observation_names
    if seen == stroke_layout(robot).observation_names:
        layout.require(stroke_layout(robot), where)
        return
    for name in shipped_robots():
        if seen == stroke_layout(load_robot(name)).observation_names:
            raise UserError(f"{where}: is of the robot {name}, not {robot.name}; say robot:={name}")
    layout.require(stroke_layout(robot), where)

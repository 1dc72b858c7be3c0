"""The methods compared: each learns from the same recordings, and each can be played.

What they share is the recipe of `strokes.training`: networks, cloning, simulator, rollouts, trust region and
iterations; every method changes only what its name says.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from torch import Tensor

from msrd_ros.learning.config import MSRDConfig
from msrd_ros.learning.harness import Harness, Schedule
from msrd_ros.learning.method import Method
from msrd_ros.learning.methods.airl import AirlEach, AirlEachCross
from msrd_ros.learning.methods.frozen_reward import FrozenReward
from msrd_ros.learning.methods.msrd import Msrd, MsrdAsPrinted
from msrd_ros.learning.presets import as_printed
from msrd_ros.learning.rewards import RewardForm
from msrd_ros.studies.table_tennis.recording import StudyData
from msrd_ros.table_tennis.strategies.table import Strategies
from msrd_ros.table_tennis.strokes.frozen import lasting_rewards
from msrd_ros.table_tennis.strokes.policies import StrokePolicies
from msrd_ros.table_tennis.strokes.run import StrokeTask
from msrd_ros.table_tennis.strokes.training import (
    StrokeTraining,
    StrokeTrainingConfig,
    stroke_recipe,
)


class AirlSixPolicies(Method):
    """AIRL on all demonstrations: one reward of ball and joints for all six strokes.

    One policy for all would have to be told which stroke is asked for; it is told by being six networks,
    one for each label, all trained on the same reward.
    """

    name = "airl"
    title = "AIRL, one reward for all"

    def configure(self, config: MSRDConfig, strategies: int) -> MSRDConfig:
        """R_i = R0 without any terms of ours."""
        reward = replace(
            config.reward,
            form=RewardForm.TASK_ONLY,
            alpha=1.0,
            task_features=config.reward.strategy_features,
        )
        return replace(as_printed(config), reward=reward)


@dataclass(frozen=True)
class StrokeMethod:
    """A row of the table.

    Attributes
    ----------
    name, title
        As in names of files, and as the table calls it.
    learns
        The method of learning; None: nothing is learned, recorded motions are replayed.
    training
        Its own settings of `StrokeTrainingConfig`.
    is_cloned
        Whether cloning is all: there are no iterations, and rewards mean nothing.
    frozen_from
        Row whose rewards, refitted on replay, are frozen and optimised; None: rewards are its own.
    main
        In every table; the others say what single parts of the recipe do.
    """

    name: str
    title: str
    learns: Method | None = field(default_factory=Msrd)
    training: Mapping[str, Any] = field(default_factory=dict)
    is_cloned: bool = False
    frozen_from: str | None = None
    main: bool = False


_PLAIN = {"corrective_cloning": False, "spread": "standard"}
"""Where plain cloning is the start, as in the first version of the recipe."""

METHODS = {
    method.name: method
    for method in (
        StrokeMethod("msrd", "MSRD", main=True),
        StrokeMethod("behaviour_cloning", "behaviour cloning", training=_PLAIN, is_cloned=True, main=True),
        # With injected joint offsets: where all start that are not said to start from plain cloning.
        StrokeMethod(
            "cloning_with_noise", "cloning with corrective noise, no reward", is_cloned=True, main=True
        ),
        StrokeMethod("open_loop", "open-loop replay of demonstrations", learns=None, main=True),
        StrokeMethod("airl", AirlSixPolicies.title, AirlSixPolicies(), main=True),
        StrokeMethod("airl_each", AirlEach.title, AirlEach(), main=True),
        StrokeMethod(
            "frozen_reward",
            "plain cloning + frozen R0 + S_i",
            FrozenReward(),
            training=_PLAIN,
            frozen_from="msrd",
            main=True,
        ),
        StrokeMethod(
            "msrd_randomised",
            "MSRD, trained under worse conditions",
            training={"camera_noise_m": 0.003, "camera_latency_s": 0.02},
        ),
        StrokeMethod("msrd_plain_start", "MSRD from plain cloning", training=_PLAIN),
        StrokeMethod("msrd_as_printed", "MSRD, the paper's loss only", MsrdAsPrinted()),
        StrokeMethod("airl_each_cross", "AIRL per strategy + cross-negatives", AirlEachCross()),
        StrokeMethod(
            "msrd_per_stroke",
            "MSRD, forehand and backhand share a strategy reward",
            training={"strategy_rewards": "stroke"},
        ),
    )
}
MAIN_METHODS = tuple(name for name, method in METHODS.items() if method.main)
SUPPLEMENT = tuple(name for name, method in METHODS.items() if not method.main)


@dataclass(frozen=True)
class Budget:
    """What every method may use.

    Attributes
    ----------
    iterations, episodes
        Iterations over all strategies, and rollouts per strategy in each.
    plain_iterations
        Those of methods that start from plain cloning, which have farther to go.
    plain_cloning_steps
        Adam steps of plain cloning. Cloning is a rival here, so it gets what is best for it: with 24
        demonstrations a label 2000 steps returned 86 % in evaluations, the recipe's 500 steps 76 %.
    cloning_steps
        Of all cloning, if given.
    evaluate_every, evaluation_balls
        Iterations between points of the curve, and balls per strategy for each point.
    """

    iterations: int = 30
    plain_iterations: int = 60
    episodes: int = 200
    plain_cloning_steps: int = 2000
    cloning_steps: int | None = None
    evaluate_every: int = 10
    evaluation_balls: int = 200


@dataclass(frozen=True)
class Learned:
    """What a method made of the recordings.

    Attributes
    ----------
    policies
        Ready to play.
    rewards
        Weights of the averaged reward networks; empty if it has none.
    lasting
        Those of MSRD's rewards refitted on replay, to be frozen; empty for all others.
    report
        ``curve`` (struck and returned shares in the batched simulator), ``seconds``, ``cpu_seconds``,
        ``env_steps``.
    """

    policies: StrokePolicies
    rewards: dict[str, Tensor]
    lasting: dict[str, Tensor]
    report: dict[str, Any]


def settings_of(method: StrokeMethod, budget: Budget, seed: int) -> StrokeTrainingConfig:
    """Settings of a method's training run."""
    settings = StrokeTrainingConfig(
        iterations=0 if method.is_cloned else budget.iterations,
        episodes=budget.episodes,
        seed=seed,
        threads=1,
        cloning_steps=budget.cloning_steps,
        **method.training,
    )
    if settings.corrective_cloning:
        return settings
    return replace(
        settings,
        iterations=0 if method.is_cloned else budget.plain_iterations,
        cloning_steps=budget.cloning_steps or budget.plain_cloning_steps,
    )


def make_training(method: StrokeMethod, data: StudyData, budget: Budget, seed: int) -> StrokeTraining:
    """The training run of a method, before its first step."""
    settings = settings_of(method, budget, seed)
    return StrokeTraining(data.training, data.landing_points, settings, method=method.learns)


def run_settings(method: StrokeMethod, data: StudyData, budget: Budget) -> dict[str, Any]:
    """Everything that a run depends on beside recordings and seed, as data for JSON."""
    settings = settings_of(method, budget, 0)
    labels = Strategies.shipped().sort(episode.strategy for episode in data.training)
    recipe = stroke_recipe(settings, labels, data.training[0].robot)
    return {"name": method.name, "recipe": recipe.to_dict(), "training": asdict(settings)}


def learn(
    method: StrokeMethod,
    data: StudyData,
    budget: Budget,
    seed: int,
    frozen: dict[str, Tensor] | None = None,
) -> Learned:
    """Run a method.

    Parameters
    ----------
    frozen
        The weights of the rewards of `StrokeMethod.frozen_from`, refitted on replay.
    """
    training = make_training(method, data, budget, seed)
    trainer = training.trainer
    if frozen is not None:
        trainer.averaged_rewards.load_state_dict(frozen)
    task = StrokeTask(training, budget.evaluation_balls)
    harness = Harness(trainer, task, Schedule(budget.evaluate_every))
    harness.run()
    report = {
        "curve": harness.curve,
        "seconds": harness.seconds,
        "cpu_seconds": harness.cpu_seconds,
        "env_steps": trainer.environment_steps,
    }
    has_rewards = not method.is_cloned and method.frozen_from is None
    rewards = dict(trainer.averaged_rewards.state_dict()) if has_rewards else {}
    lasting = {}
    if method.name in {other.frozen_from for other in METHODS.values()}:
        refitted = lasting_rewards(training)
        assert refitted is not None
        lasting = dict(refitted.state_dict())
    return Learned(training.policies(), rewards, lasting, report)

"""The methods behind their one interface."""

from __future__ import annotations

import copy
from dataclasses import replace

import pytest
import torch

from learning_problems import PointMass, point_demonstrations
from msrd_ros.core.errors import UserError
from msrd_ros.learning.cloning import CloningConfig
from msrd_ros.learning.config import DiscriminatorConfig, MSRDConfig
from msrd_ros.learning.method import Learner, Method, Problem
from msrd_ros.learning.methods import METHODS, find_method
from msrd_ros.learning.rewards import RewardForm
from msrd_ros.learning.rollouts import BatchedCollector

CONFIG = MSRDConfig(
    iterations=2,
    episodes=2,
    discriminator=DiscriminatorConfig(
        batch=16, cross_weight=1.0, cross_batch=16, gradient_penalty=0.1, task_penalty_weight=0.1
    ),
    cloning=CloningConfig(steps=5, batch=16, snapshots=(0,)),
)


def start(method: str | Method) -> Learner:
    """A run on three strategies of a point that is pushed."""
    collector = BatchedCollector(PointMass())
    return find_method(method).start(Problem(CONFIG, point_demonstrations(), collector, seed=0))


@pytest.mark.parametrize("name", METHODS)
def test_every_method_runs_and_goes_on_exactly(name: str) -> None:
    runs = [start(name) for _ in range(2)]
    runs[0].clone()
    for _ in range(runs[0].config.iterations):
        runs[1].load_state_dict(copy.deepcopy(runs[0].state_dict()))
        runs[0].iterate()
        runs[1].iterate()
    assert runs[0].iterations_done == runs[0].config.iterations
    if runs[0].config.iterations:
        weights = (run.averaged_rewards.state_dict() for run in runs)
        for first, second in zip(*(table.values() for table in weights), strict=True):
            assert torch.equal(first, second)


@pytest.mark.parametrize(
    ("name", "form", "policies"),
    [
        ("msrd", RewardForm.TWO_COLUMN, 3),
        ("msrd_as_printed", RewardForm.TWO_COLUMN, 3),
        ("vanilla_distillation", RewardForm.VANILLA, 3),
        ("airl", RewardForm.TASK_ONLY, 1),
        ("airl_each", RewardForm.STRATEGY_ONLY, 3),
        ("airl_each_cross", RewardForm.STRATEGY_ONLY, 3),
    ],
)
def test_the_forms_of_the_rewards(name: str, form: RewardForm, policies: int) -> None:
    learner = start(name)
    assert learner.averaged_rewards.form is form
    assert learner.policies.strategies == policies


@pytest.mark.parametrize("name", ["msrd_as_printed", "airl_each"])
def test_the_papers_methods_have_no_terms_of_ours(name: str) -> None:
    discriminator = start(name).config.discriminator
    assert discriminator.cross_weight == discriminator.gradient_penalty == 0.0
    assert discriminator.task_penalty_weight == 0.0


def test_airl_on_all_plays_as_much_as_the_others() -> None:
    pooled, each = start("airl"), start("airl_each")
    for learner in (pooled, each):
        learner.iterate()
    assert pooled.environment_steps == each.environment_steps


def test_cloning_plays_nothing() -> None:
    learner = start("cloning")
    learner.clone()
    assert learner.config.iterations == learner.environment_steps == 0


def test_a_method_of_ones_own_needs_no_entry() -> None:
    class Cautious(Method):
        """MSRD with short steps."""

        name, title = "cautious", "cautious MSRD"

        def configure(self, config: MSRDConfig, strategies: int) -> MSRDConfig:
            return replace(config, trust_region=replace(config.trust_region, kl=1e-4))

    assert start(Cautious()).config.trust_region.kl == 1e-4


def test_an_unknown_method_is_refused() -> None:
    with pytest.raises(UserError, match=r"method 'gail' is unknown; use one of msrd, msrd_as_printed"):
        find_method("gail")

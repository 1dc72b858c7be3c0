"""MSRD and AIRL as wholes: known rewards recovered, runs repeated bit for bit, every option alive."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch

from learning_problems import (
    CELLS,
    DISCOUNT,
    GridWorld,
    PointMass,
    grid_demonstrations,
    point_demonstrations,
    soft_optimal,
    true_rewards,
)
from msrd_ros.learning.baselines import StrategyClassifier, SupervisedRewards
from msrd_ros.learning.categorical import CategoricalPolicies
from msrd_ros.learning.cloning import CloningConfig
from msrd_ros.learning.config import (
    DiscriminatorConfig,
    FeatureConfig,
    MSRDConfig,
    PolicyConfig,
    PolicyReward,
    RefitConfig,
    ReplayConfig,
    RewardConfig,
    TaskUpdate,
)
from msrd_ros.learning.discriminator import Penalty
from msrd_ros.learning.method import Problem
from msrd_ros.learning.methods import find_method
from msrd_ros.learning.msrd import MSRD
from msrd_ros.learning.policies import Policies
from msrd_ros.learning.presets import as_printed
from msrd_ros.learning.replay import DemonstrationPool
from msrd_ros.learning.rewards import RewardForm
from msrd_ros.learning.rollouts import BatchedCollector
from msrd_ros.learning.trajectories import Rollouts, Transitions
from msrd_ros.learning.trpo import TrustRegionConfig
from msrd_ros.learning.value import ValueConfig
from msrd_ros.studies.inverted_pendulum.presets import inverted_pendulum
from msrd_ros.table_tennis.strokes.presets import table_tennis

BASE = MSRDConfig(iterations=3, discriminator=DiscriminatorConfig(steps=3, batch=32, cross_batch=16))


def run(config: MSRDConfig, seed: int = 0, iterations: int = 2, clone: bool = False) -> MSRD:
    trainer = MSRD(config, point_demonstrations(), BatchedCollector(PointMass()), seed)
    if clone:
        trainer.clone()
    for _ in range(iterations):
        metrics = trainer.iterate()
    assert all(np.isfinite(value) for value in metrics.values())
    return trainer


def test_same_seed_same_numbers_other_seed_other_numbers() -> None:
    config = replace(
        BASE,
        replay=ReplayConfig(replay_share=0.3, snapshot_share=0.2),
        cloning=CloningConfig(steps=20, snapshots=(0,), noise_levels=(0.5,)),
        discriminator=replace(BASE.discriminator, cross_weight=0.3, gradient_penalty=0.01),
    )
    first, second, third = (run(config, seed, clone=True) for seed in (1, 1, 2))
    for name, value in first.rewards.state_dict().items():
        assert torch.equal(value, second.rewards.state_dict()[name]), name
    assert torch.equal(first.policies.flat(), second.policies.flat())
    assert not torch.equal(first.policies.flat(), third.policies.flat())


class Counting:
    """A collector that counts its steps."""

    def __init__(self) -> None:
        self.inside = BatchedCollector(PointMass())
        self.steps = 0

    def collect(self, policies: Policies, episodes: int, rng: np.random.Generator) -> Rollouts:
        rollouts = self.inside.collect(policies, episodes, rng)
        self.steps += rollouts.observations[:, :, 1:, 0].size
        return rollouts


@pytest.mark.parametrize("method", ["msrd", "airl", "airl_each_cross"])
def test_restarts_are_played_where_episodes_start_again_and_serve_as_bad_examples(method: str) -> None:
    cloning = CloningConfig(steps=5, noise_levels=(1.0,), restarts=(1.0, 3.0), snapshot_episodes=2)
    config = replace(BASE, cloning=cloning, replay=ReplayConfig(snapshot_share=0.5))
    collector, autoreset = Counting(), Counting()
    with pytest.raises(ValueError, match="pass autoreset"):
        find_method(method).start(Problem(config, point_demonstrations(), collector, 0))
    trainer = find_method(method).start(
        Problem(config, point_demonstrations(), collector, 0, autoreset=autoreset)
    )
    trainer.clone()
    assert autoreset.steps == 2 * collector.steps > 0
    assert trainer.environment_steps == collector.steps + autoreset.steps
    assert trainer.state_dict()["snapshots"].shape[:2].numel() == trainer.environment_steps
    trainer.iterate()
    assert autoreset.steps + collector.steps == trainer.environment_steps


@pytest.mark.parametrize(
    "changes",
    [
        {"penalty": Penalty.NORM, "penalty_weight": None},
        {"task_update": TaskUpdate.SEQUENTIAL},
        {"cross_weight": 0.3, "penalise_all": True, "gradient_penalty": 0.1},
        {"task_gradient_penalty": 0.1},
        {"penalty_above": 5.0},
        {"cross_weight": 0.3, "cross_reaches_task": False, "cross_demonstrations": 1.0},
        {"uses_log_prob": False, "demonstrations_per_iteration": 2},
        {"centre_log_prob": True, "first_steps": 4},
    ],
    ids=lambda changes: "+".join(changes),
)
def test_options_of_the_discriminator(changes: dict[str, Any]) -> None:
    plain = run(BASE)
    other = run(replace(BASE, discriminator=replace(BASE.discriminator, **changes)))
    assert not torch.equal(plain.rewards.task_network.flat(), other.rewards.task_network.flat())


@pytest.mark.parametrize(
    "config",
    [
        replace(BASE, reward=RewardConfig(nearness=1.0)),
        replace(BASE, replay=ReplayConfig(displaced_share=0.4)),
    ],
    ids=["nearness", "displaced_share"],
)
def test_what_r0_knows_of_places_that_nobody_shows_can_be_left_out(config: MSRDConfig) -> None:
    plain, other, printed = run(BASE), run(config), run(as_printed(config))
    assert not torch.equal(plain.rewards.task_network.flat(), other.rewards.task_network.flat())
    assert torch.equal(plain.rewards.task_network.flat(), printed.rewards.task_network.flat())


def test_r0_falls_away_from_the_demonstrations_in_every_direction() -> None:
    """Of a network alone nobody knows what it says where neither demonstrations nor rollouts go."""
    config = replace(BASE, reward=RewardConfig(nearness=1.0), replay=ReplayConfig(displaced_share=0.4))
    trainer = run(config, iterations=40)
    states = trainer._demonstrations.states()
    angle = torch.linspace(0.0, 2.0 * np.pi, 33)[:-1]
    direction = torch.stack([angle.cos(), angle.sin()], dim=-1)
    rings = [states.mean(0) + size * states.std(0) * direction for size in (5.0, 20.0, 100.0)]
    features, model = trainer.rewards.task_features, trainer.rewards
    near = float(model.task(features(states[None])).detach().mean())
    values = [model.task(features(ring[None]))[0].detach() for ring in rings]
    assert float(values[0].max()) < near
    assert bool((values[1] < values[0]).all())
    assert bool((values[2] < values[1]).all())
    assert model.nearness is not None
    assert float(model.nearness.weight.detach()) != 1.0


def test_slope_penalty_of_the_task_reward_flattens_it_alone() -> None:
    def slope(weight: float) -> float:
        config = replace(BASE, discriminator=replace(BASE.discriminator, task_gradient_penalty=weight))
        states = torch.randn(1, 200, 2, generator=torch.Generator().manual_seed(0)).requires_grad_(True)
        model = run(config, iterations=20).rewards
        (gradient,) = torch.autograd.grad(model.task_network(states).sum(), states)
        return float(gradient.square().mean())

    assert slope(10.0) < 0.5 * slope(0.0)


@pytest.mark.parametrize("form", list(RewardForm))
def test_forms_train_what_they_use_and_nothing_else(form: RewardForm) -> None:
    config = replace(BASE, reward=RewardConfig(form=form, shaping=True, sees_action=True))
    start, end = run(config, iterations=1), run(config, iterations=2)
    task = torch.equal(start.rewards.task_network.flat(), end.rewards.task_network.flat())
    own = torch.equal(start.rewards.strategy_network.flat(), end.rewards.strategy_network.flat())
    assert task == (form is RewardForm.STRATEGY_ONLY)
    assert own == (form is RewardForm.TASK_ONLY)


def test_baselines_share_budget_and_interface() -> None:
    collector = BatchedCollector(PointMass())
    config = replace(BASE, cloning=CloningConfig(steps=5, snapshots=(0,)))
    problem = Problem(config, point_demonstrations(), collector, 0)
    trainers = [find_method(name).start(problem) for name in ("msrd", "airl", "airl_each_cross")]
    for trainer in trainers:
        trainer.clone()
        trainer.iterate()
    assert len({trainer.environment_steps for trainer in trainers}) == 1
    assert trainers[1].policies.strategies == 1


def test_presets_are_consistent() -> None:
    config = inverted_pendulum()
    assert config.discriminator.cross_weight > 0.0
    printed = as_printed(config).discriminator
    assert (printed.cross_weight, printed.penalise_all) == (0.0, False)
    assert (printed.gradient_penalty, printed.task_gradient_penalty, printed.penalty_above) == (0, 0, 1)
    strokes = table_tennis(("position",), ("speed",))
    strokes = replace(strokes, iterations=1, episodes=3, cloning=replace(strokes.cloning, steps=10))
    run(strokes, iterations=1, clone=True)


def test_msrd_moves_policies_and_tells_strategies_apart() -> None:
    """From random policies, without cloning: each strategy must find its own place by its reward."""
    config = MSRDConfig(
        iterations=60,
        episodes=10,
        discount=0.95,
        policy_reward=PolicyReward.REWARD,
        reward=RewardConfig(hidden=(16, 16)),
        discriminator=DiscriminatorConfig(
            steps=5, batch=128, learning_rate=5e-3, cross_weight=0.3, uses_log_prob=False
        ),
        trust_region=replace(BASE.trust_region, kl=0.05),
    )
    trainer = run(config, iterations=60)
    collector = BatchedCollector(PointMass())
    played = collector.collect(trainer.policies, 20, np.random.default_rng(1), deterministic=True)
    places = played.observations[:, :, -1, 0].mean(axis=1)
    np.testing.assert_allclose(places, [-1.0, 0.0, 1.0], atol=0.3)


@pytest.mark.slow
def test_known_rewards_of_a_grid_world_are_recovered() -> None:
    """Two soft-optimal demonstrators, tables for everything: R0, S_i and pi_i have known answers.

    With AIRL's potential the reward is identified up to a constant; the regulariser then settles what is
    shared and what is not, because the true S_i add up to zero.
    """
    one_hot = FeatureConfig(scales=(1.0,) * CELLS)
    config = MSRDConfig(
        iterations=100,
        episodes=80,
        discount=DISCOUNT,
        policy_reward=PolicyReward.LOGIT,
        reward=RewardConfig(hidden=(), task_features=one_hot, strategy_features=one_hot, shaping=True),
        discriminator=DiscriminatorConfig(
            batch=512, learning_rate=0.1, weight_decay=0.0, penalty_weight=0.03
        ),
        replay=ReplayConfig(keep=800, iterations=20, replay_share=0.5),
        policy=PolicyConfig(features=one_hot),
        trust_region=TrustRegionConfig(kl=0.03, damping=0.01, fisher_fraction=1.0),
        value=ValueConfig(hidden=(), learning_rate=0.03, sees_time=False, bootstrap=True),
    )
    data = grid_demonstrations()
    policies = CategoricalPolicies(2, one_hot.build(data), 5, (), torch.Generator().manual_seed(0))
    trainer = MSRD(config, data, BatchedCollector(GridWorld()), 0, policies)
    for _ in range(config.iterations):
        trainer.iterate()

    cells = torch.eye(CELLS).expand(2, -1, -1)
    packed = torch.cat([cells, torch.zeros(2, CELLS, 1), cells, torch.zeros(2, CELLS, 2)], dim=-1)
    found = trainer.averaged_rewards(Transitions(packed, CELLS, 1))
    task, own = true_rewards()
    assert np.corrcoef(found.task[0], task)[0, 1] > 0.93
    assert np.polyfit(task, found.task[0].numpy(), 1)[0] == pytest.approx(1.0, abs=0.25)
    for strategy in range(2):
        assert np.corrcoef(found.strategy[strategy], own[strategy])[0, 1] > 0.8
        assert np.polyfit(own[strategy], found.strategy[strategy].numpy(), 1)[0] == pytest.approx(
            1.0, abs=0.4
        )
    probs = policies.distribution(cells).log_probs.exp().detach().numpy()
    truth = np.stack([soft_optimal(task + preference) for preference in own])
    assert 0.5 * np.abs(probs - truth).sum(axis=-1).mean() < 0.12


def test_classifier_learns_which_strategy_a_state_belongs_to() -> None:
    data = point_demonstrations()
    generator = torch.Generator().manual_seed(0)
    classifier = StrategyClassifier(3, FeatureConfig().build(data), (16,), generator)
    assert classifier.fit(DemonstrationPool(data), steps=300, learning_rate=1e-2) < 0.7
    ends = torch.as_tensor(data.observations[:, :, -1], dtype=torch.float32).flatten(0, 1)
    posterior = classifier.log_posterior(ends)
    assert posterior.shape == (3, 18)
    torch.testing.assert_close(posterior.exp().sum(dim=0), torch.ones(18))
    assert (posterior.argmax(dim=0) == torch.arange(3).repeat_interleave(6)).all()


def test_supervised_rewards_are_the_truth_where_anybody_demonstrated() -> None:
    data = point_demonstrations()

    def truth(states: torch.Tensor) -> torch.Tensor:
        return torch.stack([2.0 * states[:, 0], -states[:, 0], states[:, 0].abs() - 3.0])

    features = FeatureConfig().build(data)
    taught = SupervisedRewards(3, features, (16,), torch.Generator().manual_seed(0))
    taught.fit(DemonstrationPool(data), truth, steps=1200)
    states = torch.as_tensor(data.observations[:, :, 1:], dtype=torch.float32).flatten(0, 2)
    for found, wanted in zip(taught.table(states), truth(states), strict=True):
        assert torch.corrcoef(torch.stack([found, wanted]))[0, 1] > 0.98
    beyond = taught.table(1e3 * states)
    low, high = taught.bounds
    assert low <= beyond.min()
    assert beyond.max() <= high


def test_rewards_refitted_on_replay_leave_the_run_as_it_is_and_need_a_past() -> None:
    config = replace(
        BASE,
        replay=ReplayConfig(replay_share=0.3, snapshot_share=0.2),
        cloning=CloningConfig(steps=5, snapshots=(0,)),
    )
    asked, silent = run(config, clone=True), run(config, clone=True)
    lasting, again = asked.refit_on_replay(RefitConfig(6)), asked.refit_on_replay(RefitConfig(6))
    assert torch.equal(lasting.task_network.flat(), again.task_network.flat())
    assert not torch.equal(lasting.task_network.flat(), asked.rewards.task_network.flat())
    assert not torch.equal(lasting.task_network.flat(), asked.averaged_rewards.task_network.flat())
    asked.iterate()
    silent.iterate()
    assert torch.equal(asked.policies.flat(), silent.policies.flat())
    assert torch.equal(asked.rewards.task_network.flat(), silent.rewards.task_network.flat())
    with pytest.raises(ValueError, match="replay"):
        run(BASE).refit_on_replay(RefitConfig(6))


def test_rewards_refitted_on_replay_tell_demonstrations_from_what_was_done_long_ago() -> None:
    config = replace(
        BASE,
        iterations=30,
        replay=ReplayConfig(replay_share=0.3, snapshot_share=0.2),
        cloning=CloningConfig(steps=40, snapshots=(0,)),
        discriminator=replace(BASE.discriminator, steps=10),
    )
    trainer = run(config, iterations=30, clone=True)
    past = trainer._snapshots
    assert past is not None
    demonstrated = trainer._demonstrations.sample(
        trainer._demonstrations.choose(None, trainer._generator), 500, trainer._generator
    )
    margins = [
        float((rewards(demonstrated).combined.mean() - rewards(past).combined.mean()).detach())
        for rewards in (trainer.averaged_rewards, trainer.refit_on_replay(RefitConfig(200)))
    ]
    assert margins[1] > margins[0]

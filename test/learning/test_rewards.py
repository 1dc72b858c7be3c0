"""Rewards and discriminator against the paper's formulas, written out."""

from __future__ import annotations

from typing import Any

import pytest
import torch

from msrd_ros.learning.discriminator import (
    Penalty,
    airl_loss,
    cross_negative_loss,
    discriminator_logit,
    distillation_loss,
    gradient_penalty,
    strategy_regulariser,
)
from msrd_ros.learning.networks import BatchedMLP, Features
from msrd_ros.learning.replay import of_others
from msrd_ros.learning.rewards import AveragedRewards, Nearness, RewardForm, RewardModel
from msrd_ros.learning.trajectories import Transitions


def model(form: RewardForm, **options: object) -> RewardModel:
    arguments: dict[str, Any] = {"alpha": (0.5, 1.0, 2.0), "action_width": 0, "hidden": (5, 5), **options}
    return RewardModel(
        form,
        3,
        Features((0,), (0.0,), (1.0,)),
        Features((0, 1), (0.0, 1.0), (1.0, 2.0)),
        generator=torch.Generator().manual_seed(0),
        **arguments,
    )


def transitions(count: int = 11) -> Transitions:
    generator = torch.Generator().manual_seed(1)
    packed = torch.randn(3, count, 2 * 2 + 1 + 2, generator=generator)
    return Transitions(packed, 2, 1)


def test_two_columns_add_up() -> None:
    rewards = model(RewardForm.TWO_COLUMN)
    values = rewards(transitions())
    alpha = torch.tensor([[0.5], [1.0], [2.0]])
    torch.testing.assert_close(values.combined, values.task + alpha * values.strategy)
    after = transitions().next_observation
    task = torch.stack([rewards.task_network(after[i : i + 1, :, :1])[0, :, 0] for i in range(3)])
    torch.testing.assert_close(values.task, task)
    scaled = (after - torch.tensor([0.0, 1.0])) / torch.tensor([1.0, 2.0])
    torch.testing.assert_close(values.strategy, rewards.strategy_network(scaled)[..., 0])


def test_nearness_is_added_to_the_task_reward_alone() -> None:
    near = Nearness.of(torch.tensor([[1.0], [3.0]]), 0.5)
    with_it, without = (model(RewardForm.TWO_COLUMN, nearness=each) for each in (near, None))
    away = (transitions().next_observation[..., 0] - 2.0) / 1.0
    expected = -0.5 * torch.log(1.0 + away.square())
    found, plain = with_it(transitions()), without(transitions())
    torch.testing.assert_close(found.task - plain.task, expected)
    torch.testing.assert_close(found.strategy, plain.strategy)
    assert Nearness.of(torch.zeros(2, 1), 0.0) is None


def test_a_column_that_never_moves_is_far_but_finite() -> None:
    near = Nearness.of(torch.tensor([[0.0, 5.0], [2.0, 5.0]]), 1.0)
    assert near is not None
    assert -20.0 < float(near(torch.tensor([1.0, 6.0])).detach()) < -10.0


def test_rewards_look_at_the_next_state_only() -> None:
    rewards = model(RewardForm.TWO_COLUMN)
    other = transitions()
    other.packed[..., :3] += 5.0
    assert torch.equal(rewards(transitions()).combined, rewards(other).combined)
    seeing = model(RewardForm.TWO_COLUMN, action_width=1)
    assert not torch.equal(seeing(transitions()).combined, seeing(other).combined)


def test_other_forms() -> None:
    for form in RewardForm:
        values = model(form)(transitions())
        if form is RewardForm.VANILLA:
            torch.testing.assert_close(values.strategy, values.combined - values.task)
        if form is RewardForm.TASK_ONLY:
            assert torch.equal(values.combined, values.task)
        if form is RewardForm.STRATEGY_ONLY:
            assert torch.equal(values.combined, values.strategy)
            assert not values.task.any()


def test_shaping_is_a_difference_of_potentials() -> None:
    rewards = model(RewardForm.TWO_COLUMN, shaping=True, discount=0.9)
    sample = transitions()
    network = rewards.potential_network
    assert isinstance(network, BatchedMLP)
    features = rewards.strategy_features
    expected = 0.9 * network(features(sample.next_observation)) - network(features(sample.observation))
    torch.testing.assert_close(rewards.shaping(sample), expected[..., 0])
    assert model(RewardForm.TWO_COLUMN).shaping(sample) == 0.0


def test_logit_is_that_of_the_papers_discriminator() -> None:
    generator = torch.Generator().manual_seed(0)
    reward = torch.randn(3, 20, dtype=torch.float64, generator=generator)
    log_prob = torch.randn(3, 20, dtype=torch.float64, generator=generator)
    discriminator = reward.exp() / (reward.exp() + log_prob.exp())
    logit = discriminator_logit(reward, log_prob)
    torch.testing.assert_close(torch.sigmoid(logit), discriminator)
    generated = logit.flip(1)
    expected = -discriminator.log().mean(dim=1) - (1.0 - discriminator.flip(1)).log().mean(dim=1)
    torch.testing.assert_close(airl_loss(logit, generated), expected)
    torch.testing.assert_close(cross_negative_loss(logit), -(1.0 - discriminator).log().mean(dim=1))


def test_loss_is_finite_far_from_the_decision_boundary() -> None:
    logit = torch.full((2, 3), 1e4)
    assert torch.isfinite(airl_loss(-logit, logit)).all()


def test_regulariser_norm_square_and_weight() -> None:
    strategy = torch.tensor([[1.0, -3.0], [0.5, 0.5]])
    torch.testing.assert_close(strategy_regulariser(strategy, Penalty.SQUARE), torch.tensor([5.0, 0.25]))
    torch.testing.assert_close(strategy_regulariser(strategy, Penalty.NORM), torch.tensor([2.0, 0.5]))
    above = strategy_regulariser(strategy, Penalty.SQUARE, above=3.0)
    torch.testing.assert_close(above, torch.tensor([(3.0 + 9.0) / 2.0, 0.75]))
    logit = torch.zeros(2, 4)
    with_weights = distillation_loss(logit, logit, strategy, torch.tensor([1.0, 2.0]), Penalty.SQUARE)
    expected = airl_loss(logit, logit) + torch.tensor([5.0, 0.5])
    torch.testing.assert_close(with_weights, expected)


def test_cheapest_task_reward_is_mean_or_nears_the_upper_envelope() -> None:
    combined = torch.tensor([[-4.0], [0.0], [1.0]])  # R_i of three strategies in one state
    candidates = torch.linspace(-4.0, 1.0, 501)

    def cheapest(above: float) -> float:
        cost = [strategy_regulariser(combined - task, Penalty.SQUARE, above).sum() for task in candidates]
        return float(candidates[int(torch.stack(cost).argmin())])

    assert cheapest(1.0) == pytest.approx(-1.0, abs=0.02)
    assert cheapest(1.0) < cheapest(5.0) < cheapest(50.0) < 1.0


def test_gradient_penalty_of_a_known_function() -> None:
    inputs = torch.randn(2, 50, 3, generator=torch.Generator().manual_seed(0)).requires_grad_(True)
    slopes = torch.tensor([[1.0, 2.0, 0.0], [0.0, 0.0, 3.0]])
    strategy = (inputs * slopes[:, None]).sum(dim=-1)
    torch.testing.assert_close(gradient_penalty(strategy, inputs), torch.tensor([5.0, 9.0]))


@pytest.mark.parametrize("strategies", [2, 5])
def test_cross_negatives_come_from_every_other_strategy_and_never_from_the_own(strategies: int) -> None:
    packed = torch.arange(strategies).float()[:, None, None].expand(strategies, 30, 7).contiguous()
    drawn = of_others(Transitions(packed, 2, 1), 400, torch.Generator().manual_seed(0)).packed[..., 0]
    for own in range(strategies):
        assert set(drawn[own].int().tolist()) == set(range(strategies)) - {own}


def test_cross_negatives_never_come_from_who_shares_the_reward() -> None:
    packed = torch.arange(5).float()[:, None, None].expand(5, 30, 7).contiguous()
    reward_groups = torch.tensor([0, 1, 0, 2, 1])
    generator = torch.Generator().manual_seed(0)
    drawn = of_others(Transitions(packed, 2, 1), 400, generator, reward_groups).packed[..., 0].int()
    for own in range(5):
        assert set(drawn[own].tolist()) == {
            other for other in range(5) if reward_groups[other] != reward_groups[own]
        }


def test_strategies_may_share_a_strategy_reward() -> None:
    rewards = model(RewardForm.TWO_COLUMN, reward_groups=(0, 1, 0), alpha=1.0)
    assert rewards.strategy_network.copies == 2
    states = transitions()
    alike = Transitions(states.packed[:1].expand(3, -1, -1), 2, 1)
    strategy = rewards(alike).strategy
    assert torch.equal(strategy[0], strategy[2])
    assert not torch.equal(strategy[0], strategy[1])
    scaled = rewards.strategy_inputs(states)
    own = rewards.strategy_network(torch.stack([scaled[2], scaled[1]]))[..., 0]
    torch.testing.assert_close(rewards(states).strategy[1:], own.flip(0))
    for wrong in ((0, 1), (0, 2, 2)):
        with pytest.raises(ValueError, match="reward_groups"):
            model(RewardForm.TWO_COLUMN, reward_groups=wrong)


def test_average_is_the_mean_at_first_and_then_forgets() -> None:
    rewards = model(RewardForm.TWO_COLUMN)
    averaged = AveragedRewards(rewards, 0.25)
    seen = []
    for value in range(8):
        torch.nn.init.constant_(rewards.task_network.biases[0], float(value))
        averaged.update(rewards)
        seen.append(float(averaged.model.task_network.biases[0].flatten()[0]))
    assert seen[:4] == pytest.approx([0.0, 0.5, 1.0, 1.5])
    assert seen[4] == pytest.approx(1.5 + 0.25 * (4.0 - 1.5))

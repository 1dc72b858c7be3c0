"""Advantages against their definition."""

from __future__ import annotations

import pytest
import torch

from msrd_ros.learning.advantages import credit_masked_rewards, generalised_advantages


@pytest.mark.parametrize(("discount", "decay"), [(0.99, 0.97), (0.9, 0.0), (1.0, 1.0)])
def test_generalised_advantages_against_the_double_sum(discount: float, decay: float) -> None:
    generator = torch.Generator().manual_seed(0)
    rewards = torch.randn(3, 2, 9, dtype=torch.float64, generator=generator)
    values = torch.randn(3, 2, 10, dtype=torch.float64, generator=generator)
    found = generalised_advantages(rewards, values, discount, decay)
    for start in range(9):
        expected = torch.zeros(3, 2, dtype=torch.float64)
        for step in range(start, 9):
            delta = rewards[..., step] + discount * values[..., step + 1] - values[..., step]
            expected += (discount * decay) ** (step - start) * delta
        torch.testing.assert_close(found[..., start], expected)


def test_full_decay_is_the_discounted_return_minus_the_value() -> None:
    rewards = torch.tensor([[1.0, 2.0, 4.0]])
    values = torch.tensor([[0.5, 0.25, 1.0, 8.0]])
    found = generalised_advantages(rewards, values, 0.5, 1.0)
    returns = torch.tensor([[1.0 + 1.0 + 1.0 + 1.0, 2.0 + 2.0 + 2.0, 4.0 + 4.0]])
    torch.testing.assert_close(found, returns - values[:, :3])


def test_masked_rewards_are_credited_to_the_last_decision() -> None:
    rewards = torch.tensor([[1.0, 2.0, 10.0, 20.0, 40.0]])
    credited = credit_masked_rewards(rewards, 2, 0.5)
    torch.testing.assert_close(credited, torch.tensor([[1.0, 2.0 + 5.0 + 5.0 + 5.0]]))
    torch.testing.assert_close(credit_masked_rewards(rewards, 5, 0.5), rewards)


def test_crediting_keeps_the_return_of_every_acting_step() -> None:
    generator = torch.Generator().manual_seed(0)
    rewards = torch.randn(2, 12, dtype=torch.float64, generator=generator)
    nothing = torch.zeros(2, 13, dtype=torch.float64)
    whole = generalised_advantages(rewards, nothing, 0.97, 1.0)[:, :7]
    credited = credit_masked_rewards(rewards, 7, 0.97)
    torch.testing.assert_close(generalised_advantages(credited, nothing[:, :8], 0.97, 1.0), whole)

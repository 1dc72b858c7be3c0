"""Episodes of different lengths: what lies behind their ends does not leak into what is learned."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from msrd_ros.core.errors import UserError
from msrd_ros.learning.advantages import generalised_advantages
from msrd_ros.learning.endings import acting_rows, filled_rows, hold_endings, only_valid, require_usable
from msrd_ros.learning.layout import Layout
from msrd_ros.learning.trajectories import Rollouts, Transitions

HORIZON = 6
DISCOUNT = 0.9


def played(acting: list[int], lengths: list[int]) -> Rollouts:
    """One strategy; observation t is t, every action is its step."""
    count = len(acting)
    observations = np.tile(np.arange(HORIZON + 1, dtype=np.float32)[:, None], (1, count, 1, 1))
    actions = observations[:, :, :-1].copy()
    return Rollouts(
        observations,
        actions,
        np.full(actions.shape[:3], -1.0, dtype=np.float32),
        np.array([acting]),
        np.array([lengths]),
    )


def test_rows_of_shorter_strategies_begin_again() -> None:
    rows = filled_rows(np.array([[2, 1], [4, 3]]), horizon=5)
    assert rows.tolist() == [[0, 1, 5, 0, 1, 5, 0], [0, 1, 2, 3, 5, 6, 7]]


def test_only_steps_in_which_a_policy_acted_are_improved_on() -> None:
    rollouts = played([2, 6], [6, 6])
    chosen = acting_rows(rollouts)(torch.as_tensor(rollouts.actions).flatten(1, 2))
    assert chosen[0, :, 0].tolist() == [0, 1, 0, 1, 2, 3, 4, 5]


def test_nobody_acts_behind_an_end_and_nothing_lies_behind_a_cut() -> None:
    rollouts = played([2, 3], [6, 3])
    observations, actions = torch.as_tensor(rollouts.observations), torch.as_tensor(rollouts.actions)
    found = Transitions.of(observations, actions, torch.as_tensor(rollouts.log_probs), rollouts.acting)
    assert found.passive[0].tolist() == [0, 0, 1, 1, 1, 1, 0, 0, 0, 1, 1, 1]
    assert found.action[0, :, 0].tolist() == [0, 1, 0, 0, 0, 0, 0, 1, 2, 0, 0, 0]
    assert found.log_prob[0].tolist() == [-1, -1, 0, 0, 0, 0, -1, -1, -1, 0, 0, 0]
    valid = only_valid(found, rollouts.lengths)
    assert valid.observation[0, :, 0].tolist() == [0, 1, 2, 3, 4, 5, 0, 1, 2, 0, 1, 2]


@pytest.mark.parametrize("goes_on", [False, True])
def test_an_end_is_worth_staying_there(goes_on: bool) -> None:
    """Advantages as if the episode had really stayed where it ended, for ever or until the horizon."""
    rollouts = played([2], [HORIZON])
    reward = torch.tensor([[[1.0, -2.0, 3.0, 3.0, 3.0, 3.0]]])
    values = torch.tensor([[[0.5, 0.2, 9.0, 9.0, 9.0, 9.0, 9.0]]])
    held = hold_endings(rollouts, reward, values, DISCOUNT, goes_on)
    found = generalised_advantages(*held, DISCOUNT, 0.8)[0, 0]
    steps = 10_000 if goes_on else HORIZON - 2
    worth = 3.0 * sum(DISCOUNT**step for step in range(steps))
    late = -2.0 + DISCOUNT * worth - 0.2
    early = 1.0 + DISCOUNT * 0.2 - 0.5 + DISCOUNT * 0.8 * late
    assert found[:2].tolist() == pytest.approx([early, late], rel=1e-4)
    assert found[2:].abs().max() < 1e-4


def test_a_cut_has_the_value_of_its_last_state() -> None:
    rollouts = played([3], [3])
    reward = torch.tensor([[[1.0, 1.0, 1.0, 50.0, 50.0, 50.0]]])
    values = torch.tensor([[[0.0, 0.0, 0.0, 4.0, 7.0, 7.0, 7.0]]])
    held = hold_endings(rollouts, reward, values, DISCOUNT, True)
    found = generalised_advantages(*held, DISCOUNT, 1.0)[0, 0]
    assert found[2] == pytest.approx(1.0 + DISCOUNT * 4.0)
    assert found[3:].abs().max() < 1e-6


def test_episodes_that_run_to_the_horizon_are_as_without_ends() -> None:
    rollouts = played([HORIZON], [HORIZON])
    reward, values = torch.randn(1, 1, HORIZON), torch.randn(1, 1, HORIZON + 1)
    held = hold_endings(rollouts, reward, values, DISCOUNT, True)
    assert torch.equal(held[0], reward)
    assert torch.equal(held[1], values)


def test_numbers_that_are_not_finite_are_named() -> None:
    layout = Layout(("height",), ("push",), ("hop",), 1.0)
    rollouts = played([HORIZON], [HORIZON])
    require_usable(rollouts, layout)
    rollouts.observations[0, 0, 3] = np.nan
    with pytest.raises(UserError, match=r"'hop', episode 0, step 3: observation 'height' is nan after"):
        require_usable(rollouts, layout)
    rollouts.actions[0, 0, 2] = np.inf
    with pytest.raises(UserError, match=r"step 2: action 'push' is inf; training diverged"):
        require_usable(rollouts, layout)
    with pytest.raises(UserError, match="1 action columns instead of push, pull"):
        require_usable(rollouts, Layout(("height",), ("push", "pull"), ("hop",), 1.0))

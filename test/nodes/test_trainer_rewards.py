"""Parameters of the trainer that belong to rewards of another run."""

from __future__ import annotations

from typing import Any

import pytest

from msrd_ros.core.errors import UserError
from msrd_ros.nodes.trainer import TrainerConfig


@pytest.mark.parametrize(
    ("given", "named"),
    [
        ({"bags": "my_bags"}, "rewards and bags"),
        ({"labels": ["discover"]}, "rewards and labels"),
        ({"method": "airl", "serve": True}, "rewards and method, serve"),
    ],
)
def test_what_is_of_bags_does_not_go_with_rewards_of_another_run(given: dict[str, Any], named: str) -> None:
    with pytest.raises(UserError, match=f"parameters {named}: .* leave out one or the other"):
        TrainerConfig(rewards="runs/sawyer/rewards.safetensors", **given)


@pytest.mark.parametrize("given", [{"start": "nothing"}, {"taught_on": "ur10e"}])
def test_what_is_of_rewards_does_not_go_without(given: dict[str, Any]) -> None:
    with pytest.raises(UserError, match="start and taught_on are for rewards of another run"):
        TrainerConfig(**given)


def test_rewards_and_a_start_go_together() -> None:
    assert TrainerConfig(rewards="r.safetensors", start="nothing").start == "nothing"

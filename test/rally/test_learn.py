"""Learning rallies: rounds repeat from a seed, and their policies are loaded as any."""

from __future__ import annotations

import pytest

from msrd_ros.rally.learn import RallyLearning, RallyLearningConfig
from msrd_ros.table_tennis.strategies.table import Side
from msrd_ros.table_tennis.strokes.policies import StrokePolicies
from sawyer import ROBOT

pytestmark = pytest.mark.slow

CONFIG = RallyLearningConfig(rounds=3, balls=40, generations=2, steps=200)


def test_rounds_repeat_from_a_seed_and_make_policies_that_load() -> None:
    first, second = (RallyLearning(ROBOT, CONFIG, seed=4) for _ in range(2))
    with pytest.raises(ValueError, match="run a round first"):
        first.policies()
    for _ in range(2):
        assert first.run_round() == second.run_round()
    data = first.policies().to_bytes()
    assert data == second.policies().to_bytes()
    loaded = StrokePolicies.from_bytes(data, "test", ROBOT)
    assert [facts.side for facts in loaded.facts.values()] == list(Side)

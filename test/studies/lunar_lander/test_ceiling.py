"""A reward that is taught the truth: it finds what states show, and nothing that they do not."""

from __future__ import annotations

import numpy as np

from msrd_ros.studies.lunar_lander.ceiling import ceilings, standing_wrecks, taught_reward
from msrd_ros.studies.lunar_lander.evaluation import judge_task
from msrd_ros.studies.lunar_lander.test_sets import TestSet


def made_up(seed: int, hidden: float) -> TestSet:
    """Hovering at various heights, of which the truth knows, and of what states do not show."""
    rng = np.random.default_rng(seed)
    states = 0.05 * rng.standard_normal((200, 31, 8))
    height = rng.uniform(0.0, 2.0, 200)
    states[:, :, 1] += height[:, None]
    truth = -1000.0 * height + hidden * rng.standard_normal(200)
    nothing = np.zeros(200, dtype=bool)
    return TestSet(states.astype(np.float32), truth, nothing, nothing, np.zeros(200, dtype=np.int64))


def test_finds_what_states_show() -> None:
    reward = taught_reward(made_up(0, 0.0), 200, seed=1)
    assert judge_task(reward, made_up(2, 0.0))["task_r"] > 0.99


def test_wrecks_that_stand_are_counted_among_those_within_the_bounds() -> None:
    found = made_up(0, 0.0)
    found.observations[...] = 0.0
    found.observations[:, :, 6:] = 1.0
    found.observations[0, -100:, 4] = 0.5
    found.observations[1, -100:, 2] = 0.2
    found.observations[2, -100:, 7] = 0.0
    found.observations[3, -1, 0] = 1.5
    found.lost[:5] = True
    assert standing_wrecks(found) == 1 / 4


def test_each_set_is_judged_by_what_the_other_one_teaches() -> None:
    sets = {"A": made_up(0, 0.0), "B": made_up(2, 1000.0)}
    found = ceilings(sets, 200, {"A": 1, "B": 2})
    expected = judge_task(taught_reward(sets["B"], 200, 2), sets["A"])
    assert {mark: found["A"][mark] for mark in expected} == expected
    assert found["B"]["taught_r"] > 0.99


def test_does_not_find_what_they_hide() -> None:
    reward = taught_reward(made_up(0, 1000.0), 200, seed=1)
    assert 0.3 < judge_task(reward, made_up(2, 1000.0))["task_r"] < 0.7

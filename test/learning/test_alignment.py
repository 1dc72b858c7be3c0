"""Actions that stand beside the wrong observations are noticed, right ones are left alone."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from gym_problems import track_arrays
from msrd_ros.learning.alignment import Trajectory, better_shift
from msrd_ros.learning.examples import example_demonstrations


def landings() -> list[Trajectory]:
    """The shipped ones, as single trajectories."""
    data = example_demonstrations("lunar_lander")
    assert data.acting is not None
    return [
        (data.observations[place][: steps + 1].astype(float), data.actions[place][:steps].astype(float))
        for place, steps in np.ndenumerate(data.acting)
    ]


def drives() -> list[Trajectory]:
    """Of drivers whose hands tremble."""
    observations, actions, _ = track_arrays({"left": -1.0, "right": 1.0})
    return list(zip(observations, actions, strict=True))


@pytest.mark.parametrize("make", [landings, drives])
def test_actions_that_stand_right_pass(make: Callable[[], list[Trajectory]]) -> None:
    assert better_shift(make()) == 0


@pytest.mark.parametrize(
    ("make", "shift"),
    # Smooth policies without noise do not tell the third: their next action follows from the next state.
    [(landings, 1), (drives, 1), (drives, -1)],
)
def test_the_better_shift_is_found(make: Callable[[], list[Trajectory]], shift: int) -> None:
    trajectories = make()
    early = [(states[1:], moves) for states, moves in trajectories]
    late = [(states[:-1], moves[1:]) for states, moves in trajectories]
    assert better_shift(early if shift > 0 else late) == shift


def test_too_little_data_says_nothing() -> None:
    assert better_shift([(np.zeros((3, 2)), np.zeros((2, 1)))]) == 0

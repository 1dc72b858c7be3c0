"""Points that are driven to places: three strategies, learned once for all tests, and later teachers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from learning_problems import PointMass, point_demonstrations
from msrd_ros.learning.config import MSRDConfig
from msrd_ros.learning.learned import Learned
from msrd_ros.learning.newcomers.courses import Courses
from msrd_ros.learning.newcomers.newcomers import Newcomers
from msrd_ros.learning.recipe import default_config
from msrd_ros.learning.training import train
from msrd_ros.learning.trajectories import Demonstrations

TARGETS = (-1.0, 0.0, 1.0)
STEPS = 40
Array = NDArray[np.float64]


def known() -> Demonstrations:
    """Twelve demonstrations of each of three strategies."""
    return point_demonstrations(TARGETS, 12)


def config() -> MSRDConfig:
    """A short training."""
    recipe = default_config(restarts=False)
    cloning = replace(recipe.cloning, steps=200, snapshots=(0, 40), noise_levels=(1.0,))
    return replace(recipe, iterations=4, cloning=cloning)


@cache
def learned() -> Learned:
    """R0, S_i and policies of the three."""
    return train(known(), PointMass(), config=config(), progress=False)


def newcomers() -> Newcomers:
    """The three, ready for more."""
    return Newcomers(learned(), known(), PointMass(), config())


def take(push: Callable[[Array, int], Array], seed: int) -> tuple[Array, Array]:
    """What somebody shows: observations ``[T+1, 2]`` and actions ``[T_act, 1]``.

    Parameters
    ----------
    push
        From observations ``[1, 1, 2]`` and the step to pushes ``[1, 1, 1]``.
    """
    world = PointMass()
    seen = [world.reset(1, 1, np.random.default_rng(seed))]
    done = []
    for step in range(world.horizon):
        action = push(seen[-1], step) if step < world.acting_steps else np.zeros((1, 1, 1))
        done.append(action)
        seen.append(world.step(action))
    return np.stack(seen, 2)[0, 0], np.stack(done[: world.acting_steps], 2)[0, 0]


def to(target: float, seed: int = 50) -> tuple[Array, Array]:
    """A teacher who drives the point to a place as those before did."""

    def push(seen: Array, _: int) -> Array:
        return np.clip(1.5 * (target - seen[..., :1]) - seen[..., 1:], -1.0, 1.0)

    return take(push, seed)


def far(seed: int = 60) -> tuple[Array, Array]:
    """A teacher who goes where nobody went before."""
    return to(2.0, seed)


def between(share: float, seed: int = 70) -> tuple[Array, Array]:
    """A teacher who plays a mixture of what was learned."""
    first, second = (learned().policy(name) for name in ("to +0.0", "to +1.0"))

    def push(seen: Array, _: int) -> Array:
        return np.asarray((1.0 - share) * first.act(seen) + share * second.act(seen), dtype=np.float64)

    return take(push, seed)


COLUMNS = 6
NAMES = ("first", "second", "third", "fourth")


def walks(place: Array, count: int, rng: np.random.Generator) -> list[Array]:
    """Trajectories ``[T+1, COLUMNS]`` about a place, each with an offset of its own."""
    return [
        place + 0.1 * rng.standard_normal(COLUMNS) + 0.1 * rng.standard_normal((STEPS, COLUMNS))
        for _ in range(count)
    ]


def place_of(number: int) -> Array:
    """Of strategies 0 to 3, and of strangers above: each on an axis of its own."""
    return np.asarray(2.0 * np.eye(COLUMNS)[number])


def fitted(rng: np.random.Generator) -> Courses:
    """Of eight walks of each of four strategies."""
    seen = [walk for number in range(4) for walk in walks(place_of(number), 8, rng)]
    return Courses.fit(seen, [name for name in NAMES for _ in range(8)])

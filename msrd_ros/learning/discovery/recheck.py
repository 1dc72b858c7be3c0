"""Whether learned policies and rewards agree with the strategies that demonstrations were given."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from msrd_ros.core.errors import UserError
from msrd_ros.learning.learned import Learned
from msrd_ros.learning.rewards import RewardForm
from msrd_ros.learning.trajectories import Demonstrations

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Recheck:
    """How well each of K strategies explains each of N demonstrations, strategy by strategy in their order.

    Attributes
    ----------
    assignment
        ``[N]``, the strategies that they were trained as.
    log_likelihood
        ``[N, K]``, of a demonstration's actions under each policy, in nats a step.
    reward
        ``[N, K]``, mean of each strategy reward over a demonstration, in deviations of that reward over all
        demonstrations; None of a method without strategy rewards.
    names
        ``[K]``.
    """

    assignment: NDArray[np.int64]
    log_likelihood: Array
    reward: Array | None
    names: tuple[str, ...]

    @property
    def by_policies(self) -> NDArray[np.int64]:
        """``[N]``, the strategy whose policy explains a demonstration best."""
        return np.asarray(self.log_likelihood.argmax(axis=1))

    @property
    def by_rewards(self) -> NDArray[np.int64]:
        """``[N]``, the strategy whose reward a demonstration stands out in most."""
        return self.assignment if self.reward is None else np.asarray(self.reward.argmax(axis=1))

    @property
    def moved(self) -> tuple[int, ...]:
        """Demonstrations that policies and rewards alike take for another strategy."""
        other = (self.by_policies != self.assignment) & (self.by_rewards != self.assignment)
        return tuple(int(number) for number in np.flatnonzero(other))

    def to_dict(self) -> dict[str, Any]:
        """As JSON: how many agree, and what the others are taken for."""
        return {
            "agree_by_policies": int((self.by_policies == self.assignment).sum()),
            "agree_by_rewards": int((self.by_rewards == self.assignment).sum()),
            "of": len(self.assignment),
            "moved": [{"index": n, "strategy": self.names[int(self.by_policies[n])]} for n in self.moved],
        }


def recheck(learned: Learned, demonstrations: Demonstrations, labels: Sequence[str] | None = None) -> Recheck:
    """Score demonstrations, in the order of `Demonstrations.trajectories`, by what was learned of them.

    Policies are held against actions with one deviation per action, that of the demonstrations about the
    policies they were trained as: a learned policy's own deviation is its exploration.

    Parameters
    ----------
    learned
        Of `train`.
    demonstrations
        What it learned of.
    labels
        What each was trained as, such as `Discovery.labels`; None: what the demonstrations say.

    Raises
    ------
    UserError
        If a label or the columns are not those of training.
    """
    if learned.rewards is not None:
        names_seen = demonstrations.layout.observation_names
        learned = replace(learned, rewards=learned.rewards.on(names_seen, demonstrations.derived))
    shown = demonstrations.trajectories()
    names, trained_as = learned.labels, labels or [label for _, _, label in shown]
    for label in trained_as:
        if label not in names:
            raise UserError(f"no strategy {label!r} was learned; there are {', '.join(names)}")
    if len(trained_as) != len(shown):
        raise UserError(f"labels: {len(trained_as)} for {len(shown)} demonstrations; give one each")
    assignment = np.array([names.index(label) for label in trained_as], dtype=np.int64)
    errors = [
        np.stack(
            [
                np.asarray(learned.policy(name).act(seen[: len(done)]), dtype=np.float64) - done
                for name in names
            ]
        )
        for seen, done, _ in shown
    ]
    own = np.concatenate([error[strategy] for error, strategy in zip(errors, assignment, strict=True)])
    variance = np.maximum(np.square(own).mean(axis=0), 1e-12)
    normaliser = 0.5 * np.log(2.0 * np.pi * variance).sum()
    likelihood = [
        -0.5 * (np.square(error) / variance).sum(axis=-1).mean(axis=1) - normaliser for error in errors
    ]
    return Recheck(assignment, np.stack(likelihood), _rewards(learned, shown, names), names)


def _rewards(learned: Learned, shown: list[tuple[Array, Array, str]], names: tuple[str, ...]) -> Array | None:
    if learned.rewards is None or learned.rewards.form is RewardForm.TASK_ONLY:
        return None
    rewards = np.array(
        [
            [
                learned.strategy_reward(name, seen[1 : len(done) + 1], done, seen[: len(done)]).mean()
                for name in names
            ]
            for seen, done, _ in shown
        ]
    )
    return np.asarray((rewards - rewards.mean(axis=0)) / np.maximum(rewards.std(axis=0), 1e-12))

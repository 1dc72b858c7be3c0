"""After training: teachers that come one by one, each recognised, and learned if nobody knows them yet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import count
from typing import Any

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray

from msrd_ros.core.errors import UserError
from msrd_ros.learning.config import MSRDConfig
from msrd_ros.learning.learned import Learned
from msrd_ros.learning.newcomers.arrivals import checked, together
from msrd_ros.learning.newcomers.courses import Courses
from msrd_ros.learning.newcomers.frame import course_of
from msrd_ros.learning.newcomers.mixed_policy import MixedPolicy
from msrd_ros.learning.newcomers.mixtures import same_mixture
from msrd_ros.learning.newcomers.one_policy import fit_policy
from msrd_ros.learning.newcomers.recognition import Recognition, Verdict, recognise
from msrd_ros.learning.newcomers.samples import samples_of, whole
from msrd_ros.learning.newcomers.strategy_reward import learn_strategy_reward, without_strategy
from msrd_ros.learning.places import find_place
from msrd_ros.learning.policy import Policy
from msrd_ros.learning.recipe import default_config
from msrd_ros.learning.threads import one_thread
from msrd_ros.learning.trajectories import Demonstrations, Transitions

Array = NDArray[np.float64]

OWN_EPISODES = 8
"""Played by a new policy, to tell its teacher's states from what comes of cloning them."""


@dataclass(frozen=True)
class Meeting:
    """What came of one teacher.

    Attributes
    ----------
    name
        The strategy that now plays what was shown.
    recognition
        What it is, and with which belief.
    episodes
        That were played for it, all together.
    """

    name: str
    recognition: Recognition
    episodes: int


class Newcomers:
    """A learned result that teachers are added to, one by one, in a time that does not depend on how many.

    R0 and the strategy rewards and policies that there are stay as they are, to the bit: what was good stays
    good. A known strategy is left alone; a mixture of two gets a policy, and its reward is the mean of
    theirs; only what is new gets a strategy reward of its own.

    Parameters
    ----------
    learned
        Of `train` or `Learned.load`.
    demonstrations
        What it was learned of, in the order of their `Demonstrations.trajectories`.
    environment
        Where policies are played, as of `train`.
    config
        Its cloning and discriminator are used; None: `default_config`.
    people
        Who showed each demonstration; empty: each was shown by somebody else.
    seed
        Everything random follows from it.

    Attributes
    ----------
    learned
        Strategies: those of the beginning, and the new ones.
    policies
        Of all names that can be played: strategies and mixtures.
    mixtures
        Weights of strategies, by the mixture's name.
    episodes_played
        At the latest meeting.

    Raises
    ------
    UserError
        If the labels are not those of training, or there is too little to know what is usual.
    """

    def __init__(
        self,
        learned: Learned,
        demonstrations: Demonstrations,
        environment: Any,
        config: MSRDConfig | None = None,
        people: Sequence[str] = (),
        seed: int = 0,
    ) -> None:
        layout = demonstrations.layout
        layout.require(learned.layout, "demonstrations")
        self.learned, self.policies = learned, learned.policies
        self.mixtures: dict[str, dict[str, float]] = {}
        self.config = config or default_config()
        counts = demonstrations.step_counts()
        places = [(int(row), int(column)) for row, column in np.argwhere(counts > 0)]
        if people and len(people) != len(places):
            raise UserError(f"people: {len(people)} for {len(places)} demonstrations; give one each, or none")
        self.courses = Courses.fit(
            [demonstrations.observations[place][: counts[place] + 1] for place in places],
            [layout.labels[row] for row, _ in places],
            people,
        )
        self._place = find_place(environment, demonstrations)
        self._rng = np.random.default_rng(seed)
        self._generator = torch.Generator().manual_seed(seed)
        self._seen: list[NDArray[np.floating]] = []
        self.episodes_played = 0
        self._known = Transitions.join(
            [
                self._samples(
                    demonstrations.observations[row, column, : counts[row, column] + 1][None],
                    demonstrations.actions[row, column, : counts[row, column]][None],
                )
                for row, column in places
            ]
        )
        self._acting_steps = demonstrations.actions.shape[2]
        self._learned_of: dict[str, Transitions] = {}
        self._shown: dict[str, tuple[Array, Array]] = {}

    def meet(
        self, observations: Sequence[ArrayLike], actions: Sequence[ArrayLike], name: str | None = None
    ) -> Meeting:
        """Recognise what one teacher showed, and learn it if it is no known strategy.

        Parameters
        ----------
        observations, actions
            ``[T+1, O]`` and ``[T_act, A]`` of each of the teacher's demonstrations, all of one strategy and
            of one length.
        name
            What it is called; None: nobody has said. A known strategy's name is believed as far as the
            demonstration goes with it. A new name will play in any case: if it is recognised as a known
            strategy, as a mixture of that alone. What is shown under a newcomer's name counts together with
            what was shown under it before.

        Raises
        ------
        UserError
            If a demonstration does not go with the layout, or holds numbers that are not finite.
        """
        seen, done = checked(self.learned.layout, observations, actions)
        with one_thread():
            return self._meet(seen, done, name)

    def _meet(self, seen: Array, done: Array, name: str | None) -> Meeting:
        if name in self._shown:
            seen, done = together(str(name), self._shown[str(name)], (seen, done))
            self.forget(str(name))
        self._seen, self.episodes_played = [], 0
        recognition = self.recognise(list(seen), name)
        is_new_name = name is not None and name not in self.policies.layout.labels
        strategy = recognition.strategy
        course = course_of(list(seen))
        if not is_new_name:
            if recognition.verdict is Verdict.KNOWN:
                self.courses = self.courses.with_member(strategy, course, len(seen))
            there: str | None = strategy if recognition.verdict is Verdict.KNOWN else None
            if recognition.verdict is Verdict.MIXTURE:
                there = same_mixture(self.mixtures, recognition.weights)
            if there is not None:
                return Meeting(there, recognition, self.episodes_played)
        called = str(name) if is_new_name else self._made_up()
        self._shown[called] = seen, done
        if recognition.verdict is Verdict.NEW:
            self._add_strategy(called, seen, done, strategy)
            self.courses = self.courses.with_strategy(called, course, len(seen))
            return Meeting(called, recognition, self.episodes_played)
        weights = {strategy: 1.0} if recognition.verdict is Verdict.KNOWN else recognition.weights
        self.policies = self.policies.with_policy(
            self._policy_of(called, weights, seen, done, is_mixture=True)
        )
        self.mixtures[called] = dict(weights)
        return Meeting(called, recognition, self.episodes_played)

    def forget(self, name: str) -> None:
        """Take a newcomer away again; what was learned of others stays, mixtures with it keep their policy.

        Raises
        ------
        UserError
            If no newcomer has that name: what was trained stays.
        """
        if name not in self._shown:
            raise UserError(f"newcomers: {name!r} is none; there are {', '.join(self._shown) or 'none'}")
        del self._shown[name]
        self.policies = self.policies.without(name)
        if self.mixtures.pop(name, None) is not None:
            return
        rewards, row = self.learned.rewards, self.learned.labels.index(name)
        if rewards is not None:
            rewards = without_strategy(rewards, row, self._generator)
        self.learned = replace(self.learned, policies=self.learned.policies.without(name), rewards=rewards)
        self.courses = self.courses.without(name)
        self._learned_of.pop(name, None)

    def recognise(self, observations: Sequence[NDArray[np.floating]], name: str | None = None) -> Recognition:
        """Say what demonstrations are, and change nothing; see `meet`."""
        return recognise(self.courses, list(observations), self._play_mixture, name, self.may_mix)

    def may_mix(self, first: str, second: str) -> bool:
        """Whether two strategies can be mixed at all."""
        return True

    # -- what a task may know better -----------------------------------------------------------

    def _play(self, policy: MixedPolicy, episodes: int) -> list[NDArray[np.floating]]:
        """Whole trajectories ``[T+1, O]``."""
        played = self._place.collector.collect(policy, episodes, self._rng)  # type: ignore[arg-type]
        self.episodes_played += episodes
        if played.lengths is None:
            return list(played.observations[0])
        return [seen[: n + 1] for seen, n in zip(played.observations[0], played.lengths[0], strict=True)]

    def _policy_of(
        self, name: str, weights: dict[str, float], observations: Array, actions: Array, is_mixture: bool
    ) -> Policy:
        """The policy of a newcomer, which is nearest to a mixture with these weights, or is it.

        A mixture does at every state that was played for it what it is the mean of; a new one clones.
        """
        nearest = self.policies.policy(max(weights, key=lambda part: weights[part]))
        if is_mixture and max(weights.values()) == 1.0:
            return replace(nearest, label=name)
        if is_mixture:
            observations = whole(self._seen)
            actions = self._mixed(weights).mean(observations[:, :-1])
        shown = Demonstrations(
            observations[None], actions[None], replace(self.learned.layout, labels=(name,))
        )
        cloning = replace(self.config.cloning, snapshots=(), noise_levels=(), restarts=())
        if is_mixture:
            # What is right at every state needs no help to come back to a few.
            cloning = replace(cloning, state_noise=(), recovery_labels=())
        return fit_policy(nearest, shown, cloning, self._generator)

    # ------------------------------------------------------------------------------------------

    def _play_mixture(self, weights: dict[str, float], episodes: int) -> list[NDArray[np.floating]]:
        played = self._play(self._mixed(weights), episodes)
        self._seen += played
        return played

    def _mixed(self, weights: dict[str, float], noise: float = 0.0) -> MixedPolicy:
        parts = [(weight, self.policies.policy(part)) for part, weight in weights.items()]
        return MixedPolicy(parts, noise, self._place.scale)

    def _add_strategy(self, name: str, observations: Array, actions: Array, nearest: str) -> None:
        policy = self._policy_of(name, {nearest: 1.0}, observations, actions, is_mixture=False)
        self.policies = self.policies.with_policy(policy)
        rewards = self.learned.rewards
        if rewards is not None:
            shown = self._samples(observations, actions, policy)
            rewards = learn_strategy_reward(
                rewards,
                shown,
                self._own_rollouts(policy),
                Transitions.join([self._known, *self._learned_of.values()]),
                self.config.discriminator,
                self._generator,
            )
            self._learned_of[name] = shown
        self.learned = replace(
            self.learned, policies=self.learned.policies.with_policy(policy), rewards=rewards
        )

    def _own_rollouts(self, policy: Policy) -> Transitions:
        alone = MixedPolicy([(1.0, policy)], 1.0, self._place.scale)
        parts = []
        for seen in self._play(alone, OWN_EPISODES):
            states = np.asarray(seen, dtype=np.float64)[None]
            # Which action was drawn matters to rewards that see it alone; the mean will do for the others.
            actions = alone.mean(states[:, :-1][:, : self._acting_steps])
            parts.append(self._samples(states, actions, policy))
        return Transitions.join(parts)

    def _samples(
        self, observations: NDArray[np.floating], actions: NDArray[np.floating], policy: Policy | None = None
    ) -> Transitions:
        return samples_of(observations, actions, self.config.discriminator, self._place.scale, policy)

    def _made_up(self) -> str:
        names = (f"strategy-{number}" for number in count(1))
        return next(name for name in names if name not in self.policies.layout.labels)

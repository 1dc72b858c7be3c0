"""Strategies of demonstrations without labels, with a few, or with wrong ones."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linear_sum_assignment
from threadpoolctl import threadpool_limits

from msrd_ros.core.errors import UserError
from msrd_ros.learning.discovery.features import courses, standardised, state_features
from msrd_ros.learning.discovery.partition import Labels
from msrd_ros.learning.discovery.result import Discovery
from msrd_ros.learning.discovery.same_policy import Regressions
from msrd_ros.learning.discovery.search import (
    MOST_DEPARTURES_OF_ONE_POLICY,
    Beliefs,
    Found,
    evidence_alone,
    mixture_partition,
    same_policy_partition,
)
from msrd_ros.learning.trajectories import Demonstrations

Array = NDArray[np.float64]

LENGTH_SCALES = (1.0, 2.0, 4.0)
"""Of policies, as of `state_features`; the one of the highest evidence is taken."""
LEAST_DIMENSIONS = 3
"""Of a course; more where demonstrations are more than twice their square: a scatter has as many numbers."""
TRUST = 0.7
"""Probability that a given label is right, before it has been looked at."""
LEAST_STEPS = 2


def discover(
    observations: Sequence[ArrayLike],
    actions: Sequence[ArrayLike],
    labels: Sequence[str | None] | None = None,
    sources: Sequence[str] = (),
    seed: int = 0,
) -> Discovery:
    """How many strategies demonstrations show, and which of them is whose.

    Parameters
    ----------
    observations
        ``[T, O]`` or ``[T+1, O]`` each, of any lengths; row t is what was seen before action t.
    actions
        ``[T, A]`` each.
    labels
        What is said of each demonstration, None or empty where nothing is. Labels are taken for true with a
        probability that is learned; they name strategies, and may be doubted.
    sources
        What to call the demonstrations in `Discovery.save`, such as bags; empty: their numbers.
    seed
        Everything random follows from it.

    Raises
    ------
    UserError
        Naming the demonstration and what is wrong with it.

    Notes
    -----
    Units and scales of observations do not matter, nor a unit that all actions have in common. See
    ``docs/discover.md`` for the model.
    """
    states, moves = _checked(observations, actions)
    given = _given(labels, len(states))
    if sources and len(sources) != len(states):
        raise UserError(f"sources: {len(sources)} for {len(states)} demonstrations; give one each, or none")
    known = tuple(dict.fromkeys(label for label in given if label))
    beliefs = Beliefs(
        np.array([known.index(label) if label else -1 for label in given], dtype=np.int64), TRUST
    )
    # Threads that share out matrices this small wait for each other: many times slower on a busy machine.
    with threadpool_limits(1, "blas"):
        found, one_policy = _search(states, moves, beliefs, seed)
        found = _trusting(found, beliefs, len(known), np.random.default_rng([seed, 1]))
    members = found.labels
    chances = found.partitions.responsibilities(members)[:, :-1]
    votes = _votes(members, beliefs.given, len(known))
    spoken = _spoken(votes)
    agreed = np.array([[said == label for said in spoken] for label in beliefs.given])
    right = (chances * agreed).sum(axis=1)
    doubted = np.flatnonzero((beliefs.given >= 0) & (right < 0.5 * chances.sum(axis=1)))
    return Discovery(
        _names(votes, spoken, known),
        members,
        chances,
        tuple(int(number) for number in doubted),
        given,
        tuple(sources),
        one_policy,
    )


def discovered(demonstrations: Demonstrations, seed: int = 0) -> tuple[Demonstrations, Discovery]:
    """The same demonstrations under the strategies found in them, and what was found.

    Labels are taken as `discover` takes them; those labelled `NO_LABEL` have none. Numbers in the result
    are those of `Demonstrations.trajectories` of the demonstrations that were given.

    Raises
    ------
    UserError
        As `discover`.
    """
    shown = demonstrations.trajectories()
    seen, done, labels = ([part[index] for part in shown] for index in range(3))
    found = discover(seen, done, labels, seed=seed)  # type: ignore[arg-type]
    return demonstrations.relabelled(found.labels), found


def _search(states: list[Array], moves: list[Array], beliefs: Beliefs, seed: int) -> tuple[Found, bool]:
    if len(states) == 1:
        raise UserError("demonstrations: there is one; strategies are told apart from two on")
    rng = np.random.default_rng(seed)
    scaled = standardised(moves)
    moving = np.any([table.any(axis=0) for table in scaled], axis=0)
    outputs = [table[:, moving] for table in scaled]
    scales = [
        Regressions(state_features(standardised(states), length, rng), outputs) for length in LENGTH_SCALES
    ]
    regressions = max(scales, key=lambda sums: evidence_alone(sums, beliefs))
    found, departures = same_policy_partition(regressions, beliefs, rng)
    if departures <= MOST_DEPARTURES_OF_ONE_POLICY:
        return found, True
    dimensions = max(LEAST_DIMENSIONS, round(math.sqrt(0.5 * len(moves))))
    return mixture_partition(courses(moves, min(dimensions, len(moves) - 1)), beliefs, rng), False


def _trusting(found: Found, beliefs: Beliefs, kinds: int, rng: np.random.Generator) -> Found:
    """The same search with the trust in labels that the partition suggests."""
    said = beliefs.given >= 0
    if kinds < 2 or not said.any():
        return found
    spoken = np.array(_spoken(_votes(found.labels, beliefs.given, kinds)))
    right = int((spoken[found.labels] == beliefs.given)[said].sum())
    trust = float(np.clip((right + 1.0) / (said.sum() + 2.0), 1.0 / kinds, 1.0 - 1e-3))
    partitions = found.partitions.with_trust(trust)
    score, labels = partitions.move(found.labels, (0.0,) * 5, rng)
    return Found(score, labels, partitions)


def _votes(members: Labels, given: Labels, kinds: int) -> NDArray[np.int64]:
    """How many demonstrations of each group have each label, ``[groups, labels]``."""
    votes = np.zeros((int(members.max()) + 1, max(kinds, 1)), dtype=np.int64)
    said = given >= 0
    np.add.at(votes, (members[said], given[said]), 1)
    return votes


def _spoken(votes: NDArray[np.int64]) -> list[int]:
    """What each group is called by its labels, -1 where none of it has one.

    Labels and groups are matched so that as many demonstrations as possible are called rightly: two groups do
    not share a name because wrong labels outnumber the right ones in one of them. A group that is left over,
    as where one strategy was split, is called what most of it are.
    """
    spoken = np.where(votes.any(axis=1), votes.argmax(axis=1), -1)
    groups, labels = linear_sum_assignment(votes, maximize=True)
    matched = votes[groups, labels] > 0
    spoken[groups[matched]] = labels[matched]
    return [int(label) for label in spoken]


def _names(votes: NDArray[np.int64], spoken: list[int], known: tuple[str, ...]) -> tuple[str, ...]:
    """A label names the group that has most of it; other groups are numbered."""
    owner: dict[int, int] = {}
    for group, label in enumerate(spoken):
        if label >= 0 and (label not in owner or votes[group, label] > votes[owner[label], label]):
            owner[label] = group
    names = {group: known[label] for label, group in owner.items()}
    number = 0
    for group in range(len(spoken)):
        while group not in names:
            number += 1
            if (made := f"strategy-{number}") not in known:
                names[group] = made
    return tuple(names[group] for group in range(len(spoken)))


def _checked(
    observations: Sequence[ArrayLike], actions: Sequence[ArrayLike]
) -> tuple[list[Array], list[Array]]:
    if len(observations) != len(actions):
        raise UserError(
            f"demonstrations: {len(observations)} arrays of observations and {len(actions)} of actions; "
            "give one of each for every demonstration"
        )
    if not len(observations):
        raise UserError("demonstrations: there are none")
    states: list[Array] = []
    moves: list[Array] = []
    for number, pair in enumerate(zip(observations, actions, strict=True)):
        seen, done = (np.asarray(array, dtype=np.float64) for array in pair)
        if seen.ndim != 2 or done.ndim != 2 or len(seen) - len(done) not in (0, 1):
            raise UserError(
                f"demonstration {number}: observations {seen.shape} and actions {done.shape}; give "
                "[steps, columns] of as many steps, or one observation more"
            )
        if len(done) < LEAST_STEPS:
            raise UserError(f"demonstration {number}: {len(done)} steps; leave it out")
        if states and (seen.shape[1], done.shape[1]) != (states[0].shape[1], moves[0].shape[1]):
            raise UserError(
                f"demonstration {number}: {seen.shape[1]} observation and {done.shape[1]} action columns, "
                f"demonstration 0 has {states[0].shape[1]} and {moves[0].shape[1]}"
            )
        if not (np.isfinite(seen).all() and np.isfinite(done).all()):
            raise UserError(f"demonstration {number}: holds a number that is not finite; leave it out")
        states.append(seen[: len(done)])
        moves.append(done)
    return states, moves


def _given(labels: Sequence[str | None] | None, count: int) -> tuple[str | None, ...]:
    if labels is None:
        return (None,) * count
    if len(labels) != count:
        raise UserError(
            f"labels: {len(labels)} for {count} demonstrations; give one each, None where unknown"
        )
    return tuple(label or None for label in labels)

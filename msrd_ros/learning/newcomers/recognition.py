"""Whose a demonstration is: a known strategy's, a mixture's, or nobody's yet; with a degree of belief."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import softmax

from msrd_ros.learning.newcomers.courses import Courses
from msrd_ros.learning.newcomers.frame import course_of
from msrd_ros.learning.newcomers.mixtures import Mixture, Player, find_mixture, nearest_pair

TRUST = 0.7
"""Probability that a given label is right, before the demonstration has been looked at."""


class Verdict(StrEnum):
    """What a demonstration is."""

    KNOWN = "known"
    MIXTURE = "mixture"
    NEW = "new"


@dataclass(frozen=True)
class Recognition:
    """What a demonstration is, and what else it may be.

    Attributes
    ----------
    verdict
        The most probable kind.
    belief
        Its probability.
    known
        Probability of each known strategy, by name.
    mixture
        Probability of some mixture of two.
    new
        Probability of something else.
    weights
        Of the best mixture, by name; empty where none was tried.
    episodes
        That were played to find the weights.
    """

    verdict: Verdict
    belief: float
    known: dict[str, float]
    mixture: float
    new: float
    weights: dict[str, float]
    episodes: int

    @property
    def strategy(self) -> str:
        """The most probable known strategy."""
        return max(self.known, key=lambda name: self.known[name])

    def __str__(self) -> str:
        """One line for people."""
        said = {
            Verdict.KNOWN: f"known: {self.strategy}",
            Verdict.MIXTURE: f"mixture: {say_weights(self.weights)}",
            Verdict.NEW: f"new, nearest to {self.strategy}",
        }[self.verdict]
        return f"{said} (belief {self.belief:.2f})"

    def to_dict(self) -> dict[str, Any]:
        """As JSON."""

        def rounded(values: dict[str, float]) -> dict[str, float]:
            return {name: round(value, 4) for name, value in values.items()}

        return {
            "verdict": self.verdict.value,
            "belief": round(self.belief, 4),
            "known": rounded(self.known),
            "mixture": round(self.mixture, 4),
            "new": round(self.new, 4),
            "weights": rounded(self.weights),
            "episodes": self.episodes,
        }


def say_weights(weights: dict[str, float]) -> str:
    """For people, such as ``0.70 high + 0.30 low``."""
    return " + ".join(f"{weight:.2f} {name}" for name, weight in weights.items() if weight > 0.0)


def recognise(
    courses: Courses,
    observations: Sequence[NDArray[np.floating]],
    play: Player,
    label: str | None = None,
    may_mix: Callable[[str, str], bool] = lambda first, second: True,
) -> Recognition:
    """Decide what one teacher's demonstrations are.

    Parameters
    ----------
    courses
        Of the known strategies.
    observations
        ``[T+1, O]`` each, all of one teacher and one strategy.
    play
        Plays a mixture.
    label
        What is said of it: a known strategy, or a name that none has; None: nothing.
    may_mix
        Which two strategies can be mixed at all.

    Notes
    -----
    A priori a demonstration is as likely known, a mixture or new, and every strategy and pair as likely as
    another; a label moves `TRUST` to what it says. A demonstration that is nearer to one strategy than half
    of its own ones are is not mixed: nothing is played.
    """
    course = course_of(observations)
    known_evidence = courses.known_evidence(course)
    pair = nearest_pair(courses, course, may_mix)
    mixture: Mixture | None = None
    if pair is not None and known_evidence.max() < courses.usual_evidence():
        mixture = find_mixture(courses, course, pair, play)
    pairs = sum(
        may_mix(first, second)
        for row, first in enumerate(courses.names)
        for second in courses.names[row + 1 :]
    )
    prior = _prior(courses.names, mixture is not None, max(pairs, 1), label)
    evidence = [
        *known_evidence,
        mixture.log_evidence if mixture else -np.inf,
        courses.strange_evidence(course),
    ]
    beliefs = softmax(np.log(np.maximum(prior, 1e-300)) + np.array(evidence))
    known = dict(zip(courses.names, beliefs[:-2].tolist(), strict=True))
    kinds = {
        Verdict.KNOWN: float(beliefs[:-2].sum()),
        Verdict.MIXTURE: float(beliefs[-2]),
        Verdict.NEW: float(beliefs[-1]),
    }
    verdict = max(kinds, key=lambda kind: kinds[kind])
    return Recognition(
        verdict,
        kinds[verdict],
        known,
        kinds[Verdict.MIXTURE],
        kinds[Verdict.NEW],
        mixture.weights if mixture else {},
        mixture.episodes if mixture else 0,
    )


def _prior(names: tuple[str, ...], mixed: bool, pairs: int, label: str | None) -> NDArray[np.float64]:
    """Probabilities of each known strategy, of the best pair, and of something new."""
    known = np.full(len(names), 1.0 / len(names))
    shares = np.array([1.0, 1.0 if mixed else 0.0, 1.0])
    shares /= shares.sum()
    if label in names:
        row = names.index(str(label))
        known = np.full(len(names), (1.0 - TRUST) / max(len(names) - 1, 1))
        known[row] = 1.0
        shares = np.array([TRUST, *((1.0 - TRUST) * shares[1:] / shares[1:].sum())])
    elif label is not None:
        shares = np.array([1.0 - TRUST, *(TRUST * shares[1:] / shares[1:].sum())])
    return np.array([*(shares[0] * known), shares[1] / pairs, shares[2]])

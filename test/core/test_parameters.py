"""What a parameter may be: type, range, choices, and what is said of anything else."""

from __future__ import annotations

import math
from typing import Any

import pytest

from msrd_ros.core.errors import UserError
from msrd_ros.core.parameters import ParameterFacts

WHERE = "parameter x of node"


def even(text: str, where: str) -> None:
    if len(text) % 2:
        raise UserError(f"{where}: {text!r} is odd; give an even number of letters")


@pytest.mark.parametrize(
    ("facts", "default", "value"),
    [
        (ParameterFacts("", low=0.0, high=0.1), 0.0, 0.1),
        (ParameterFacts("", low=1), 1, 10**12),
        (ParameterFacts(""), True, False),
        (ParameterFacts("", choices=("a", "b")), "a", "b"),
        (ParameterFacts("", check=even), "ab", "abcd"),
        (ParameterFacts(""), [], ["a", "b"]),
    ],
)
def test_what_is_allowed_passes(facts: ParameterFacts, default: Any, value: Any) -> None:
    facts.require(value, default, WHERE)


@pytest.mark.parametrize(
    ("facts", "default", "value", "words"),
    [
        (ParameterFacts("", "m", 0.0, 0.1), 0.0, 0.2, "0.2 is out of range; give a value from 0.0 to 0.1 m"),
        (ParameterFacts("", low=0.0, high=0.1), 0.0, math.nan, "nan is out of range"),
        (ParameterFacts(""), 0.0, math.inf, "inf is out of range; give a finite number"),
        (ParameterFacts("", low=1), 1, 0, "0 is out of range; give at least 1"),
        (ParameterFacts("", high=5), 1, 6, "6 is out of range; give at most 5"),
        (ParameterFacts(""), 1, 1.0, "1.0 has the wrong type; give integer, such as 1"),
        (ParameterFacts(""), 1, True, "True has the wrong type"),
        (ParameterFacts(""), True, 1, "1 has the wrong type; give bool"),
        (ParameterFacts(""), "a", 1, "1 has the wrong type; give string, such as 'a'"),
        (ParameterFacts(""), [], [1], "[1] has the wrong type; give string array"),
        (ParameterFacts("", choices=("a", "b")), "a", "c", "'c' is unknown; use one of a, b"),
        (ParameterFacts("", check=even), "ab", "abc", "'abc' is odd"),
    ],
)
def test_anything_else_is_refused_with_what_is_allowed(
    facts: ParameterFacts, default: Any, value: Any, words: str
) -> None:
    with pytest.raises(UserError) as refused:
        facts.require(value, default, WHERE)
    assert str(refused.value).startswith(f"{WHERE}: {words}")

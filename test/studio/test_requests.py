"""What a page asks for is held against what is allowed."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from msrd_ros.core.errors import UserError
from msrd_ros.studio.requests import Request

JSON = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
    max_leaves=5,
)


def outcome(ask: Callable[[], object]) -> object:
    try:
        return ask()
    except UserError as error:
        return error


@given(JSON)
def test_a_value_is_what_was_asked_for_or_an_error_that_names_it(value: object) -> None:
    request = Request({"do": "rate", "rate": value, "id": value})
    number, flag, text = (
        outcome(ask)
        for ask in (
            lambda: request.within("rate", 0.0, 1.0),
            lambda: request.flag("rate"),
            lambda: request.text("rate", most=3),
        )
    )
    is_number = type(value) in (int, float) and 0.0 <= value <= 1.0  # type: ignore[operator]
    assert number == value if is_number else "rate: rate is" in str(number)
    assert flag is value if isinstance(value, bool) else "true or false" in str(flag)
    assert text == value if isinstance(value, str) and len(value) <= 3 else "rate is no text" in str(text)


@pytest.mark.parametrize("value", [math.nan, math.inf, -0.1, 1.1, True, "1", None])
def test_a_number_out_of_range_is_refused(value: object) -> None:
    with pytest.raises(UserError, match=r"give .*0 .*1"):
        Request({"do": "rate", "rate": value}).within("rate", 0.0, 1.0)


def test_a_whole_number_is_whole() -> None:
    assert Request({"seed": 3.0}).whole("seed", 0, 9) == 3
    with pytest.raises(UserError, match="give a whole number from 0 to 9"):
        Request({"seed": 2.5}).whole("seed", 0, 9)


def test_a_list_has_as_many_texts_as_are_allowed() -> None:
    request = Request({"do": "train", "own": [], "bags": ["a", "b"]})
    assert request.texts("own", 2, fewest=0) == []
    with pytest.raises(UserError, match="0 of own are chosen; choose 1 to 2"):
        request.texts("own", 2)
    with pytest.raises(UserError, match="2 of bags are chosen; choose 1 to 1"):
        request.texts("bags", 1)


def test_choices_are_listed() -> None:
    with pytest.raises(UserError, match="use one of easy, own"):
        Request({"do": "feed", "kind": "hard"}).choice("kind", ("easy", "own"))

"""Arguments: what is written, what is refused and what then is said."""

from __future__ import annotations

from pathlib import Path

import pytest

from msrd_ros.core.errors import UserError
from msrd_ros.stack.arguments import (
    Argument,
    Value,
    as_count,
    as_file,
    as_names,
    as_namespace,
    as_truth,
    read_values,
    split_words,
)

ARGUMENTS = (
    Argument("mode", "How", choices=("slow", "fast")),
    Argument("balls", "How many", "3", read=as_count(1)),
    Argument("namespace", "Where", read=as_namespace),
    Argument("labels", "Which", read=as_names),
    Argument("gui", "Whether", read=as_truth),
    Argument("file", "From what", read=as_file),
)


@pytest.mark.parametrize(
    ("texts", "values"),
    [
        ({}, {"balls": 3}),
        ({"balls": ""}, {}),
        ({"mode": "fast", "balls": "12"}, {"mode": "fast", "balls": 12}),
        ({"namespace": "a"}, {"balls": 3, "namespace": "/a"}),
        ({"namespace": "/a/b/"}, {"balls": 3, "namespace": "/a/b"}),
        ({"namespace": "/"}, {"balls": 3, "namespace": ""}),
        ({"labels": "one,another"}, {"balls": 3, "labels": ["one", "another"]}),
        ({"labels": "[one, another]"}, {"balls": 3, "labels": ["one", "another"]}),
        ({"gui": "True"}, {"balls": 3, "gui": True}),
        ({"file": __file__}, {"balls": 3, "file": __file__}),
    ],
)
def test_texts_become_values(texts: dict[str, str], values: dict[str, Value]) -> None:
    assert dict(read_values("play", ARGUMENTS, texts)) == values


@pytest.mark.parametrize(
    ("texts", "said"),
    [
        ({"ball": "3"}, "play has no argument 'ball'; it takes mode, balls, namespace"),
        ({"mode": "quick"}, "play mode:=quick: give one of slow, fast"),
        ({"balls": "0"}, "play balls:=0: give a whole number from 1 on"),
        ({"balls": "-2"}, "play balls:=-2: give a whole number from 1 on"),
        ({"balls": "2.5"}, "give a whole number"),
        ({"balls": "²"}, "give a whole number"),
        ({"namespace": "/my stack"}, "give letters, digits and _"),
        ({"namespace": "/1st"}, "give letters, digits and _"),
        ({"labels": "one,,two"}, "give names with commas between them"),
        ({"gui": "yes"}, "give true or false"),
        ({"file": "/nowhere/policies"}, "play file:=/nowhere/policies: there is no such file"),
    ],
)
def test_what_is_not_allowed_is_refused_with_what_is(texts: dict[str, str], said: str) -> None:
    with pytest.raises(UserError) as refused:
        read_values("play", ARGUMENTS, texts)
    assert said in str(refused.value)


def test_parameters_are_picked_from_the_arguments_of_which_something_is_said() -> None:
    values = read_values("play", ARGUMENTS, {"mode": "fast"})
    assert values.pick(speed="mode", count="balls", window="gui") == {"speed": "fast", "count": 3}
    assert values.pick("mode", "gui", count="balls") == {"mode": "fast", "count": 3}


def test_words_are_taken_apart() -> None:
    assert split_words("play", ["a:=1", "b:=c:=d", "c:="]) == {"a": "1", "b": "c:=d", "c": ""}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--balls", "3"], "play: '--balls' is no argument; write name:=value"),
        (["balls=3"], "play: 'balls=3' is no argument"),
        (["a:=1", "a:=2"], "play: a is given twice"),
    ],
)
def test_other_words_are_refused(words: list[str], said: str) -> None:
    with pytest.raises(UserError) as refused:
        split_words("play", words)
    assert said in str(refused.value)


def test_a_folder_is_no_file(tmp_path: Path) -> None:
    with pytest.raises(UserError):
        as_file(str(tmp_path))

"""Demonstrations from arrays: what goes in comes out, and misuse is named."""

from __future__ import annotations

import re

import numpy as np
import pytest

from gym_problems import track_arrays
from msrd_ros.core.errors import UserError
from msrd_ros.learning.demonstration_sets import (
    ROOM_AFTER_THE_LAST,
    demonstrations_from_arrays,
)

RNG = np.random.default_rng(3)
SEEN = [RNG.normal(size=(steps + 1, 2)) for steps in (4, 8, 6, 5)]
DONE = [RNG.normal(size=(steps, 1)) for steps in (4, 8, 6, 5)]
LABELS = ["hop", "crawl", "crawl", "hop"]


def test_trajectories_of_any_length_keep_their_rows() -> None:
    data = demonstrations_from_arrays(SEEN, DONE, LABELS, terminated=False)
    assert data.layout.labels == ("hop", "crawl")
    assert data.layout.observation_names == ("observation_0", "observation_1")
    assert data.step_counts().tolist() == [[4, 5], [8, 6]]
    assert np.array_equal(data.observations[1, 0], SEEN[1])
    assert np.array_equal(data.actions[0, 1, :5], DONE[3])


def test_an_episode_that_ended_stays_where_it_ended() -> None:
    data = demonstrations_from_arrays(SEEN, DONE, LABELS, terminated=[True, False, True, False])
    horizon = int(ROOM_AFTER_THE_LAST * 8)
    assert data.step_counts().tolist() == [[horizon, 5], [8, horizon]]
    assert data.acting is not None
    assert data.acting.tolist() == [[4, 5], [8, 6]]
    assert (data.observations[0, 0, 5:] == SEEN[0][-1]).all()


def test_lengths_without_endings_are_asked_about() -> None:
    with pytest.raises(UserError, match="4 to 8 steps: say with terminated="):
        demonstrations_from_arrays(SEEN, DONE, LABELS)


@pytest.mark.parametrize(
    ("change", "blame"),
    [
        ({"labels": LABELS[:3]}, "4 arrays of observations, 4 of actions, 3 labels"),
        ({"labels": ["hop", "", "hop", "hop"]}, "label of trajectory 1 is ''"),
        ({"labels": ["hop", "hop", "hop", 3]}, "label of trajectory 3 is 3"),
        ({"actions": [*DONE[:3], DONE[3][:, 0]]}, "actions of trajectory 3: shape"),
        (
            {"actions": [*DONE[:3], np.full((5, 1), np.nan)]},
            "actions of trajectory 3: step 0, column 0 is nan",
        ),
        ({"observations": [[[1.0, 2.0], [1.0]], *SEEN[1:]]}, "observations of trajectory 0: rows differ"),
        ({"observations": [*SEEN[:3], np.zeros((6, 3))]}, "trajectory 3: 3 observation columns instead of 2"),
        ({"actions": [DONE[0][:2], *DONE[1:]]}, "trajectory 0: 5 observations and 2 actions"),
        ({"observation_names": ("a", "a")}, "'a' is named twice"),
        ({"terminated": [True]}, "terminated: 1 values for 4 trajectories"),
        ({"observations": [], "actions": [], "labels": []}, "there are none"),
    ],
)
def test_misuse_is_named(change: dict[str, object], blame: str) -> None:
    arguments = {"observations": SEEN, "actions": DONE, "labels": LABELS, "terminated": False} | change
    with pytest.raises(UserError, match=re.escape(blame)):
        demonstrations_from_arrays(**arguments)  # type: ignore[arg-type]


@pytest.mark.parametrize(("first", "which"), [(0, "first"), (1, "second")])
def test_equally_long_arrays_are_told_which_end_to_cut(first: int, which: str) -> None:
    seen, done, labels = track_arrays({"left": -1.0, "right": 1.0})
    seen = [states[first : first + len(moves)] for states, moves in zip(seen, done, strict=True)]
    message = rf"30 observations and 30 actions; T\+1 observations for T actions .* fit the {which}$"
    with pytest.raises(UserError, match=message):
        demonstrations_from_arrays(seen, done, labels)


def test_shifted_actions_are_warned_of() -> None:
    seen, done, labels = track_arrays({"left": -1.0, "right": 1.0})
    with pytest.warns(UserWarning, match=r"1 row later .* drop the first action"):
        demonstrations_from_arrays([states[1:] for states in seen], [moves[:-1] for moves in done], labels)


def test_one_demonstration_is_warned_of() -> None:
    with pytest.warns(UserWarning, match="'hop' has one demonstration only"):
        demonstrations_from_arrays(SEEN[:3], DONE[:3], LABELS[:3], terminated=False)
    with pytest.warns(UserWarning, match="all demonstrations are of strategy 'hop'"):
        demonstrations_from_arrays(SEEN[:2], DONE[:2], ["hop", "hop"], terminated=False)

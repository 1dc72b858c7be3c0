"""Strategies are found without labels, with some, and with wrong ones; misuse is named."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from discovery_problems import linear_demonstrations, reaching_demonstrations, same_partition
from msrd_ros.core.errors import UserError
from msrd_ros.learning.demonstration_sets import demonstrations_from_arrays
from msrd_ros.learning.discovery.discover import discover, discovered

SEEN, DONE, TRUTH = linear_demonstrations(4, 5)


@pytest.mark.parametrize("strategies", [1, 2, 5])
def test_the_number_of_policies_is_found(strategies: int) -> None:
    seen, done, truth = linear_demonstrations(strategies, 5, seed=1)
    found = discover(seen, done)
    assert found.one_policy
    assert len(found.names) == strategies
    assert same_partition(found.labels, truth)
    assert found.names == tuple(f"strategy-{number + 1}" for number in range(strategies))
    assert (found.beliefs[np.arange(len(seen)), found.assignment] > 0.7).all()
    assert found.doubted == ()


def test_demonstrations_of_one_way_that_differ_are_kept_together() -> None:
    seen, done, truth = reaching_demonstrations(4, 8)
    found = discover(seen, done)
    assert not found.one_policy
    assert len(found.names) <= 6
    assert len(set(zip(found.labels, truth, strict=True))) == len(found.names), "a group of two sides"


def test_a_policy_that_chance_alone_could_have_made_is_not_split() -> None:
    rng = np.random.default_rng(2)
    seen = [rng.normal(size=(60, 2)) for _ in range(8)]
    done = [rng.normal(size=(60, 1)) for _ in range(8)]
    assert discover(seen, done).names == ("strategy-1",)


def test_the_order_of_demonstrations_and_the_units_of_columns_do_not_matter() -> None:
    order = np.random.default_rng(0).permutation(len(SEEN))
    scaled = [SEEN[index] * [1e3, 1e-3, 1.0] + [5.0, 0.0, -7.0] for index in order]
    found = discover(scaled, [DONE[index] * 40.0 for index in order])
    assert same_partition(found.labels, [TRUTH[index] for index in order])


def test_a_seed_gives_the_same_result_again() -> None:
    first, again = (discover(SEEN, DONE, seed=3) for _ in range(2))
    assert first.to_dict() == again.to_dict()
    assert np.array_equal(first.beliefs, again.beliefs)


def test_a_few_labels_name_the_strategies() -> None:
    labels: list[str | None] = [None] * len(TRUTH)
    for name in ("way-1", "way-2"):
        labels[TRUTH.index(name)] = name
    found = discover(SEEN, DONE, labels)
    assert same_partition(found.labels, TRUTH)
    assert sorted(found.names) == ["strategy-1", "strategy-2", "way-1", "way-2"]
    assert all(
        named == true for named, true in zip(found.labels, TRUTH, strict=True) if named.startswith("way")
    )
    assert found.doubted == ()


def test_wrong_labels_are_doubted_and_right_ones_are_not() -> None:
    wrong = [TRUTH.index(name) for name in ("way-0", "way-1", "way-2", "way-3")]
    labels = [f"way-{(int(name[-1]) + 1) % 4}" if n in wrong else name for n, name in enumerate(TRUTH)]
    found = discover(SEEN, DONE, labels)
    assert sorted(found.doubted) == sorted(wrong)
    assert list(found.labels) == TRUTH


def test_a_made_name_is_never_one_that_was_given() -> None:
    labels: list[str | None] = [None] * len(TRUTH)
    labels[0] = "strategy-1"
    found = discover(SEEN, DONE, labels)
    assert len(set(found.names)) == len(found.names)
    assert found.labels[0] == "strategy-1"


def test_the_file_says_who_is_what(tmp_path: Path) -> None:
    labels = list(TRUTH)
    labels[7] = next(name for name in TRUTH if name != TRUTH[7])
    bags = [f"s01/{number:03}" for number in range(len(SEEN))]
    found = discover(SEEN, DONE, labels, bags)
    found.save(tmp_path / "strategies.json")
    kept = json.loads((tmp_path / "strategies.json").read_text())
    assert set(kept) == {"strategies", "doubted"}
    assert sum(map(len, kept["strategies"].values())) == len(SEEN)
    assert {"bag", "belief"} == set(kept["strategies"]["way-0"][0])
    assert [entry["bag"] for entry in kept["doubted"]] == ["s01/007"]
    assert kept["doubted"][0]["label"] == labels[7]
    assert kept["doubted"][0]["strategy"] == TRUTH[7]
    assert "index" in discover(SEEN, DONE).to_dict()["strategies"]["strategy-1"][0]


def test_demonstrations_come_back_under_what_was_found() -> None:
    data = demonstrations_from_arrays(SEEN, DONE, None)
    again, found = discovered(data)
    assert again.layout.labels == found.names
    assert again.step_counts().sum() == data.step_counts().sum()
    for seen, _, label in again.trajectories():
        number = next(n for n, table in enumerate(SEEN) if np.allclose(table, seen))
        assert found.labels[number] == label


@pytest.mark.parametrize(
    ("change", "blame"),
    [
        ({"actions": DONE[:3]}, "20 arrays of observations and 3 of actions"),
        ({"observations": [], "actions": []}, "there are none"),
        ({"observations": SEEN[:1], "actions": DONE[:1]}, "there is one"),
        (
            {"actions": [DONE[0][:-2], *DONE[1:]]},
            "demonstration 0: observations (121, 3) and actions (118, 2)",
        ),
        ({"actions": [*DONE[:-1], DONE[-1][:, :1]]}, "demonstration 19: 3 observation and 1 action columns"),
        ({"actions": [*DONE[:-1], np.full((120, 2), np.inf)]}, "demonstration 19: holds a number"),
        ({"observations": [SEEN[0][:2], *SEEN[1:]], "actions": [DONE[0][:1], *DONE[1:]]}, "0: 1 steps"),
        ({"labels": ["a"]}, "labels: 1 for 20 demonstrations"),
        ({"sources": ["a"]}, "sources: 1 for 20 demonstrations"),
    ],
)
def test_misuse_is_named(change: dict[str, object], blame: str) -> None:
    arguments = {"observations": SEEN, "actions": DONE, **change}
    with pytest.raises(UserError, match=re.escape(blame)):
        discover(**arguments)  # type: ignore[arg-type]


def test_wrong_labels_that_outnumber_right_ones_do_not_take_a_groups_name() -> None:
    own = [number for number, name in enumerate(TRUTH) if name == "way-3"]
    labels = list(TRUTH)
    for number in own[:3]:
        labels[number] = "way-0"
    found = discover(SEEN, DONE, labels)
    assert list(found.labels) == TRUTH
    assert found.doubted == tuple(own[:3])

"""Strokes are sorted by what they do, and labels that are wrong are doubted."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np
import pytest

from msrd_ros.contract.episode import FIRST_ACTING_STEP, Episode
from msrd_ros.core.resources import shipped_bags
from msrd_ros.learning.discovery.recheck import Recheck
from msrd_ros.learning.learned import Learned
from msrd_ros.learning.trajectories import Demonstrations
from msrd_ros.recordings.demonstrations import load_strokes
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS
from msrd_ros.table_tennis.strategies.table import Strategies
from msrd_ros.table_tennis.strokes.demonstrations import gather_demonstrations
from msrd_ros.table_tennis.strokes.discovery import STRATEGIES_FILE, describe_recheck, sort_strokes

LABELS = (ALL_LABELS[0], ALL_LABELS[4])


@pytest.fixture(scope="module")
def episodes() -> list[Episode]:
    """Nine strokes of each label, in turns."""
    return load_strokes(shipped_bags(), labels=LABELS)


def test_strokes_are_sorted_and_described(episodes: list[Episode], tmp_path: Path) -> None:
    strokes = sort_strokes([replace(episode, label=None) for episode in episodes], seed=0)
    pairs = {(shown.label, found.label) for shown, found in zip(episodes, strokes.episodes, strict=True)}
    assert len(pairs) == len(LABELS)
    assert {name for _, name in pairs} == {"strategy-1", "strategy-2"}
    strokes.save(tmp_path)
    written = json.loads((tmp_path / STRATEGIES_FILE).read_text())
    told = {stroke["bag"] for own in written["strategies"].values() for stroke in own}
    assert told == {episode.source.removeprefix("bag ") for episode in episodes}
    assert all(name in line for name, line in zip(written["does"], strokes.account(), strict=True))
    assert len({does["spin"] for does in written["does"].values()}) == len(LABELS)


def test_a_wrong_label_is_doubted(episodes: list[Episode]) -> None:
    first, *others = episodes
    wrong = next(label for label in LABELS if label != first.label)
    strokes = sort_strokes([replace(first, label=wrong), *others], seed=0)
    assert strokes.episodes[0].label == first.label
    assert strokes.discovery.doubted == (0,)
    assert (
        strokes.account()[-1]
        == f"{first.source.removeprefix('bag ')}: says {wrong}, but is rather {first.label}"
    )


def test_what_learning_takes_for_another_strategy_is_told_by_its_bag(
    episodes: list[Episode], monkeypatch: pytest.MonkeyPatch
) -> None:
    strokes = sort_strokes(episodes, seed=0)
    seen: list[Demonstrations] = []

    def judged(learned: Learned, demonstrations: Demonstrations) -> Recheck:
        seen.append(demonstrations)
        names = demonstrations.layout.labels
        own = np.array([names.index(label) for _, _, label in demonstrations.trajectories()])
        other = np.eye(2)[np.where(np.arange(len(own)) == 12, 1 - own, own)]
        return Recheck(own, other, other, names)

    monkeypatch.setattr("msrd_ros.table_tennis.strokes.discovery.recheck", judged)
    shown = gather_demonstrations(strokes.episodes, Strategies.shipped())
    told = strokes.recheck(cast(Learned, None), shown)
    assert (told["of"], told["agree_by_policies"], told["agree_by_rewards"]) == (18, 17, 17)
    (moved,) = told["moved"]
    observations, _, label = seen[0].trajectories()[12]
    episode = next(e for e in strokes.episodes if e.source == f"bag {moved['bag']}")
    assert np.allclose(episode.observations[FIRST_ACTING_STEP:][: len(observations)], observations)
    assert episode.label == label != moved["strategy"]
    assert describe_recheck(told).endswith(f"; {moved['bag']} is rather {moved['strategy']} by both")

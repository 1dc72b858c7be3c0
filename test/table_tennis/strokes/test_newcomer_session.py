"""Bags of further teachers, taken one by one, and the journal of them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

import pytest

from made_up_policies import made_up_policies
from msrd_ros.bags.reader import Bag
from msrd_ros.contract.episode import Episode
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.core.errors import UserError
from msrd_ros.core.resources import shipped_bags
from msrd_ros.learning.newcomers.newcomers import Meeting
from msrd_ros.learning.newcomers.recognition import Recognition, Verdict
from msrd_ros.recordings.episodes import read_episodes
from msrd_ros.table_tennis.strokes.newcomer_session import JOURNAL_FILE, NewcomerSession, read_journal
from msrd_ros.table_tennis.strokes.newcomers import StrokeNewcomers
from msrd_ros.table_tennis.strokes.policies import StrokePolicies
from sawyer import ROBOT

BAG = shipped_bags() / "subject_01" / "forehand-push_001"


class Met:
    """Stands in for a learned result: remembers what it met."""

    def __init__(self) -> None:
        self.robot, self.stroke_policies = ROBOT, made_up_policies()
        self.names: list[Any] = []

    def meet_strokes(self, episodes: Sequence[Episode], name: StrategyLabel | None = None) -> Meeting:
        self.names.append((len(episodes), name))
        found = Recognition(Verdict.KNOWN, 0.9, {"forehand-push": 0.9}, 0.1, 0.0, {}, 0)
        return Meeting("forehand-push", found, 0)


def session(out: Path) -> tuple[NewcomerSession, Met]:
    met = Met()

    def read(bag: Path) -> list[Episode]:
        return read_episodes(Bag(bag), demonstrations_only=True)

    return NewcomerSession(cast(StrokeNewcomers, met), out, read), met


def test_a_bag_is_met_under_its_label_and_written_down(tmp_path: Path) -> None:
    taking, met = session(tmp_path)
    taken = taking.take(BAG)
    assert met.names == [(1, "forehand-push")]
    assert str(taken).startswith("forehand-push_001 (forehand-push; forehand, ")
    assert str(taken).endswith("known: forehand-push (belief 0.90); played as forehand-push")
    written = StrokePolicies.load(tmp_path / "policies.safetensors", ROBOT)
    assert written.digest == met.stroke_policies.digest
    (row,) = json.loads((tmp_path / JOURNAL_FILE).read_text())["bags"]
    assert row["bag"] == str(BAG)
    assert row["recognition"]["verdict"] == "known"


def test_another_session_takes_the_same_bags_again(tmp_path: Path) -> None:
    first, _ = session(tmp_path)
    first.take(BAG)
    journal = json.loads((tmp_path / JOURNAL_FILE).read_text())
    journal["bags"].append({**journal["bags"][0], "bag": str(tmp_path / "gone")})
    (tmp_path / JOURNAL_FILE).write_text(json.dumps(journal))
    second, met = session(tmp_path)
    again = list(second.take_again())
    assert met.names == [(1, "forehand-push")]
    assert isinstance(again[1], UserError)
    assert "is not on this machine" in str(again[1])
    assert read_journal(tmp_path / JOURNAL_FILE) == [BAG]


def test_what_cannot_be_taken_leaves_everything_as_it_is(tmp_path: Path) -> None:
    taking, met = session(tmp_path)
    with pytest.raises(UserError, match="run the trainer where the recorder writes"):
        taking.take(tmp_path / "nothing")
    assert not met.names
    assert not list(tmp_path.iterdir())
    assert read_journal(tmp_path / JOURNAL_FILE) == []
    (tmp_path / JOURNAL_FILE).write_text('{"format": 1}')
    with pytest.raises(UserError, match="damaged journal"):
        list(taking.take_again())

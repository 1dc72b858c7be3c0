"""The table of strategies: the six by default, others from a file, and what follows from a name alone."""

from __future__ import annotations

import pickle
import re
from pathlib import Path

import numpy as np
import pytest

from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.core.errors import UserError
from msrd_ros.table_tennis.ball.feeder import Feeder
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS, Stroke
from msrd_ros.table_tennis.strategies.table import Side, SpinRange, Strategies, colour_of

SMASH, LOB = StrategyLabel.parse("my-smash"), StrategyLabel.parse("my-lob")
OWN = """
strategies:
  my-smash: {side: forehand, spin_rad_s: [120, .inf], colour: "#112233", description: "Hard"}
  forehand-push: {side: forehand, stroke: push, spin_rad_s: [-40, 40]}
  my-lob:
    stroke: lob
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "strategies.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_the_papers_six_are_the_default_in_the_order_of_training() -> None:
    shipped = Strategies.shipped()
    assert shipped.labels == ALL_LABELS
    for label in ALL_LABELS:
        assert (shipped.of(label).side, shipped.of(label).stroke) == (label.side, label.stroke)
        assert shipped.of(label).description
    assert shipped.spin_borders == (-52.5, 52.5)


def test_one_of_the_six_travels_to_other_processes() -> None:
    label = pickle.loads(pickle.dumps(ALL_LABELS[4]))
    assert (label, label.side, label.stroke) == ("backhand-slice", Side.BACKHAND, Stroke.SLICE)


@pytest.mark.parametrize("label", ALL_LABELS, ids=str)
def test_spin_speaks_of_the_nearest_stroke(label: StrategyLabel) -> None:
    stroke = Strategies.shipped().of(label).stroke
    for spin in (*np.linspace(-120.0, 120.0, 97), np.nextafter(52.5, 60.0), np.nextafter(-52.5, -60.0)):
        speaks_of = "push" if abs(spin) <= 52.5 else "topspin" if spin > 0.0 else "slice"
        assert Strategies.shipped().spin_is_right(label, spin) is (stroke == speaks_of), spin


def test_a_file_says_what_is_known_and_the_order(tmp_path: Path) -> None:
    strategies = Strategies.read(written(tmp_path, OWN))
    smash = strategies.of(SMASH)
    assert (smash.side, smash.stroke, smash.spin) == (Side.FOREHAND, "my-smash", SpinRange(120.0, np.inf))
    assert (smash.colour, smash.description) == ("#112233", "Hard")
    lob = strategies.of(LOB)
    assert (lob.side, lob.stroke, lob.spin, lob.colour) == (None, "lob", None, colour_of(LOB))
    others = [StrategyLabel.parse(text) for text in ("zz", "aa", "my-lob", "zz", "my-smash")]
    assert strategies.sort(others) == ("my-smash", "my-lob", "aa", "zz")
    assert strategies.spin_is_right(SMASH, 130.0) is True
    assert strategies.spin_is_right(SMASH, 70.0) is False
    assert strategies.spin_is_right(LOB, 70.0) is None


def test_what_follows_from_a_name_alone() -> None:
    unlisted = Strategies.shipped().of(SMASH)
    assert (unlisted.side, unlisted.spin, unlisted.stroke) == (None, None, "my-smash")
    assert re.fullmatch("#[0-9a-f]{6}", unlisted.colour)
    assert unlisted.colour == Strategies.shipped().of(SMASH).colour != colour_of(LOB)


@pytest.mark.parametrize(
    ("text", "blame"),
    [
        ("[1", "not readable"),
        ("a: 1", "no map named strategies"),
        ("{format: 2, strategies: {}}", "is of format 2, .* upgrade msrd_ros"),
        ("strategies: {Smash: {}}", "'Smash' is no strategy label"),
        ("strategies: {world: {}}", "'world' is a frame's name"),
        ("strategies: {a: {sides: x}}", "a: give some of"),
        ("strategies: {a: {side: left}}", "a: side 'left' is unknown; use one of forehand, backhand"),
        ("strategies: {a: {spin_rad_s: [2, 1]}}", "a: spin_rad_s .* is no range"),
        ("strategies: {a: {spin_rad_s: fast}}", "a: spin_rad_s 'fast' is no range"),
        ("strategies: {a: {colour: red}}", "a: colour 'red' is none"),
    ],
)
def test_a_wrong_file_is_refused_by_name(tmp_path: Path, text: str, blame: str) -> None:
    with pytest.raises(UserError, match=f"strategies.yaml: .*{blame}"):
        Strategies.read(written(tmp_path, text))


def test_a_missing_file_is_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"gone\.yaml: not readable"):
        Strategies.load(str(tmp_path / "gone.yaml"))


@pytest.mark.parametrize("side", list(Side))
def test_a_fed_ball_comes_to_the_side_it_is_fed_to(side: Side) -> None:
    state = Feeder().nominal(side).state()
    assert Side.at(state[1] + 0.5 * state[4]) is side

"""`python -m msrd_ros explain`: what it says of bags, to people and to programs."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from libraries import copy_of
from msrd_ros.__main__ import main
from msrd_ros.explain.explanation import Explanation
from msrd_ros.recordings.curation import Curation
from quick_rewards import shipped_bag

PUSH, SLICE = shipped_bag(3, "forehand-push"), shipped_bag(3, "backhand-slice")


def test_a_stroke_is_told_and_drawn(
    checkpoint: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    picture = tmp_path / "a.svg"
    assert main(["explain", str(PUSH), "--checkpoint", str(checkpoint), "--out", str(picture)]) == 0
    said = capsys.readouterr().out
    assert f"{PUSH}: forehand-push of subject_03, returned, R0 " in said
    assert "whose stroke is it: forehand-push " in said
    assert "not calibrated" in said
    assert f"drawn in {picture}" in said
    assert b"forehand-push of subject_03" in picture.read_bytes()


def test_a_program_gets_every_step(
    checkpoint: Path, unseen: list[Explanation], capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["explain", str(PUSH), str(SLICE), "--checkpoint", str(checkpoint.parent), "--json"]
    assert main(words) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["labels"] == list(unseen[0].labels)
    assert told["calibrated"] is False
    expected = next(one for one in unseen if one.episode.label == "forehand-push")
    push = told["strokes"][0]
    assert push["outcome"] == "returned"
    assert push["rank"] is None
    assert np.allclose(push["task_reward"], expected.task, atol=1e-6)
    assert np.allclose(push["strategy_rewards"], expected.strategy, atol=1e-6)
    assert np.allclose(push["paddle_m"], expected.paddle, atol=1e-6)
    assert list(push["posterior"].values()) == pytest.approx(expected.posterior().tolist())
    assert len(told["comparison"]["paddle_apart_m"]) == len(told["comparison"]["time_since_hit_s"])


def test_others_rank_and_calibrate_but_never_the_stroke_itself(
    checkpoint: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for label in ("forehand-push", "forehand-slice", "backhand-slice"):
        for number in (1, 2):
            bag = shipped_bag(3, label, number)
            shutil.copytree(bag, tmp_path / "among" / bag.name)
    own = tmp_path / "among" / PUSH.name
    words = ["explain", str(own), "--checkpoint", str(checkpoint), "--among", str(tmp_path / "among")]
    assert main([*words, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["strokes"][0]["rank"]["of"] == 1
    assert told["temperature"] >= 1.0
    assert main(words) == 0
    said = capsys.readouterr().out
    assert "of 1 other returned strokes of forehand-push" in said
    assert ("calibrated with 5 strokes" in said) == told["calibrated"]
    assert ("training knows those of --among too well" in said) != told["calibrated"]
    shutil.copytree(own, tmp_path / "alone" / PUSH.name)
    own = tmp_path / "alone" / PUSH.name
    words = ["explain", str(own), "--checkpoint", str(checkpoint), "--among", str(tmp_path / "alone")]
    assert main(words) == 2
    assert "no other returned stroke" in capsys.readouterr().err


def test_a_stroke_without_a_label_is_told_and_ranked_among_its_like(
    checkpoint: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    among = copy_of(
        "subject_03", "forehand-push_001", "forehand-push_002", "backhand-slice_001", target=tmp_path / "bags"
    )
    for name in ("forehand-push_001", "backhand-slice_001"):
        Curation(among).relabel(among / "subject_03" / name, "")
    own = among / "subject_03" / "unlabelled_001"
    words = ["explain", str(own), "--checkpoint", str(checkpoint), "--among", str(among)]
    assert main(words) == 0
    said = capsys.readouterr().out
    assert f"{own}: unlabelled of subject_03, returned, R0 " in said
    assert "of 1 other returned strokes of unlabelled" in said
    assert ("calibrated with 1 strokes" in said) or ("training knows those of --among too well" in said)
    assert main([*words, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["strokes"][0]["label"] == "unlabelled"


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ([str(PUSH), "--robot", "ur10e"], r"is of the robot sawyer, not ur10e; say --robot sawyer"),
        ([str(PUSH), "--out", "a.pdf"], "call it .svg or .png"),
        ([str(PUSH)] * 3, "3 bags: give one, or two"),
        (["nowhere"], "nowhere"),
        ([str(PUSH), "--topics", "x"], "--topics"),
    ],
)
def test_what_cannot_be_explained_is_said_in_one_line(
    checkpoint: Path, capsys: pytest.CaptureFixture[str], words: list[str], says: str
) -> None:
    assert main(["explain", *words, "--checkpoint", str(checkpoint)]) == 2
    said = capsys.readouterr().err
    assert said.startswith("explain: error: ")
    assert says in said
    assert said.count("\n") == 1

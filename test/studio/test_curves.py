"""Curves are read while they are written, run on over a resumed run, and keep their ends when thinned."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from torch.utils.tensorboard import SummaryWriter

from msrd_ros.studio.curves import MOST_POINTS, Curves, thinned
from msrd_ros.table_tennis.strokes.run import BOARD_FOLDER


def write(run: Path, name: str, values: dict[int, float]) -> SummaryWriter:
    board = SummaryWriter(str(run / BOARD_FOLDER))
    for iteration, value in values.items():
        board.add_scalar(name, value, iteration)
    board.flush()
    return board


def test_what_is_written_later_is_read_on(tmp_path: Path) -> None:
    curves = Curves(tmp_path)
    assert curves.read() == {}
    board = write(tmp_path, "training/kl", {1: 0.5})
    assert curves.read() == {"training/kl": [(1, 0.5)]}
    board.add_scalar("training/kl", 0.25, 2)
    board.close()
    assert curves.read() == {"training/kl": [(1, 0.5), (2, 0.25)]}


def test_a_resumed_run_goes_on_where_its_checkpoint_was(tmp_path: Path) -> None:
    write(tmp_path, "training/kl", {1: 1.0, 2: 2.0, 3: 3.0}).close()
    first = next((tmp_path / BOARD_FOLDER).iterdir())
    first.rename(first.with_name(f"{first.name}.0"))  # files of the same second have one name
    write(tmp_path, "training/kl", {2: 4.0, 3: 5.0}).close()
    assert Curves(tmp_path).read() == {"training/kl": [(1, 1.0), (2, 4.0), (3, 5.0)]}


@pytest.mark.parametrize("rubbish", [b"", b"no events", bytes(100)])
def test_a_file_that_is_torn_or_none_leaves_the_others(tmp_path: Path, rubbish: bytes) -> None:
    write(tmp_path, "training/kl", {1: 0.5}).close()
    (tmp_path / BOARD_FOLDER / "events.out.tfevents.9").write_bytes(rubbish)
    assert Curves(tmp_path).read() == {"training/kl": [(1, 0.5)]}


@given(st.integers(0, 3 * MOST_POINTS), st.integers(2, MOST_POINTS))
def test_thinned_keeps_both_ends_and_the_order(count: int, most: int) -> None:
    points = [(number, float(number)) for number in range(count)]
    found = thinned(points, most)
    assert len(found) == min(count, most)
    assert found == sorted(set(found))
    assert (found[:1], found[-1:]) == (points[:1], points[-1:])

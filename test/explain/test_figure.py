"""The picture: its size, formats and texts, and what its marks say."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.collections import LineCollection
from PIL import Image

from msrd_ros.core.errors import UserError
from msrd_ros.explain.explanation import Explanation, explain
from msrd_ros.explain.figure import draw, write_figure
from msrd_ros.learning.learned import Learned
from msrd_ros.table_tennis.strategies.table import Strategies
from quick_rewards import missed

TABLE = Strategies.shipped()


def texts(path: Path) -> list[str]:
    """All texts of an SVG file."""
    tree = ElementTree.parse(path)
    return ["".join(node.itertext()).strip() for node in tree.iter("{http://www.w3.org/2000/svg}text")]


@pytest.mark.parametrize("count", [1, 2])
def test_a_png_is_1280_by_800(unseen: list[Explanation], tmp_path: Path, count: int) -> None:
    path = tmp_path / "out" / "picture.png"
    write_figure(path, unseen[:count], ["title"] * count, TABLE)
    with Image.open(path) as picture:
        assert picture.size == (1280, 800)
        assert len(set(picture.convert("L").tobytes())) > 50


@pytest.mark.parametrize("count", [1, 2])
def test_an_svg_says_what_is_seen_and_in_which_units(
    unseen: list[Explanation], tmp_path: Path, count: int
) -> None:
    titles = ["the first stroke", "the second stroke"][:count]
    write_figure(tmp_path / "a.svg", unseen[:count], titles, TABLE)
    found = texts(tmp_path / "a.svg")
    for title in titles:
        assert title in found
    for text in ("x, m", "y, m", "z, m", "time since hit, s", "share, % (not calibrated)"):
        assert found.count(text) >= count, text
    together = "".join("".join(found).split())
    assert "taskreward" in together
    assert "ofastep(nounit)" in together
    for label in unseen[0].labels:
        assert found.count(label) == count
    write_figure(tmp_path / "b.svg", unseen[:count], titles, TABLE)
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()


def test_a_calibrated_share_says_so_and_is_its_bar(unseen: list[Explanation], tmp_path: Path) -> None:
    write_figure(tmp_path / "a.svg", unseen[:1], ["x"], TABLE, temperature=40.0)
    found = texts(tmp_path / "a.svg")
    assert "share, % (calibrated)" in found
    for share in unseen[0].posterior(40.0):
        assert f"{100 * share:.0f} %" in found


def test_paths_have_the_colours_of_r0_on_one_scale(unseen: list[Explanation]) -> None:
    figure = draw(unseen[:2], ["a", "b"], TABLE)
    lines = [
        collection
        for axes in figure.axes
        for collection in axes.collections
        if isinstance(collection, LineCollection) and collection.get_array() is not None
    ]
    assert len(lines) == 8
    assert len({(line.norm.vmin, line.norm.vmax) for line in lines}) == 1
    for one in unseen[:2]:
        own = [line for line in lines if np.array_equal(np.asarray(line.get_array()), one.task[1:])]
        assert len(own) == 4
    shown = np.concatenate([one.task for one in unseen[:2]])
    assert (lines[0].norm.vmin, lines[0].norm.vmax) == (shown.min(), shown.max())


def test_a_stroke_that_missed_is_not_said_to_hit(
    learned: Learned, unseen: list[Explanation], tmp_path: Path
) -> None:
    lost = explain(learned, missed(unseen[0].episode))
    write_figure(tmp_path / "a.svg", [lost], ["x"], TABLE)
    found = texts(tmp_path / "a.svg")
    assert "hit" not in found
    assert "nearest" in found


@pytest.mark.parametrize("name", ["a.pdf", "a", "svg"])
def test_other_formats_are_refused(unseen: list[Explanation], tmp_path: Path, name: str) -> None:
    with pytest.raises(UserError, match=r"no picture of this kind; call it \.svg or \.png"):
        write_figure(tmp_path / name, unseen[:1], ["x"], TABLE)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("count", [0, 3])
def test_one_or_two_strokes_are_drawn(unseen: list[Explanation], tmp_path: Path, count: int) -> None:
    with pytest.raises(UserError, match=f"{count} strokes"):
        write_figure(tmp_path / "a.svg", unseen[:count], ["x"] * count, TABLE)

"""Reach: what is inside, and the nearest place to what is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from msrd_ros.core.errors import UserError
from msrd_ros.table_tennis.strokes.reach import Reach, read_point, require_on_table, say_point

HITS = np.array([[True, True, False], [False, True, False]])
REACH = replace(Reach.grid([0.4, 0.8], [-0.3, 0.0, 0.3]), hits=HITS)


def test_each_target_stands_for_the_rectangle_around_it() -> None:
    for point in ((0.4, -0.3), (0.2, -0.45), (0.59, 0.14), (1.0, 0.15)):
        REACH.require(point, "push")
    np.testing.assert_array_equal(REACH.targets, [[0.4, -0.3], [0.4, 0.0], [0.8, 0.0]])


@pytest.mark.parametrize(
    ("point", "nearest"),
    [
        ((0.7, -0.3), (0.6, -0.3)),
        ((0.1, 0.0), (0.2, 0.0)),
        ((0.8, 0.4), (0.8, 0.15)),
        ((1.3, 0.7), (1.0, 0.15)),
    ],
)
def test_what_is_out_of_reach_is_refused_with_the_nearest_that_is_not(
    point: tuple[float, float], nearest: tuple[float, float]
) -> None:
    found = REACH.nearest(point)
    assert found is not None
    np.testing.assert_allclose(found, np.array(nearest))
    assert REACH.holds(found)
    assert not REACH.holds(point)
    said = f"target {say_point(point)} is out of reach of push; .* {say_point(nearest)}"
    with pytest.raises(UserError, match=said):
        REACH.require(point, "push")


@given(st.tuples(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0)))
def test_the_nearest_is_in_reach_and_nothing_tried_is_nearer(point: tuple[float, float]) -> None:
    nearest = REACH.nearest(point)
    assert nearest is not None
    REACH.require(nearest, "push")
    apart = np.linalg.norm(REACH.targets - point, axis=1).min()
    assert np.linalg.norm(nearest - point) <= apart + 1e-12


def test_where_nothing_is_in_reach_there_is_no_nearest() -> None:
    empty = Reach.grid([0.4, 0.8], [-0.3, 0.3])
    assert empty.nearest((0.4, -0.3)) is None
    with pytest.raises(UserError, match="push hits no target reliably; leave it out"):
        empty.require((0.4, -0.3), "push")


def test_a_drawn_point_is_in_reach() -> None:
    rng = np.random.default_rng(0)
    drawn = [REACH.draw(rng) for _ in range(50)]
    assert all(map(REACH.holds, drawn))
    assert np.ptp(drawn, axis=0).min() > 0.3


def test_a_said_point_reads_back() -> None:
    found = read_point(say_point((0.4, -0.25)))
    assert found is not None
    np.testing.assert_array_equal(found, [0.4, -0.25])
    assert read_point("") is None


def test_json_reads_back() -> None:
    again = Reach.from_json(REACH.to_json(), "x")
    np.testing.assert_array_equal(again.hits, HITS)
    np.testing.assert_array_equal(again.points, REACH.points)


@pytest.mark.parametrize("point", [(-0.1, 0.0), (1.4, 0.0), (0.5, 0.8), (0.5, -0.8)])
def test_a_point_off_the_far_half_is_refused_with_the_nearest_on_it(point: tuple[float, float]) -> None:
    require_on_table((0.5, 0.0), "here")
    with pytest.raises(UserError, match=r"here: .* is not on the far half of the table; the nearest point"):
        require_on_table(point, "here")
    with pytest.raises(UserError, match="not finite"):
        require_on_table((np.nan, 0.0), "here")

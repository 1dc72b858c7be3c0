"""Test sets have the published spread, and their parts equal shares where there are enough."""

from __future__ import annotations

import numpy as np

from msrd_ros.studies.lunar_lander.drawing import CRASHED_BELOW, LANDED_ABOVE, draw


def pool(counts: list[tuple[int, int, int]]) -> tuple[np.ndarray, np.ndarray]:
    """True returns and sources of so many crashed, landed and other trajectories from each source."""
    truth, source = [], []
    for index, (low, high, between) in enumerate(counts):
        truth += [-30_000.0] * low + [20_000.0] * high + [0.0] * between
        source += [index] * (low + high + between)
    return np.array(truth), np.array(source)


def shares(truth: np.ndarray) -> tuple[int, int]:
    return int((truth < CRASHED_BELOW).sum()), int((truth > LANDED_ABOVE).sum())


def test_every_kind_comes_from_all_sources_alike() -> None:
    truth, source = pool([(100, 100, 400)] * 3)
    rows = draw(truth, truth == 0.0, source, 300, np.random.default_rng(0))
    assert len(set(rows.tolist())) == 300
    assert shares(truth[rows]) == (60, 30)
    assert np.bincount(source[rows]).tolist() == [100, 100, 100]
    for low in (truth < CRASHED_BELOW, truth > LANDED_ABOVE):
        assert len(set(np.bincount(source[rows][low[rows]]).tolist())) == 1


def test_where_a_source_has_too_few_the_others_make_up_for_it() -> None:
    truth, source = pool([(100, 0, 400), (100, 100, 400), (5, 100, 400)])
    rows = draw(truth, truth == 0.0, source, 300, np.random.default_rng(0))
    assert shares(truth[rows]) == (60, 30)
    landed = source[rows][truth[rows] > LANDED_ABOVE]
    assert np.bincount(landed, minlength=3).tolist() == [0, 15, 15]
    crashed = source[rows][truth[rows] < CRASHED_BELOW]
    assert sorted(np.bincount(crashed, minlength=3).tolist()) == [5, 27, 28]


def test_where_all_have_too_few_the_set_is_still_full() -> None:
    truth, source = pool([(2, 0, 20), (2, 0, 20), (40, 0, 5)])
    rows = draw(truth, truth == 0.0, source, 60, np.random.default_rng(0))
    assert len(set(rows.tolist())) == 60
    assert shares(truth[rows])[1] == 0
    assert (truth[rows] == 0.0).sum() == 45


def test_what_lies_between_neither_crashed_nor_rested_while_there_is_such() -> None:
    truth, source = pool([(100, 100, 400)] * 3)
    middle = truth == 0.0
    middle[np.flatnonzero(middle)[::2]] = False  # a late crash
    rows = draw(truth, middle, source, 300, np.random.default_rng(0))
    assert middle[rows].sum() == 210
    truth, source = pool([(100, 100, 80)] * 3)
    middle = (truth == 0.0) & (source > 0)
    rows = draw(truth, middle, source, 300, np.random.default_rng(0))
    assert middle[rows].sum() == 160
    assert shares(truth[rows]) == (60, 30)  # late crashes stand in, not early ones


def test_the_seed_decides() -> None:
    truth, source = pool([(100, 100, 400)] * 3)
    first, again, other = (
        draw(truth, truth == 0.0, source, 200, np.random.default_rng(seed)) for seed in (1, 1, 2)
    )
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)

"""Bags of earlier versions give the arrays that they gave there, and those of newer ones are refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from msrd_ros.bags.reader import Bag
from msrd_ros.recordings.episodes import read_episodes

EARLIER = Path(__file__).parents[1] / "data" / "0.1.0" / "bags"


def test_a_bag_of_0_1_0_gives_the_arrays_that_it_gave_there() -> None:
    (episode,) = read_episodes(Bag(EARLIER / "subject_01" / "backhand-slice_001"))
    assert (episode.label, episode.subject) == ("backhand-slice", "subject_01")
    with np.load(EARLIER / "subject_01_backhand-slice_001.npz") as expected:
        np.testing.assert_array_equal(episode.observations, expected["observations"])
        np.testing.assert_array_equal(episode.actions, expected["actions"])

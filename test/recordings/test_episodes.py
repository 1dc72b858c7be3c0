"""Bags of earlier versions give the arrays that they gave there, and those of newer ones are refused."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from msrd_ros.bags.metadata import FORMAT_KEY, METADATA_FILE
from msrd_ros.bags.reader import Bag
from msrd_ros.core.errors import UserError
from msrd_ros.recordings.episodes import read_episodes

EARLIER = Path(__file__).parents[1] / "data" / "0.1.0" / "bags"
STROKE = EARLIER / "subject_01" / "backhand-slice_001"


def test_a_bag_of_0_1_0_gives_the_arrays_that_it_gave_there() -> None:
    (episode,) = read_episodes(Bag(STROKE))
    assert (episode.label, episode.subject) == ("backhand-slice", "subject_01")
    with np.load(EARLIER / "subject_01_backhand-slice_001.npz") as expected:
        np.testing.assert_array_equal(episode.observations, expected["observations"])
        np.testing.assert_array_equal(episode.actions, expected["actions"])


@pytest.mark.parametrize(
    ("stated", "says"), [("2", "is of format 2, .* upgrade msrd_ros"), ("x", "is no version")]
)
def test_a_bag_of_a_newer_format_is_refused_by_name(tmp_path: Path, stated: str, says: str) -> None:
    path = Path(shutil.copytree(STROKE, tmp_path / STROKE.name))
    metadata = (path / METADATA_FILE).read_text(encoding="utf-8")
    assert metadata.count("  custom_data:\n") == 1
    stating = metadata.replace("  custom_data:\n", f"  custom_data:\n    {FORMAT_KEY}: '{stated}'\n")
    (path / METADATA_FILE).write_text(stating, encoding="utf-8")
    with pytest.raises(UserError, match=rf"{STROKE.name}: .*{says}"):
        Bag(path)

"""A folder of bags of all sorts, and the data sets that were made of it."""

from __future__ import annotations

from pathlib import Path

import pytest

from exchanged_bags import Exported, mixed_folder
from msrd_ros.recordings.exchange.exporting import export_bags
from msrd_ros.recordings.exchange.kinds import KINDS
from sawyer import ROBOT


@pytest.fixture(scope="package")
def bags(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with bags of all sorts."""
    return mixed_folder(tmp_path_factory.mktemp("exchange") / "bags")


@pytest.fixture(scope="package")
def exported(bags: Path) -> Exported:
    """A data set of each kind, and what it was said to hold."""
    found = {}
    for kind in KINDS:
        target = bags.parent / kind / "strokes-v0"
        found[kind] = target, export_bags(bags, target, kind, ROBOT, {})
    return found

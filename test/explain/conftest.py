"""Rewards that two subjects' strokes gave, and the strokes of a third one."""

from __future__ import annotations

from pathlib import Path

import pytest

from msrd_ros.explain.explanation import Explanation, explain, load_rewards
from msrd_ros.learning.learned import Learned
from quick_rewards import shipped_strokes, write_checkpoint
from sawyer import ROBOT


@pytest.fixture(scope="session")
def checkpoint(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What a trainer leaves in its folder."""
    path = tmp_path_factory.mktemp("run") / "checkpoint.safetensors"
    return write_checkpoint(path, [*shipped_strokes(1), *shipped_strokes(2)])


@pytest.fixture(scope="session")
def learned(checkpoint: Path) -> Learned:
    """Its rewards."""
    return load_rewards(checkpoint, ROBOT)


@pytest.fixture(scope="session")
def unseen(learned: Learned) -> list[Explanation]:
    """One stroke of each label by a subject whom training has not seen."""
    return [explain(learned, episode) for episode in shipped_strokes(3)]

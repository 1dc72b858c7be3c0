"""Two made-up episodes that LeRobot itself wrote into ``test/data/lerobot``; ours has to write them alike.

Run as a program in LeRobot's own environment (``make test-lerobot`` makes it), this is what wrote them:

    .venv-lerobot/bin/python test/helpers/lerobot_problem.py test/data/lerobot
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray

FPS = 50
ROBOT = "made_up_arm"
TASKS = ("low-swing", "high-swing")
LENGTHS = (20, 25)
FEATURES: dict[str, dict[str, Any]] = {
    "observation.state": {"dtype": "float32", "shape": (3,), "names": ["j0", "j1", "j2"]},
    "observation.environment_state": {"dtype": "float32", "shape": (2,), "names": ["x", "y"]},
    "action": {"dtype": "float32", "shape": (3,), "names": ["j0", "j1", "j2"]},
}


def episode(number: int) -> dict[str, NDArray[np.float32]]:
    """Rows of an episode by feature, shape (T, width)."""
    rng = np.random.default_rng(number)
    return {
        name: rng.normal(1.0, 2.0, (LENGTHS[number], *feature["shape"])).astype(np.float32)
        for name, feature in FEATURES.items()
    }


def main(target: str) -> None:
    """Have LeRobot write the episodes."""
    from lerobot.datasets.lerobot_dataset import LeRobotDataset

    dataset = LeRobotDataset.create("made/up", FPS, FEATURES, target, ROBOT, use_videos=False)
    for number, task in enumerate(TASKS):
        rows = episode(number)
        for step in range(LENGTHS[number]):
            dataset.add_frame({**{name: values[step] for name, values in rows.items()}, "task": task})
        dataset.save_episode()
    dataset.finalize()


if __name__ == "__main__":
    main(sys.argv[1])

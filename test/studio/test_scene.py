"""What is drawn of the arm and the ball: what is seen to change, and no more."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from msrd_ros.robots.loading import default_robot
from msrd_ros.studio.scene import Picture, TableScene

ROBOT = default_robot()
PICTURE = Picture(
    ROBOT.home_rad, np.array([0.5, 0.0, 1.0]), np.linspace([0.0, 0.0, 1.0], [0.5, 0.0, 1.0], 30), np.ones(3)
)


class Counted(TableScene):
    """Counts what it sends."""

    sent = 0


@pytest.fixture
def scene() -> Iterator[Counted]:
    made = Counted(ROBOT)
    queue = made.viser.server.scene._queue_scene_message

    def count(message: object) -> None:
        made.sent += 1
        queue(message)  # type: ignore[arg-type]

    made.viser.server.scene._queue_scene_message = count  # type: ignore[method-assign]
    made.show(PICTURE)
    made.sent = 0
    yield made
    made.close()


def test_a_picture_that_is_the_last_one_is_not_sent(scene: Counted) -> None:
    scene.show(PICTURE)
    trembles = PICTURE._replace(joint_position=ROBOT.home_rad + 1e-4, ball=np.array([0.5, 0.0, 1.0005]))
    scene.show(trembles)
    assert scene.sent == 0


@pytest.mark.parametrize(
    "news",
    [
        {"joint_position": ROBOT.home_rad + 0.01},
        {"ball": np.array([0.52, 0.0, 1.0])},
        {"ball": None},
        {"spin": np.array([0.0, 50.0, 0.0])},
        {"target": np.array([0.5, 0.1])},
    ],
)
def test_what_changes_is_sent(scene: Counted, news: dict[str, np.ndarray | None]) -> None:
    scene.show(PICTURE._replace(**news))  # type: ignore[arg-type]
    assert scene.sent > 0


def test_what_creeps_is_sent_once_it_has_come_far_enough(scene: Counted) -> None:
    for step in range(20):
        scene.show(PICTURE._replace(joint_position=ROBOT.home_rad + 1e-4 * step))
    assert scene.sent > 0

"""What is seen of the ball: exactly where it waits, then what the camera shows."""

from __future__ import annotations

import numpy as np
import pytest

from msrd_ros.contract.translation import NANOSECONDS
from msrd_ros.core.errors import UserError
from msrd_ros.table_tennis.ball.camera import CameraConfig
from msrd_ros.table_tennis.ball.feeder import Feed
from msrd_ros.table_tennis.simulation.seen_ball import EPOCH_NS, Sample, SeenBall, simulated_ns

PLACE = np.array([1.5, 0.1, 1.06])


def flown(seen: SeenBall, number: int) -> list[Sample]:
    """Samples of a ball that stays where it is launched, every 20 ms."""
    seen.wait_at(PLACE)
    launch_ns = simulated_ns(2.0)
    seen.launch(launch_ns, number)
    samples = []
    for step in range(1, 101):
        seen.offer(step / 1000.0, PLACE)
        if step % 20 == 0:
            samples.append(seen.look(launch_ns + step * NANOSECONDS // 1000, in_play=True))
    return samples


def test_a_ball_that_waits_is_seen_where_it_is() -> None:
    seen = SeenBall(CameraConfig(noise_std_m=0.01), 3)
    assert not seen.wait_at(PLACE)
    assert seen.wait_at(PLACE.copy())
    stamp_ns, position = seen.look(simulated_ns(0.5), in_play=False)
    assert stamp_ns == EPOCH_NS + NANOSECONDS // 2
    np.testing.assert_array_equal(position, PLACE)


def test_noise_follows_from_seed_and_number_alone() -> None:
    seen = SeenBall(CameraConfig(noise_std_m=0.01), 3)
    first, other, again = flown(seen, 1), flown(seen, 2), flown(seen, 1)
    assert [sample.stamp_ns for sample in first] == [sample.stamp_ns for sample in again]
    np.testing.assert_array_equal([s.position for s in first], [s.position for s in again])
    assert not np.array_equal([s.position for s in first], [s.position for s in other])
    assert np.abs([sample.position - PLACE for sample in first]).max() > 0.001


def test_a_better_camera_counts_from_the_next_ball_on() -> None:
    seen = SeenBall(CameraConfig(noise_std_m=0.01), 3)
    seen.change_camera(CameraConfig(noise_std_m=0.0))
    np.testing.assert_array_equal([s.position for s in flown(seen, 1)], [PLACE] * 5)


def test_a_feed_that_is_not_finite_is_not_launched() -> None:
    with pytest.raises(UserError, match="not finite"):
        Feed((1.5, 0.0, 1.06), (float("nan"), 0.0, 0.0), (0.0, 0.0, 0.0)).launched()

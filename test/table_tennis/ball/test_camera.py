"""The camera: rate, noise, latency, dropout, and that a seed repeats it."""

from __future__ import annotations

import numpy as np
import pytest

from msrd_ros.core.errors import UserError
from msrd_ros.table_tennis.ball.camera import BallSample, Camera, CameraConfig

VELOCITY = np.array([-3.0, 0.5, 1.0])


def watch(
    config: CameraConfig, seed: int = 0, duration: float = 1.0, period: float = 0.001
) -> list[BallSample]:
    """Distinct samples that a reader sees who looks after every step of `period` s."""
    camera = Camera(config, np.random.default_rng(seed))
    samples: list[BallSample] = []
    for index in range(round(duration / period) + 1):
        camera.offer(index * period, VELOCITY * index * period)
        newest = camera.newest(index * period)
        if newest is not None and (not samples or newest.stamp != samples[-1].stamp):
            samples.append(newest)
    return samples


@pytest.mark.parametrize("rate", [200.0, 120.0, 250.0, 1000.0])
@pytest.mark.parametrize("period", [0.001, 0.004])
def test_frames_come_at_the_rate_and_show_the_ball_where_it_was(rate: float, period: float) -> None:
    config = CameraConfig(rate_hz=rate, noise_std_m=0.0)
    camera = Camera(config, np.random.default_rng(0))
    seen: dict[float, np.ndarray] = {}
    for index in range(round(1.0 / period) + 1):
        camera.offer(index * period, VELOCITY * index * period)
        newest = camera.newest(index * period)
        assert newest is not None
        assert newest.stamp <= index * period + 1e-9
        assert newest.stamp > index * period - 1.0 / rate - 1e-9
        seen[newest.stamp] = newest.position
    assert len(seen) == min(round(rate), round(1.0 / period)) + 1
    for stamp, position in seen.items():
        np.testing.assert_allclose(position, VELOCITY * stamp, atol=1e-12)
        assert stamp * rate == pytest.approx(round(stamp * rate), abs=1e-6)


def test_noise_has_the_stated_size_and_no_bias() -> None:
    samples = watch(CameraConfig(rate_hz=1000.0, noise_std_m=0.002), duration=4.0)
    errors = np.array([sample.position - VELOCITY * sample.stamp for sample in samples])
    np.testing.assert_allclose(errors.std(axis=0), 0.002, rtol=0.06)
    np.testing.assert_allclose(errors.mean(axis=0), 0.0, atol=1.5e-4)
    assert abs(np.corrcoef(errors[:-1, 0], errors[1:, 0])[0, 1]) < 0.06


def test_latency_delays_what_is_seen_but_not_its_stamp() -> None:
    camera = Camera(CameraConfig(noise_std_m=0.0, latency_s=0.012), np.random.default_rng(0))
    for index in range(101):
        time = index * 0.001
        camera.offer(time, VELOCITY * time)
        newest = camera.newest(time)
        if index < 12:
            assert newest is None
        else:
            assert newest is not None
            assert newest.stamp == pytest.approx(((index - 12) // 5) * 0.005)
            np.testing.assert_allclose(newest.position, VELOCITY * newest.stamp, atol=1e-12)


def test_lost_frames_leave_the_last_one_standing() -> None:
    full = watch(CameraConfig(), seed=3, duration=10.0)
    thinned = watch(CameraConfig(dropout=0.3), seed=3, duration=10.0)
    assert len(thinned) / len(full) == pytest.approx(0.7, abs=0.04)
    kept = {sample.stamp: sample.position for sample in full}
    for sample in thinned:
        # The same seed, the same noise: losing frames does not shift the draws.
        np.testing.assert_array_equal(sample.position, kept[sample.stamp])


def test_a_seed_repeats_the_noise() -> None:
    first, again, other = (watch(CameraConfig(), seed=seed, duration=0.2) for seed in (1, 1, 2))
    for left, right in zip(first, again, strict=True):
        assert left.stamp == right.stamp
        np.testing.assert_array_equal(left.position, right.position)
    assert not np.array_equal(first[5].position, other[5].position)


def test_a_restart_forgets_the_ball_before() -> None:
    camera = Camera(CameraConfig(noise_std_m=0.0), np.random.default_rng(0))
    camera.offer(0.0, np.zeros(3))
    camera.offer(0.102, np.ones(3))
    camera.restart(0.102)
    assert camera.newest(0.2) is None
    camera.offer(0.102, np.full(3, 5.0))
    assert camera.newest(0.102) is None
    camera.offer(0.108, np.full(3, 5.0))
    sample = camera.newest(0.108)
    assert sample is not None
    assert sample.stamp == pytest.approx(0.105)
    np.testing.assert_array_equal(sample.position, 5.0)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("rate_hz", 0.0),
        ("rate_hz", float("nan")),
        ("noise_std_m", -1.0),
        ("latency_s", -0.1),
        ("dropout", 1.0),
    ],
)
def test_impossible_settings_are_refused_by_name(name: str, value: float) -> None:
    with pytest.raises(UserError, match=name):
        CameraConfig(**{name: value})

"""Statistics: of pictures as of any numbers, and of all episodes together as of their rows."""

from __future__ import annotations

import numpy as np

from msrd_ros.recordings.exchange.statistics import episode_statistics, picture_statistics, pooled

RNG = np.random.default_rng(0)


def test_pictures_are_numbers_within_0_and_1() -> None:
    frames = RNG.integers(3, 250, (4, 6, 8, 3), dtype=np.uint8)
    pixels = episode_statistics(frames.reshape(-1, 3) / 255.0)
    found = picture_statistics(frames)
    assert found.keys() == pixels.keys()
    assert found["count"] == [4]
    for key in pixels.keys() - {"count"}:
        assert found[key].shape == (3, 1, 1)
        np.testing.assert_allclose(found[key].reshape(3), pixels[key], atol=1e-12)


def test_episodes_of_any_lengths_are_put_together() -> None:
    parts = [RNG.normal(size=(length, 2)) for length in (5, 40, 1)]
    found, rows = pooled([episode_statistics(part) for part in parts]), np.concatenate(parts)
    assert found["count"] == [46]
    for key, value in {
        "min": rows.min(0),
        "max": rows.max(0),
        "mean": rows.mean(0),
        "std": rows.std(0),
    }.items():
        np.testing.assert_allclose(found[key], value, atol=1e-12)


def test_quantiles_are_samples() -> None:
    found = episode_statistics(np.arange(1.0, 101.0)[:, None])
    assert [float(found[key][0]) for key in ("q01", "q10", "q50", "q90", "q99")] == [1, 10, 50, 90, 99]

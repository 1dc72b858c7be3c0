"""The estimate of a flight says how sure it is, and is as sure as it may be."""

from __future__ import annotations

import numpy as np

from msrd_ros.table_tennis.ball.estimator import EstimatorConfig, FlightEstimator
from msrd_ros.table_tennis.ball.feeder import Feeder
from msrd_ros.table_tennis.ball.scene import Scene
from msrd_ros.table_tennis.ball.trajectory import ball_path
from msrd_ros.table_tennis.strategies.table import Side

SCENE = Scene().constants()
NOISE_M = 0.002
PERIOD_S = 0.005


def _seen(ball: np.ndarray, samples: int, rng: np.random.Generator) -> FlightEstimator:
    estimator = FlightEstimator(SCENE, EstimatorConfig(sample_sd_m=NOISE_M))
    path = ball_path(ball, PERIOD_S, samples, SCENE)[:, :3]
    for row, position in enumerate(path):
        estimator.see(row * PERIOD_S, position + NOISE_M * rng.standard_normal(3))
    for _ in range(3):
        estimator.estimate()
    return estimator


def test_errors_are_as_large_as_said() -> None:
    rng, feeder = np.random.default_rng(3), Feeder()
    nominal = feeder.nominal(Side.FOREHAND).state()
    later = 0.4
    shares = []
    for _ in range(60):
        ball = nominal.copy()
        # What the estimator expects of feeds.
        ball[6:] += rng.normal(0.0, 1.0, 3) * np.array([5.0, 20.0, 5.0])
        estimator = _seen(ball, 40, rng)
        begin = estimator.first_seen_s
        assert begin is not None
        guess = estimator.estimate()
        assert guess is not None
        there = ball_path(guess, 0.001, round(later / 0.001) + 1, SCENE)[-1, :3]
        truth = ball_path(ball, 0.001, round((begin + later) / 0.001) + 1, SCENE)[-1, :3]
        sd = estimator.position_sd(later)
        assert sd is not None
        shares.append((there - truth) / sd)
    assert 0.7 < np.sqrt(np.mean(np.square(shares))) < 1.4


def test_more_samples_make_it_surer_and_the_future_less_sure() -> None:
    ball = Feeder().nominal(Side.FOREHAND).state()
    few, many = (_seen(ball, count, np.random.default_rng(5)) for count in (15, 60))
    early, late = few.position_sd(0.2), few.position_sd(0.6)
    surer = many.position_sd(0.6)
    assert early is not None
    assert late is not None
    assert surer is not None
    assert (early < late).all()
    assert (surer < late).all()


def test_before_the_first_estimate_nothing_is_said() -> None:
    assert FlightEstimator(SCENE).position_sd(0.5) is None

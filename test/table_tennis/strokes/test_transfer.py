"""Recorded strokes against balls that their teacher never met."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from made_up_policies import made_up_policies
from msrd_ros.contract.episode import ACTING_STEPS, CONTROL_PERIOD_S, FIRST_ACTING_STEP, HORIZON
from msrd_ros.table_tennis.strokes.transfer import Motions, depart, departure_of, nearest_weights
from sawyer import ROBOT

STATES = HORIZON + 1 - FIRST_ACTING_STEP
POLICIES = made_up_policies()
BASE = POLICIES.policies.policy("forehand-push")
READY = next(iter(POLICIES.facts.values())).ready_pose


def balls(count: int, seed: int = 0) -> NDArray[np.float64]:
    return np.random.default_rng(seed).normal(size=(count, 1, 6)) + np.zeros((count, STATES, 6))


def base(observations: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(BASE.act(observations), dtype=np.float64)


def transfer(shown: NDArray[np.float64], ball: NDArray[np.float64]) -> Motions:
    return depart(ROBOT, base, READY, departure_of(ROBOT, base, READY, shown), ball)


def played(ball: NDArray[np.float64], offset: NDArray[np.float64]) -> NDArray[np.float64]:
    """What the base does against balls, its joints displaced: observations ``[M, T+1, N+6]``."""
    shown = transfer(np.concatenate([np.zeros((1, STATES, 7)), ball[:1]], axis=2), ball)
    own = shown.observations.copy()
    plain = transfer(own, ball).observations
    plain[..., :7] += offset
    return plain


def test_the_recorded_ball_gives_the_recorded_motion_back() -> None:
    ball = balls(1)
    recorded = played(ball, 0.05 * np.sin(np.linspace(0.0, 3.0, STATES))[None, :, None] * np.ones(7))
    motions = transfer(recorded, ball)
    acting = slice(0, ACTING_STEPS + 1)
    assert np.allclose(motions.observations[:, acting], recorded[:, acting], atol=1e-9)
    steps = np.diff(recorded[0, acting, :7], axis=0) / (CONTROL_PERIOD_S * ROBOT.limits.speed_rad_s)
    assert np.allclose(motions.actions[0], np.clip(steps, -1.0, 1.0), atol=1e-9)


def test_another_ball_gets_what_the_base_does_there_displaced_alike() -> None:
    first, other = balls(1), balls(2, seed=1)
    recorded = played(first, np.full(7, 0.02))
    there = transfer(recorded, other)
    plain = transfer(played(first, np.zeros(7)), other)
    assert np.allclose(there.observations[..., :7] - plain.observations[..., :7], 0.02, atol=1e-9)
    assert np.array_equal(there.observations[..., 7:], other)
    assert np.abs(there.actions).max() <= 1.0


def test_departures_of_several_recordings_are_averaged() -> None:
    ball = np.concatenate([balls(1), balls(1)])
    recorded = played(ball, np.full(7, 0.02))
    recorded[1, :, :7] += 0.02
    motions = transfer(recorded, balls(1))
    plain = transfer(played(balls(1), np.zeros(7)), balls(1))
    assert np.allclose(motions.observations[..., :7] - plain.observations[..., :7], 0.03, atol=1e-9)


def test_nearest_weights_are_those_that_the_actions_were_made_with() -> None:
    names = ("forehand-push", "forehand-slice", "forehand-topspin")
    policies = [POLICIES.policies.policy(name) for name in names]
    seen = np.random.default_rng(2).normal(size=(2, STATES, 13))
    done = 0.3 * policies[0].act(seen) + 0.7 * policies[2].act(seen)
    weights = nearest_weights(policies, seen, np.asarray(done[:, :ACTING_STEPS], dtype=np.float64))
    assert weights["forehand-push"] == pytest.approx(0.3, abs=1e-3)
    assert weights["forehand-topspin"] == pytest.approx(0.7, abs=1e-3)
    assert sum(weights.values()) == pytest.approx(1.0)

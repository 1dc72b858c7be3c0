"""Repeated rollouts: the same again without offsets, nearer to their targets with each that is kept."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from msrd_ros.core.resources import share_directory
from msrd_ros.table_tennis.simulation.batched import RallyVariation
from msrd_ros.table_tennis.strokes.batched_play import batch_policy, make_simulator
from msrd_ros.table_tennis.strokes.corrected_rollouts import (
    MOST_SPIN_RAD_S,
    Corrected,
    CorrectionConfig,
    Feeds,
    RepeatedRallies,
    correct,
    fit_response,
)
from msrd_ros.table_tennis.strokes.policies import StrokePolicies

pytestmark = pytest.mark.slow

COUNT = 80
CONFIG = CorrectionConfig(repetitions=6)


@cache
def shipped() -> StrokePolicies:
    return StrokePolicies.load(share_directory() / "config" / "robots" / "sawyer" / "policies.safetensors")


def rallies(seed: int) -> RepeatedRallies:
    """New feeds for all six strokes, seen exactly."""
    simulator = make_simulator(shipped(), RallyVariation(camera_noise_m=0.0), 1)
    rng = np.random.default_rng(seed)
    balls = [
        simulator.config.feeder.sample_states(plan.side, simulator.config.variation.feed_spread, COUNT, rng)
        for plan in simulator.plans
    ]
    ready = np.stack([np.tile(plan.ready_position, (COUNT, 1)) for plan in simulator.plans])
    return RepeatedRallies(simulator, Feeds(np.stack(balls), ready), CONFIG)


@cache
def corrected() -> tuple[Corrected, np.ndarray, np.ndarray]:
    """Rollouts, their targets, and how they ended before."""
    rng = np.random.default_rng(0)
    act = batch_policy(shipped(), np.empty(0))
    response = fit_response(rallies(1), act, CONFIG, rng)
    targets = rng.uniform((0.4, -0.4), (1.1, 0.4), (6, COUNT, 2))
    again = rallies(2)
    before, _ = again.play(act)
    return correct(again, act, targets, response, CONFIG, rng), targets, before.answer


def test_without_offsets_a_rally_ends_as_it_did() -> None:
    act, again = batch_policy(shipped(), np.empty(0)), rallies(3)
    first, seen = again.play(act)
    again.place_bumps(first.hit_step)
    second, seen_again = again.repeat(np.zeros(again.weights_shape))
    np.testing.assert_array_equal(first.answer, second.answer)
    np.testing.assert_array_equal(seen.observations, seen_again.observations)
    assert first.returned.mean() > 0.9


def test_balls_come_to_their_targets() -> None:
    found, targets, before = corrected()
    apart = np.linalg.norm(found.landed.landing - targets, axis=-1)
    assert np.nanmean(np.linalg.norm(before[..., :2] - targets, axis=-1)) > 0.25
    assert (apart < 0.1).mean() > 0.9


def test_spin_stays_and_the_middle_of_the_blade_is_met() -> None:
    found, _, before = corrected()
    assert found.keeps_spin.mean() > 0.95
    change = np.abs(found.landed.answer[..., 2] - before[..., 2])
    assert np.nanmedian(change) < 0.002 * MOST_SPIN_RAD_S / 3
    beside = np.linalg.norm(found.landed.answer[..., 3:], axis=-1)
    assert np.nanmedian(beside) < 0.3 * np.nanmedian(np.linalg.norm(before[..., 3:], axis=-1))


def test_what_is_kept_is_what_was_played() -> None:
    found, _, _ = corrected()
    steps = found.rollout.actions.shape[2]
    joints = shipped().robot.joint_count
    assert found.rollout.observations.shape == (6, COUNT, steps + 1, joints + 6)
    # The action of a step is the rate that it ends with: the mean of two rates moves the joint.
    speed, period_s = shipped().robot.limits.speed_rad_s, shipped().policies.layout.control_period_s
    rates = found.rollout.actions * speed
    moved = np.diff(found.rollout.observations[..., :joints], axis=2)[:, :, 1:]
    np.testing.assert_allclose(moved, 0.5 * period_s * (rates[:, :, 1:] + rates[:, :, :-1]), atol=1e-5)

"""The one place where commands are made safe: speed, acceleration and position limits, whatever is asked."""

from __future__ import annotations

import numpy as np
import pytest

from msrd_ros.core.errors import UserError
from msrd_ros.robots.limits import JointReference, shape_command, velocity_towards
from sawyer import (
    ACCELERATION_LIMIT_RAD_S2,
    HIGHEST_RAD,
    LOWEST_RAD,
    ROBOT,
    SPEED_LIMIT_RAD_S,
)

PERIOD_S = 0.02
ROUNDING = 1e-9
LAST_STEP = 1.0 / 8.0
"""The last braking step takes a whole period: up to a T^2 / 8 further than braking without steps."""
LOWER, UPPER = LOWEST_RAD, HIGHEST_RAD


def at_rest(position: np.ndarray) -> JointReference:
    return JointReference(position, np.zeros_like(position))


def wishes(kind: str, shape: tuple[int, ...], rng: np.random.Generator) -> np.ndarray:
    if kind == "noise":
        return 3.0 * SPEED_LIMIT_RAD_S * rng.normal(size=shape)
    signs = np.where(rng.random(shape) < 0.5, -1.0, 1.0)
    return signs * {"huge": 1e300, "infinite": np.inf, "tiny": 5e-324}[kind]


@pytest.mark.parametrize("period_s", [0.001, 0.004, 0.02])
@pytest.mark.parametrize("kind", ["noise", "huge", "infinite", "tiny"])
def test_no_wish_leads_beyond_a_limit(kind: str, period_s: float) -> None:
    rng = np.random.default_rng(1)
    reference = at_rest(rng.uniform(LOWER, UPPER, size=(50, 7)))
    for step in range(1000):
        # One wish for several periods, so that the joints get up to speed and to their limits.
        if step % 10 == 0:
            wish = wishes(kind, (50, 7), rng)
        after = shape_command(ROBOT, reference, wish, period_s)
        assert np.all(np.abs(after.velocity) <= SPEED_LIMIT_RAD_S + ROUNDING)
        change = np.abs(after.velocity - reference.velocity)
        assert np.all(change <= ACCELERATION_LIMIT_RAD_S2 * period_s + ROUNDING)
        over = ACCELERATION_LIMIT_RAD_S2 * period_s**2 * LAST_STEP + ROUNDING
        assert np.all(over < 0.01)
        assert np.all(after.position >= LOWER - over)
        assert np.all(after.position <= UPPER + over)
        reference = after


@pytest.mark.parametrize("direction", [-1.0, 1.0])
def test_a_joint_sent_into_its_limit_stops_there_and_comes_back(direction: float) -> None:
    reference = at_rest(np.zeros(7))
    for _ in range(400):
        reference = shape_command(ROBOT, reference, np.full(7, direction * np.inf), PERIOD_S)
    limit = UPPER if direction > 0.0 else LOWER
    over = ACCELERATION_LIMIT_RAD_S2 * PERIOD_S**2 * LAST_STEP
    assert np.all(np.abs(reference.position - limit) <= over + ROUNDING)
    np.testing.assert_allclose(reference.velocity, 0.0, atol=1e-3)
    back = shape_command(ROBOT, reference, np.full(7, -direction), PERIOD_S)
    assert np.all(direction * (back.position - reference.position) < 0.0)


def test_full_speed_is_reached_as_fast_as_the_acceleration_allows() -> None:
    reference, steps = at_rest(np.zeros(7)), np.zeros(7)
    for _ in range(30):
        reference = shape_command(ROBOT, reference, SPEED_LIMIT_RAD_S, PERIOD_S)
        steps += reference.velocity < SPEED_LIMIT_RAD_S - ROUNDING
    needed = np.ceil(SPEED_LIMIT_RAD_S / (ACCELERATION_LIMIT_RAD_S2 * PERIOD_S) - 1e-6) - 1
    np.testing.assert_array_equal(steps, needed)


def test_position_is_the_integral_of_a_velocity_that_changes_evenly() -> None:
    before = JointReference(np.full(7, 0.1), np.full(7, 0.2))
    after = shape_command(ROBOT, before, np.full(7, 0.25), PERIOD_S)
    np.testing.assert_allclose(after.velocity, 0.25)
    np.testing.assert_allclose(after.position, 0.1 + 0.5 * (0.2 + 0.25) * PERIOD_S, rtol=1e-15)


def test_a_wish_that_is_no_number_is_refused_by_joint() -> None:
    wish = np.zeros(7)
    wish[4] = np.nan
    with pytest.raises(UserError, match="joint right_j4 is not a number"):
        shape_command(ROBOT, at_rest(np.zeros(7)), wish, PERIOD_S)


def test_many_arms_at_once_are_the_same_as_one_by_one() -> None:
    rng = np.random.default_rng(2)
    many = JointReference(rng.uniform(LOWER, UPPER, (3, 4, 7)), rng.uniform(-1.0, 1.0, (3, 4, 7)))
    wish = rng.normal(size=(3, 4, 7))
    together = shape_command(ROBOT, many, wish, PERIOD_S)
    for index in np.ndindex(3, 4):
        alone = shape_command(
            ROBOT, JointReference(many.position[index], many.velocity[index]), wish[index], PERIOD_S
        )
        np.testing.assert_array_equal(alone.position, together.position[index])
        np.testing.assert_array_equal(alone.velocity, together.velocity[index])


def test_going_to_a_pose_arrives_and_hardly_passes_it() -> None:
    rng = np.random.default_rng(3)
    start, goal = rng.uniform(LOWER, UPPER, (2, 20, 7))
    reference, side = at_rest(start), np.sign(goal - start)
    for _ in range(1000):
        wanted = velocity_towards(ROBOT, reference, goal, PERIOD_S)
        assert np.all(np.abs(wanted) <= 0.5 * SPEED_LIMIT_RAD_S + ROUNDING)
        reference = shape_command(ROBOT, reference, wanted, PERIOD_S)
        assert np.all(side * (goal - reference.position) > -6e-3)
    np.testing.assert_allclose(reference.position, goal, atol=1e-6)
    np.testing.assert_allclose(reference.velocity, 0.0, atol=1e-6)

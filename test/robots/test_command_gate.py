"""The last look at a command: what lies within every limit passes, and nothing else does."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from msrd_ros.core.errors import UserError
from msrd_ros.robots.command_gate import CommandGate, Waypoint, command_points, require_possible
from msrd_ros.robots.limits import JointReference, shape_command
from sawyer import (
    ACCELERATION_LIMIT_RAD_S2,
    HIGHEST_RAD,
    HOME_POSTURE_RAD,
    LOWEST_RAD,
    POSITION_UPPER_RAD,
    ROBOT,
    SPEED_LIMIT_RAD_S,
)

PERIOD_S = 0.02


def at_rest(position: np.ndarray) -> JointReference:
    return JointReference(position.copy(), np.zeros(7))


def test_whatever_a_policy_wishes_passes_once_it_is_shaped_and_ends_at_rest() -> None:
    rng = np.random.default_rng(0)
    gate = CommandGate(ROBOT)
    reference = at_rest(HOME_POSTURE_RAD)
    for step in range(2000):
        signs = np.sign(np.sin(step / 40 + rng.normal(size=7)))
        wish = np.where(rng.random(7) < 0.1, np.inf, SPEED_LIMIT_RAD_S) * signs
        reference = shape_command(ROBOT, reference, wish, PERIOD_S)
        points = command_points(ROBOT, reference, PERIOD_S)
        gate.require(points)
        assert gate.last is not None
        np.testing.assert_array_equal(gate.last.position, reference.position)
        # The last step of braking takes a whole period: see the tests of the limits.
        further = ACCELERATION_LIMIT_RAD_S2 * PERIOD_S**2 / 8
        stop = points[-1].position
        assert np.all((stop >= LOWEST_RAD - further) & (stop <= HIGHEST_RAD + further))
        assert np.all(np.diff([point.time_s for point in points]) >= 1e-9 * 0.99)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=300)
def test_every_command_ends_at_rest_to_the_last_bit(seed: int) -> None:
    """Stopping times of whole nanoseconds became a little less when they were rounded up to one."""
    nanoseconds = np.random.default_rng(seed).integers(1, 10**8, size=7)
    velocity = np.minimum(ACCELERATION_LIMIT_RAD_S2 * (nanoseconds * 1e-9), SPEED_LIMIT_RAD_S)
    for scale in (1.0, 1.0 + 2.3e-16, 1.0 - 1.2e-16):
        points = command_points(ROBOT, JointReference(HOME_POSTURE_RAD.copy(), scale * velocity), PERIOD_S)
        assert not np.any(points[-1].velocity)


def test_a_state_of_rest_is_one_point() -> None:
    (point,) = command_points(ROBOT, at_rest(HOME_POSTURE_RAD), PERIOD_S)
    assert point.time_s == PERIOD_S
    assert not point.velocity.any()


@pytest.mark.parametrize(
    ("position", "velocity", "words"),
    [
        (np.nan, 0.0, "joint right_j3 to nan rad, its limit is"),
        (10.0, 0.0, "joint right_j3 to 10 rad, its limit is 3.04"),
        (0.5, 0.0, r"joint right_j3 to \S+ rad/s, its limit is"),
        (0.0, np.inf, "joint right_j3 to inf rad/s"),
        (0.0, 1.0, r"joint right_j3 to 50 rad/s\^2"),
    ],
)
def test_what_is_beyond_a_limit_is_named_and_not_remembered(
    position: float, velocity: float, words: str
) -> None:
    gate = CommandGate(ROBOT)
    start = at_rest(np.zeros(7) - np.array([0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0]))
    gate.require(command_points(ROBOT, start, PERIOD_S))
    wrong = at_rest(start.position)
    wrong.position[3], wrong.velocity[3] = position, velocity
    with pytest.raises(UserError, match=f"a command would take {words}"):
        gate.require([Waypoint(PERIOD_S, *wrong), Waypoint(1.0, wrong.position, np.zeros(7))])
    assert gate.last is not None
    np.testing.assert_array_equal(gate.last.position, start.position)
    gate.require(command_points(ROBOT, start, PERIOD_S))


def test_a_command_that_does_not_end_at_rest_is_not_sent() -> None:
    moving = JointReference(HOME_POSTURE_RAD, np.full(7, 0.1))
    with pytest.raises(UserError, match="does not end at rest"):
        CommandGate(ROBOT).require([Waypoint(PERIOD_S, *moving)])


def test_measured_postures_are_held_against_the_limits_with_little_slack() -> None:
    require_possible(ROBOT, POSITION_UPPER_RAD + 0.01, "x")
    for wrong in (np.degrees(HOME_POSTURE_RAD), POSITION_UPPER_RAD + 0.03, np.full(7, np.nan)):
        with pytest.raises(UserError, match=r"x: joint right_j\d is at .* rad, its limit is .* degrees"):
            require_possible(ROBOT, wrong, "x")

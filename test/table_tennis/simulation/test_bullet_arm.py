"""The arm under command: it follows, and keeps to every limit whatever it is told."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from msrd_ros.core.errors import UserError
from msrd_ros.robots.dynamics import inverse_dynamics
from msrd_ros.robots.kinematics import paddle_pose
from msrd_ros.robots.limits import JointReference, shape_command
from msrd_ros.table_tennis.arm.collision_model import clearance, obstacle
from msrd_ros.table_tennis.ball.scene import Table
from msrd_ros.table_tennis.simulation.bullet_arm import ArmConfig
from msrd_ros.table_tennis.simulation.rally import Rally, RallyConfig
from sawyer import ACCELERATION_LIMIT_RAD_S2, ARM, POSITION_LOWER_RAD, POSITION_UPPER_RAD, ROBOT

pytestmark = pytest.mark.slow

PERIOD_S = 0.02
PLAYING_POSTURE = np.array([0.0, 0.3, -1.2, 0.5, -0.5, 1.5, 0.0])
STRETCHED_OUT = np.zeros(7)
TABLE = obstacle(Table())


@pytest.fixture
def rally() -> Iterator[Rally]:
    with Rally() as one:
        yield one


def _paddle_error_m(rally: Rally) -> float:
    wanted, _ = paddle_pose(ARM, rally.reference.position)
    return float(np.linalg.norm(rally.paddle.position - wanted))


def _swing(rally: Rally, seed: int) -> float:
    """Play smooth random motions within limits; return the largest tracking error of the paddle in m."""
    rng = np.random.default_rng(seed)
    rally.reset(PLAYING_POSTURE)
    reference = JointReference(PLAYING_POSTURE, np.zeros(7))
    towards, worst = rng.normal(size=7), 0.0
    for step in range(60):
        if step % 12 == 0:
            towards = (PLAYING_POSTURE - reference.position) * 2.0 + rng.normal(size=7) * 0.6
        smooth = reference.velocity + 0.3 * (towards - reference.velocity)
        reference = shape_command(ROBOT, reference, smooth, PERIOD_S)
        rally.command(*reference, PERIOD_S)
        rally.advance(PERIOD_S)
        np.testing.assert_allclose(rally.reference.position, reference.position, atol=1e-9)
        worst = max(worst, _paddle_error_m(rally))
    return worst


def test_the_paddle_follows_shaped_commands_within_two_millimetres(rally: Rally) -> None:
    assert max(_swing(rally, seed) for seed in range(5)) < 0.002
    assert rally.limits.limits_exceeded == 0


@pytest.mark.parametrize(
    "config",
    [
        ArmConfig(mass_scale=1.1),
        ArmConfig(joint_friction_nm=0.3),
        ArmConfig(payload_kg=0.5),
    ],
    ids=["heavier", "dry", "loaded"],
)
def test_an_arm_unlike_its_model_still_follows_within_five_millimetres(config: ArmConfig) -> None:
    with Rally(RallyConfig(arm=config)) as rally:
        assert 1e-5 < _swing(rally, 0) < 0.005


@pytest.mark.parametrize("kind", ["huge", "wild"])
def test_no_limit_is_passed_in_a_thousand_random_commands(rally: Rally, kind: str) -> None:
    rng = np.random.default_rng(3)
    rally.reset(PLAYING_POSTURE)
    reference = JointReference(PLAYING_POSTURE, np.zeros(7))
    for step in range(1000):
        if step % 100 == 0:
            rally.reset(PLAYING_POSTURE)
            reference = JointReference(PLAYING_POSTURE, np.zeros(7))
        if kind == "huge":
            size = 10.0 ** rng.integers(0, 300)
            rally.command(rng.normal(size=7) * size, rng.normal(size=7) * size, PERIOD_S)
        else:
            reference = shape_command(ROBOT, reference, rng.choice([-np.inf, 9.0, 0.0, np.inf], 7), PERIOD_S)
            rally.command(*reference, PERIOD_S)
        rally.advance(PERIOD_S)
    assert rally.limits.samples == 20_000
    assert rally.limits.limits_exceeded == 0
    assert rally.limits.speed_fraction.max() < 1.01
    assert rally.limits.torque_fraction.max() <= 1.0


def test_a_command_that_is_no_number_is_refused_by_joint_and_the_arm_holds(rally: Rally) -> None:
    rally.reset(PLAYING_POSTURE)
    for bad in (np.nan, np.inf):
        goal = PLAYING_POSTURE.copy()
        goal[4] = bad
        with pytest.raises(UserError, match="right_j4"):
            rally.command(goal, np.zeros(7), PERIOD_S)
        with pytest.raises(UserError, match="right_j4"):
            rally.command(PLAYING_POSTURE, goal - PLAYING_POSTURE, PERIOD_S)
    for period in (0.0, -0.02, np.nan):
        with pytest.raises(UserError, match="period"):
            rally.command(PLAYING_POSTURE, np.zeros(7), period)
    rally.advance(0.1)
    np.testing.assert_array_equal(rally.joint_position, PLAYING_POSTURE)


@pytest.mark.parametrize("joint", range(7))
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_joint_sent_beyond_its_range_stops_before_the_end(rally: Rally, joint: int, sign: float) -> None:
    rally.reset(PLAYING_POSTURE)
    goal = PLAYING_POSTURE.copy()
    goal[joint] = sign * 100.0
    for _ in range(20):
        rally.command(goal, np.zeros(7), 0.2)
        rally.advance(0.2)
    assert np.all(rally.joint_position > POSITION_LOWER_RAD)
    assert np.all(rally.joint_position < POSITION_UPPER_RAD)
    assert rally.limits.limits_exceeded == 0


def test_a_used_up_command_ends_in_a_hold_within_acceleration_limits(rally: Rally) -> None:
    rally.reset(PLAYING_POSTURE)
    reference = JointReference(PLAYING_POSTURE, np.zeros(7))
    for _ in range(6):
        reference = shape_command(ROBOT, reference, np.full(7, 0.9), PERIOD_S)
        rally.command(*reference, PERIOD_S)
        rally.advance(PERIOD_S)
    velocity = rally.joint_velocity
    assert np.all(velocity > 0.8)
    while not rally.at_rest:
        rally.advance(0.001)
        change = np.abs(rally.joint_velocity - velocity) / 0.001
        assert np.all(change < 1.05 * ACCELERATION_LIMIT_RAD_S2 + 0.5)
        velocity = rally.joint_velocity
    assert rally.time < 0.4
    stopped = rally.joint_position
    rally.advance(1.0)
    np.testing.assert_array_equal(rally.joint_position, stopped)
    np.testing.assert_array_equal(rally.joint_velocity, np.zeros(7))


def test_the_arm_stops_above_the_table_and_leaves_again(rally: Rally) -> None:
    rally.reset(STRETCHED_OUT)
    down = STRETCHED_OUT.copy()
    down[1] = 1.2
    for _ in range(15):
        rally.command(down, np.zeros(7), 0.3)
        rally.advance(0.1)
        assert clearance(ARM, rally.joint_position, TABLE) > 0.0
    assert 0.85 < rally.paddle.position[2] < 0.95
    for _ in range(15):
        rally.command(STRETCHED_OUT, np.zeros(7), 0.3)
        rally.advance(0.1)
    rally.advance(0.5)
    np.testing.assert_allclose(rally.joint_position, STRETCHED_OUT, atol=0.05)
    assert rally.limits.limits_exceeded == 0


def test_effort_at_rest_carries_the_weight_and_moving_effort_is_within_limits(rally: Rally) -> None:
    rally.reset(PLAYING_POSTURE)
    weight = inverse_dynamics(ARM, PLAYING_POSTURE, np.zeros(7), np.zeros(7))
    np.testing.assert_array_equal(rally.joint_effort, weight)
    assert weight[1] < -20.0
    rally.command(PLAYING_POSTURE + 0.05, np.full(7, 0.3), 0.2)
    rally.advance(0.1)
    assert np.abs(rally.joint_effort - weight).max() > 0.5

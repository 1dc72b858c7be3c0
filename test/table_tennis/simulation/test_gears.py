"""Backlash: between motors and links."""

from __future__ import annotations

import numpy as np
import pytest

from msrd_ros.table_tennis.arm.driver import JointDriver
from msrd_ros.table_tennis.ball.scene import Table
from msrd_ros.table_tennis.simulation.bullet_arm import ArmConfig
from msrd_ros.table_tennis.simulation.gears import Gears
from msrd_ros.table_tennis.simulation.rally import Rally, RallyConfig
from sawyer import ROBOT

POSTURE = np.array([0.0, 0.3, -1.2, 0.5, -0.5, 1.5, 0.0])
PLAY_RAD = 0.01


def test_motors_stand_before_their_links_by_half_of_the_play() -> None:
    gears = Gears(ROBOT, PLAY_RAD)
    torque = np.array([50.0, -50.0, 0.0, 20.0, -5.0, 5.0, 0.0])
    links = gears.rest(POSTURE, torque)
    np.testing.assert_array_equal(gears.position, POSTURE)
    np.testing.assert_allclose(POSTURE - links, 0.5 * PLAY_RAD * np.sign(torque))


def test_a_motor_that_turns_round_runs_through_the_whole_play() -> None:
    gears = Gears(ROBOT, PLAY_RAD)
    push = ROBOT.limits.torque_nm
    links = gears.rest(POSTURE, push)
    travel = np.zeros(7)
    for _ in range(200):
        gears.turn(links, np.zeros(7), -push, 0.001)
        travel += 0.001 * gears.velocity
    np.testing.assert_allclose(gears.position, links - 0.5 * PLAY_RAD, atol=1e-6)
    np.testing.assert_allclose(travel, -PLAY_RAD, atol=1e-6)


@pytest.mark.slow
def test_an_arm_with_play_comes_to_rest_where_its_encoders_are_told_and_its_paddle_is_elsewhere() -> None:
    with Rally() as exact, Rally(RallyConfig(arm=ArmConfig(backlash_rad=PLAY_RAD))) as loose:
        for rally in (exact, loose):
            rally.reset(POSTURE)
            rally.command(POSTURE + 0.1, np.zeros(7), 0.3)
            rally.advance(1.5)
            assert rally.at_rest
            np.testing.assert_allclose(rally.joint_position, POSTURE + 0.1, atol=1e-6)
        astray = np.linalg.norm(exact.paddle.position - loose.paddle.position)
    assert 0.001 < astray < 0.02


def test_a_slower_driver_keeps_to_its_share_of_speed_and_acceleration() -> None:
    driver = JointDriver(ROBOT, 0.001, Table(), limits_share=0.5)
    driver.hold_at(POSTURE)
    driver.command(POSTURE + 2.0, np.zeros(7), 0.02)
    speeds = [np.zeros(7)]
    torque = np.zeros(7)
    for _ in range(20):
        driver.torque(driver.reference.position, driver.reference.velocity, torque)
        speeds.append(driver.reference.velocity)
    acceleration = np.abs(np.diff(speeds, axis=0)).max(axis=0) / 0.001
    np.testing.assert_allclose(acceleration, 0.5 * ROBOT.limits.acceleration_rad_s2, rtol=1e-6)
    assert np.all(np.abs(speeds) <= 0.5 * ROBOT.limits.speed_rad_s + 1e-12)


def test_a_late_driver_does_the_same_later() -> None:
    drivers = [JointDriver(ROBOT, 0.001, Table(), dead_time_s=dead_time_s) for dead_time_s in (0.0, 0.03)]
    paths: list[list[np.ndarray]] = [[], []]
    for driver, path in zip(drivers, paths, strict=True):
        driver.hold_at(POSTURE)
        torque = np.zeros(7)
        for tick in range(8):
            share = min(tick + 1, 4) / 4
            driver.command(POSTURE + 0.02 * share, np.full(7, 0.2 if tick < 3 else 0.0), 0.02)
            for _ in range(20):
                driver.torque(driver.reference.position, driver.reference.velocity, torque)
                path.append(driver.reference.position)
    np.testing.assert_allclose(paths[1][:30], np.tile(POSTURE, (30, 1)))
    np.testing.assert_allclose(paths[1][30:], paths[0][:-30], atol=1e-12)
    assert np.abs(paths[0][-1] - POSTURE).max() > 0.01
    drivers[1].command(POSTURE, np.zeros(7), 0.02)
    assert not drivers[1].reference_rests

"""The arm that most tests play with, and its facts under short names."""

from __future__ import annotations

from msrd_ros.robots.loading import default_robot

ROBOT = default_robot()
ARM = ROBOT.model
JOINT_NAMES = ROBOT.joint_names
JOINT_COUNT = ROBOT.joint_count
POSITION_LOWER_RAD = ROBOT.limits.lower_rad
POSITION_UPPER_RAD = ROBOT.limits.upper_rad
LOWEST_RAD = ROBOT.limits.lowest_rad
HIGHEST_RAD = ROBOT.limits.highest_rad
SPEED_LIMIT_RAD_S = ROBOT.limits.speed_rad_s
ACCELERATION_LIMIT_RAD_S2 = ROBOT.limits.acceleration_rad_s2
TORQUE_LIMIT_NM = ROBOT.limits.torque_nm
HOME_POSTURE_RAD = ROBOT.home_rad

"""Teach mode: the arm floats in zero-g and a hand leads the paddle.

Hand and paddle are held together by a spring-damper of limited force. The motors carry the arm's weight,
damp the joints a little, and brake every joint that comes near its speed limit; whatever they do, they
keep to their torque limits. The hand's wrench acts on the paddle from outside, beside the motors.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from msrd_ros.facts.errors import UserError
from msrd_ros.facts.sawyer import JOINT_COUNT, SPEED_LIMIT_RAD_S, TORQUE_LIMIT_NM
from msrd_ros.table_tennis.dynamics import JOINT_FRICTION_NM_S, inverse_dynamics, mass_matrix
from msrd_ros.table_tennis.kinematics import paddle_jacobian, paddle_pose
from msrd_ros.table_tennis.rotations import rotation_from_quaternion, turn_between, turned

Array = NDArray[np.float64]


@dataclass(frozen=True)
class GuidanceConfig:
    """How firmly the hand holds the paddle, and how the arm gives way.

    Attributes
    ----------
    stiffness_n_m, damping_n_s_m, force_limit_n
        Of the grip in translation.
    turn_stiffness_nm, turn_damping_nm_s, torque_limit_nm
        Of the grip in rotation, per rad and rad/s. With a damping of 1.2 the light last joint chatters at
        the step rate: its inertia about the handle is 6e-4 kg m^2, half of 1.2 Nm s times 1 ms.
    joint_damping_nm_s
        Of each joint. The same damping for all joints would make the light wrist unstable.
    brake_from
        Share of its speed limit from which a joint is braked.
    brake_full
        Share of its speed limit at which the brake would use the joint's whole torque.
    stop_time_s
        Time constant with which an arm that was let go comes to rest.
    hand_timeout_s
        A streamed hand that has not been heard of for so long has let go.
    """

    stiffness_n_m: float = 1500.0
    damping_n_s_m: float = 60.0
    force_limit_n: float = 150.0
    turn_stiffness_nm: float = 40.0
    turn_damping_nm_s: float = 0.5
    torque_limit_nm: float = 12.0
    joint_damping_nm_s: tuple[float, ...] = (4.0, 4.0, 2.0, 2.0, 0.3, 0.3, 0.1)
    brake_from: float = 0.9
    brake_full: float = 0.98
    stop_time_s: float = 0.1
    hand_timeout_s: float = 0.1


@dataclass(frozen=True)
class HandGesture:
    """Where the hand leads the paddle: a whole gesture in time, or one streamed point.

    A gesture is followed from its first point to its last, which the hand then keeps. From one point the
    hand goes on with the point's velocities until the next, or until it has not been heard of for
    `GuidanceConfig.hand_timeout_s`.

    Attributes
    ----------
    times_s
        From when the target is given, increasing, shape (N,).
    positions
        Of the blade's centre, shape (N, 3), m.
    quaternions
        x, y, z, w of `right_l6`, shape (N, 4).
    velocities, angular_velocities
        Shape (N, 3), m/s and rad/s.
    """

    times_s: Array
    positions: Array
    quaternions: Array
    velocities: Array
    angular_velocities: Array

    def __post_init__(self) -> None:
        count = len(self.times_s)
        shapes = {"positions": 3, "quaternions": 4, "velocities": 3, "angular_velocities": 3}
        if count < 1 or np.any(np.diff(self.times_s) <= 0.0) or not np.isfinite(self.times_s).all():
            raise UserError("hand gesture: its times must be finite and increase from point to point")
        for name, width in shapes.items():
            values = getattr(self, name)
            if values.shape != (count, width):
                raise UserError(f"hand gesture: {name} has shape {values.shape}; give ({count}, {width})")
            if not np.isfinite(values).all():
                raise UserError(f"hand gesture: {name} holds a number that is not finite")
        if np.any(np.linalg.norm(self.quaternions, axis=1) < 1e-6):
            raise UserError("hand gesture: quaternions holds a zero; give unit quaternions x, y, z, w")

    @classmethod
    def now(
        cls,
        position: ArrayLike,
        quaternion: ArrayLike,
        velocity: ArrayLike = (0.0, 0.0, 0.0),
        angular_velocity: ArrayLike = (0.0, 0.0, 0.0),
    ) -> HandGesture:
        """One streamed point: pose and velocities, shapes (3,), (4,), (3,) and (3,), that hold now."""
        parts = (position, quaternion, velocity, angular_velocity)
        return cls(np.zeros(1), *(np.array([part], dtype=np.float64) for part in parts))


@njit(cache=True, nogil=True)
def _interpolate(
    times: Array, positions: Array, rotations: Array, twists: Array, time: float
) -> tuple[Array, Array, Array]:
    """Pose and twist of a gesture at one time: cubic in position, blended in rotation."""
    last = len(times) - 1
    if time <= times[0]:
        return positions[0], rotations[0], np.zeros(6)
    if time >= times[last]:
        return positions[last], rotations[last], np.zeros(6)
    index = np.searchsorted(times, time, side="right") - 1
    span = times[index + 1] - times[index]
    s = (time - times[index]) / span
    p0, p1 = positions[index], positions[index + 1]
    m0, m1 = twists[index, :3] * span, twists[index + 1, :3] * span
    b = 3.0 * (p1 - p0) - 2.0 * m0 - m1
    c = m0 + m1 - 2.0 * (p1 - p0)
    position = p0 + s * (m0 + s * (b + s * c))
    twist = np.empty(6)
    twist[:3] = (m0 + s * (2.0 * b + s * 3.0 * c)) / span
    twist[3:] = (1.0 - s) * twists[index, 3:] + s * twists[index + 1, 3:]
    rotation = turned(rotations[index], s * turn_between(rotations[index], rotations[index + 1]))
    return position, rotation, twist


@njit(cache=True, nogil=True)
def _limited(vector: Array, most: float) -> Array:
    size = math.sqrt(np.sum(vector * vector))
    return vector * (most / size) if size > most else vector


@njit(cache=True, nogil=True)
def hand_torques(
    joint_position: Array,
    joint_velocity: Array,
    target_position: Array,
    target_rotation: Array,
    target_twist: Array,
    grip: Array,
) -> Array:
    """Torques (7,) in Nm that the hand's wrench at the paddle makes in the joints.

    Parameters
    ----------
    joint_position, joint_velocity
        Shape (7,).
    target_position, target_rotation, target_twist
        Of the hand, shapes (3,), (3, 3), (6,).
    grip
        Stiffness, damping and limit of the force, then of the torque, shape (6,).
    """
    position, rotation = paddle_pose(joint_position)
    jacobian = paddle_jacobian(joint_position)
    lag = target_twist - jacobian @ joint_velocity
    wrench = np.empty(6)
    wrench[:3] = _limited(grip[0] * (target_position - position) + grip[1] * lag[:3], grip[2])
    wrench[3:] = _limited(grip[3] * turn_between(rotation, target_rotation) + grip[4] * lag[3:], grip[5])
    return jacobian.T @ wrench


@njit(cache=True, nogil=True)
def float_torques(
    joint_position: Array,
    joint_velocity: Array,
    outside: Array,
    damping: Array,
    stop_rate: float,
    brake_from: float,
    brake_full: float,
    step: float,
) -> Array:
    """Torques (7,) in Nm of the motors of a floating arm, within the limits.

    They carry the weight, damp, and brake joints that would leave the coming step faster than `brake_from`
    of their limit. The brake is viscous and solved implicitly, for all joints together, so that it is
    stable however stiff it is.

    Parameters
    ----------
    outside
        Torques of the hand, shape (7,).
    damping
        Shape (7,), Nm s.
    stop_rate
        1/s at which an arm without a hand is slowed down; 0 with a hand.
    brake_from, brake_full
        Shares of the speed limits.
    step
        Seconds.
    """
    carry = inverse_dynamics(joint_position, joint_velocity, np.zeros(JOINT_COUNT))
    carry += JOINT_FRICTION_NM_S * joint_velocity
    inertia = mass_matrix(joint_position)
    motor = carry - damping * joint_velocity - stop_rate * (inertia @ joint_velocity)
    motor = np.minimum(np.maximum(motor, -TORQUE_LIMIT_NM), TORQUE_LIMIT_NM)
    mobility = np.linalg.inv(inertia) * step
    coming = joint_velocity + mobility @ (motor + outside - carry)
    soft = brake_from * SPEED_LIMIT_RAD_S
    if np.all(np.abs(coming) <= soft):
        return motor
    slope = TORQUE_LIMIT_NM / ((brake_full - brake_from) * SPEED_LIMIT_RAD_S)
    braked = motor.copy()
    for _ in range(30):
        for joint in range(JOINT_COUNT):
            own = mobility[joint, joint]
            free = coming[joint] - own * (braked[joint] - motor[joint])
            excess = max(abs(free) - soft[joint], 0.0)
            brake = -math.copysign(slope[joint] * excess / (1.0 + slope[joint] * own), free)
            limit = TORQUE_LIMIT_NM[joint]
            torque = min(max(motor[joint] + brake, -limit), limit)
            coming += mobility[:, joint] * (torque - braked[joint])
            braked[joint] = torque
    return braked


class HandGuidance:
    """The hand, if there is one, and the floating arm's answer to it."""

    def __init__(self, config: GuidanceConfig, step_s: float) -> None:
        self._config = config
        self._step_s = step_s
        self._grip = np.array(
            [
                config.stiffness_n_m,
                config.damping_n_s_m,
                config.force_limit_n,
                config.turn_stiffness_nm,
                config.turn_damping_nm_s,
                config.torque_limit_nm,
            ]
        )
        self._damping = np.array(config.joint_damping_nm_s)
        self.leading = False
        self._start_s = 0.0
        self._times: Array = np.zeros(1)
        self._positions: Array = np.zeros((1, 3))
        self._rotations: Array = np.zeros((1, 3, 3))
        self._twists: Array = np.zeros((1, 6))

    def release(self) -> None:
        """Let go."""
        self.leading = False

    def lead(self, time_s: float, target: HandGesture) -> None:
        """Lead the paddle to or through `target`, whose times count from `time_s`."""
        self._start_s = time_s
        self._times = np.ascontiguousarray(target.times_s, dtype=np.float64)
        self._positions = np.ascontiguousarray(target.positions, dtype=np.float64)
        self._rotations = np.array([rotation_from_quaternion(one) for one in target.quaternions])
        self._twists = np.concatenate([target.velocities, target.angular_velocities], axis=1)
        self.leading = True

    def target(self, time_s: float) -> tuple[Array, Array, Array]:
        """Position (3,), rotation (3, 3) and twist (6,) of the hand."""
        elapsed = time_s - self._start_s
        if len(self._times) > 1:
            return _interpolate(self._times, self._positions, self._rotations, self._twists, elapsed)
        twist = self._twists[0]
        elapsed -= float(self._times[0])
        return (
            self._positions[0] + elapsed * twist[:3],
            turned(self._rotations[0], elapsed * twist[3:]),
            twist,
        )

    def torque(self, time_s: float, position: Array, velocity: Array, motor: Array, total: Array) -> None:
        """Write the motors' torques and their sum with the hand's, shape (7,) each, for the coming step."""
        if self.leading and len(self._times) == 1:
            self.leading = time_s - self._start_s - self._times[0] <= self._config.hand_timeout_s
        if self.leading:
            outside = hand_torques(position, velocity, *self.target(time_s), self._grip)
        else:
            outside = np.zeros(JOINT_COUNT)
        config = self._config
        motor[:] = float_torques(
            position,
            velocity,
            outside,
            self._damping,
            0.0 if self.leading else 1.0 / config.stop_time_s,
            config.brake_from,
            config.brake_full,
            self._step_s,
        )
        total[:] = motor + outside

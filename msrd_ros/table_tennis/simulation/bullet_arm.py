"""The arm as a body in PyBullet, moved by joint torques, with its limits enforced and counted."""

from __future__ import annotations

import math
import tempfile
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np
import pybullet
from numpy.typing import NDArray

from msrd_ros.core.compiled import njit
from msrd_ros.core.errors import UserError
from msrd_ros.robots.arm_model import Arm
from msrd_ros.robots.robot import Robot
from msrd_ros.table_tennis.ball.ends import End

Array = NDArray[np.float64]

SPEED_TOLERANCE = 0.01
"""Share of a speed limit by which a sample may pass it before it is counted."""
POSITION_TOLERANCE_RAD = 1e-3


@dataclass(frozen=True)
class ArmConfig:
    """How the simulated arm differs from the robot's model of itself, by which driver and player go.

    Attributes
    ----------
    mass_scale
        Factor on all masses and inertias.
    joint_friction_nm
        Dry friction of every joint, of which the model knows nothing; doubles the cost of a step.
    payload_kg
        Mass in the paddle's centre of mass, beside the paddle's own.
    limits_share
        What the driver allows of the limits of speed and acceleration, above 0 and up to 1.
    dead_time_s
        How long after a command was sent the driver begins with it; whole milliseconds.
    backlash_rad
        Play of every joint's gear, from one flank to the other; encoders sit on the motor's side.

    Raises
    ------
    UserError
        If a number is out of its range.
    """

    mass_scale: float = 1.0
    joint_friction_nm: float = 0.0
    payload_kg: float = 0.0
    limits_share: float = 1.0
    dead_time_s: float = 0.0
    backlash_rad: float = 0.0

    def __post_init__(self) -> None:
        for name, value in asdict(self).items():
            if not (math.isfinite(value) and value >= 0.0):
                raise UserError(f"arm: {name} is {value}; give a finite number that is not negative")
        for name in ("mass_scale", "limits_share"):
            if getattr(self, name) == 0.0:
                raise UserError(f"arm: {name} is 0; give a number above 0")
        if self.limits_share > 1.0:
            raise UserError(f"arm: limits_share is {self.limits_share}; give a number up to 1")


@dataclass
class LimitLog:
    """What the joints were seen to do, against their limits, since the last `clear`.

    Attributes
    ----------
    arm
        `Robot.model`, of N joints.
    speed_fraction, torque_fraction
        Largest |speed| and |torque| of each joint as fractions of the limits, shape (N,).
    counts
        Samples, then samples over a limit of speed, position and torque, shape (4,).
    """

    arm: Arm
    speed_fraction: Array
    torque_fraction: Array
    counts: NDArray[np.int64] = field(default_factory=lambda: np.zeros(4, dtype=np.int64))

    @classmethod
    def of(cls, robot: Robot) -> LimitLog:
        """An empty log."""
        return cls(robot.model, np.zeros(robot.joint_count), np.zeros(robot.joint_count))

    @property
    def samples(self) -> int:
        """Milliseconds looked at."""
        return int(self.counts[0])

    @property
    def speed_exceeded(self) -> int:
        """Samples with a joint more than 1 % over its speed limit."""
        return int(self.counts[1])

    @property
    def torque_exceeded(self) -> int:
        """Samples with a joint over its torque limit."""
        return int(self.counts[3])

    @property
    def limits_exceeded(self) -> int:
        """Samples over any limit, counted once for each kind."""
        return int(self.counts[1:].sum())

    def clear(self) -> None:
        """Start anew."""
        self.speed_fraction[:] = 0.0
        self.torque_fraction[:] = 0.0
        self.counts[:] = 0

    def note(self, position: Array, velocity: Array, torque: Array) -> None:
        """Take in one sample, shape (N,) each."""
        note_limits(
            self.arm, position, velocity, torque, self.speed_fraction, self.torque_fraction, self.counts
        )


@njit(cache=True, nogil=True)
def note_limits(
    arm: Arm,
    position: Array,
    velocity: Array,
    torque: Array,
    speed_fraction: Array,
    torque_fraction: Array,
    counts: NDArray[np.int64],
) -> None:
    """Update the arrays of a `LimitLog` with one sample."""
    too_fast, too_far, too_strong = False, False, False
    for joint in range(len(arm[0].speed)):
        speed = abs(velocity[joint]) / arm[0].speed[joint]
        effort = abs(torque[joint]) / arm[0].torque[joint]
        speed_fraction[joint] = max(speed_fraction[joint], speed)
        torque_fraction[joint] = max(torque_fraction[joint], effort)
        too_fast |= speed > 1.0 + SPEED_TOLERANCE
        too_strong |= effort > 1.0 + 1e-9
        too_far |= (
            position[joint] < arm[0].lower[joint] - POSITION_TOLERANCE_RAD
            or position[joint] > arm[0].upper[joint] + POSITION_TOLERANCE_RAD
        )
    counts[0] += 1
    counts[1] += too_fast
    counts[2] += too_far
    counts[3] += too_strong


class BulletArm:
    """Arm and paddle in one Bullet client.

    Parameters
    ----------
    client
        Of PyBullet.
    robot
        Which arm, of N joints.
    config
        Differences from the robot's model of itself.
    end
        Of the table, where it stands in the client's frame.

    Attributes
    ----------
    position, velocity
        State after the last step, shape (N,), rad and rad/s. Bullet moves each joint through a step with
        one velocity, so this is the mean velocity of the last step.
    """

    def __init__(
        self, client: int, robot: Robot, config: ArmConfig | None = None, end: End = End.NEAR
    ) -> None:
        config = config or ArmConfig()
        self._client = client
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "robot.urdf"
            path.write_text(robot.standing.text(config.mass_scale), encoding="utf-8")
            self.body: int = pybullet.loadURDF(
                str(path),
                baseOrientation=pybullet.getQuaternionFromEuler((0.0, 0.0, end.yaw_rad)),
                useFixedBase=True,
                flags=pybullet.URDF_USE_INERTIA_FROM_FILE,
                physicsClientId=client,
            )
        by_name = {}
        for index in range(pybullet.getNumJoints(self.body, physicsClientId=client)):
            info = pybullet.getJointInfo(self.body, index, physicsClientId=client)
            by_name[info[1].decode()] = index
        self.joints: list[int] = [by_name[name] for name in robot.joint_names]
        self.links: dict[str, int] = by_name
        self._free_the_joints(config, robot.model[0]["friction"])
        if config.payload_kg:
            self._load(by_name[robot.standing.mount.name], config.payload_kg)
        self.position: Array = np.zeros(robot.joint_count)
        self.velocity: Array = np.zeros(robot.joint_count)

    def _free_the_joints(self, config: ArmConfig, friction: Array) -> None:
        # Bullet brakes every joint with a motor of its own and damps every link unless told not to.
        pybullet.setJointMotorControlArray(
            self.body,
            self.joints,
            pybullet.VELOCITY_CONTROL,
            targetVelocities=[0.0] * len(self.joints),
            forces=[config.joint_friction_nm] * len(self.joints),
            physicsClientId=self._client,
        )
        pybullet.changeDynamics(
            self.body, -1, linearDamping=0.0, angularDamping=0.0, physicsClientId=self._client
        )
        for joint, damping in zip(self.joints, friction.tolist(), strict=True):
            pybullet.changeDynamics(self.body, joint, jointDamping=damping, physicsClientId=self._client)

    def _load(self, link: int, mass_kg: float) -> None:
        """Add a point mass in a link's centre of mass, about which its inertia stays what it is."""
        mass, _, inertia, *_ = pybullet.getDynamicsInfo(self.body, link, physicsClientId=self._client)
        pybullet.changeDynamics(
            self.body,
            link,
            mass=mass + mass_kg,
            localInertiaDiagonal=inertia,
            physicsClientId=self._client,
        )

    def place(self, position: Array) -> None:
        """Put the joints at rest at `position` (N,) in rad, whatever they did before."""
        for joint, angle in zip(self.joints, position.tolist(), strict=True):
            pybullet.resetJointState(self.body, joint, angle, 0.0, physicsClientId=self._client)
        self.position[:] = position
        self.velocity[:] = 0.0

    def apply(self, torque: Array) -> None:
        """Let torques (N,) in Nm act on the joints during the next step."""
        pybullet.setJointMotorControlArray(
            self.body,
            self.joints,
            pybullet.TORQUE_CONTROL,
            forces=torque.tolist(),
            physicsClientId=self._client,
        )

    def read(self) -> None:
        """Fetch the state of the joints from Bullet into `position` and `velocity`."""
        states = pybullet.getJointStates(self.body, self.joints, physicsClientId=self._client)
        self.position[:], self.velocity[:], _, _ = zip(*states, strict=True)

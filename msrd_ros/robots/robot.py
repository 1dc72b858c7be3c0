"""A robot arm as the package knows it: names, limits, where it stands, and the compiled functions' model."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from msrd_ros.core.errors import UserError
from msrd_ros.robots.urdf import StandingArm

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class JointLimits:
    """What joints must not pass; shape (N,) each.

    Attributes
    ----------
    lower_rad, upper_rad
        Where a joint stops.
    lowest_rad, highest_rad
        Between these every command stays, so that tracking errors never reach the stop.
    speed_rad_s, acceleration_rad_s2, torque_nm
        Largest magnitudes.
    """

    lower_rad: Array
    upper_rad: Array
    lowest_rad: Array
    highest_rad: Array
    speed_rad_s: Array
    acceleration_rad_s2: Array
    torque_nm: Array


@dataclass(frozen=True)
class DriverModel:
    """What the arm's own driver does: gains on tracking errors as accelerations, alike for all joints.

    Attributes
    ----------
    stiffness_1_s2, damping_1_s
        Per rad of error and per rad/s; critically damped by default.
    catch_up_1_s
        How fast a reference that the limits held back closes up to the commanded curve.
    """

    stiffness_1_s2: float = 10_000.0
    damping_1_s: float = 200.0
    catch_up_1_s: float = 50.0


@dataclass(frozen=True, eq=False)
class FloatingModel:
    """How the arm gives way to the hand that leads it in zero-g.

    Attributes
    ----------
    joint_damping_nm_s
        Of each joint, shape (N,). The same damping for all joints would make a light wrist unstable.
    brake_from
        Share of its speed limit from which a joint is braked.
    brake_full
        Share of its speed limit at which the brake would use the joint's whole torque.
    """

    joint_damping_nm_s: Array
    brake_from: float
    brake_full: float


@dataclass(frozen=True, eq=False)
class PlanningSpace:
    """Where the planner of strokes looks; shape (N,) each, rad.

    Attributes
    ----------
    hit_lower_rad, hit_upper_rad
        Angles at the hit.
    rest_lower_rad, rest_upper_rad
        Angles in the ready pose and at the end of the follow-through.
    middle_rad
        What ready poses are drawn to a little.
    """

    hit_lower_rad: Array
    hit_upper_rad: Array
    rest_lower_rad: Array
    rest_upper_rad: Array
    middle_rad: Array


@dataclass(frozen=True, eq=False)
class Robot:
    """An arm with a paddle at the table.

    Attributes
    ----------
    name
        As in `robot:=`, in bags and in checkpoints.
    folder
        Where its description lies; strokes planned for it are kept there.
    joint_names
        From the base to the hand, N of them: the order of all arrays.
    link_names
        The link behind each joint.
    limits, driver, floating, planning
        See there.
    home_rad
        Where the arm stands at the start, (N,): clear of table and floor.
    lift
        Joint (index) and direction (+1 or -1) that lift the arm off the table.
    model
        `ArmModel`, shape (1,).
    shoulder, reach_m
        Where the first joint is, shape (3,), m, and how far from there no blade gets.
    standing
        The description with base and paddle.
    digest
        Tells arms apart that share a name: of joint names and limits.
    """

    name: str
    folder: Path
    joint_names: tuple[str, ...]
    link_names: tuple[str, ...]
    limits: JointLimits
    driver: DriverModel
    floating: FloatingModel
    planning: PlanningSpace
    home_rad: Array
    lift: tuple[int, float]
    model: NDArray[np.void]
    shoulder: Array
    reach_m: float
    standing: StandingArm
    digest: str

    @property
    def joint_count(self) -> int:
        """N."""
        return len(self.joint_names)

    @property
    def urdf(self) -> str:
        """Description as XML, the root link being `world`: of the topic `robot_description`."""
        return self.standing.text()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Robot) and (self.name, self.digest) == (other.name, other.digest)

    def __hash__(self) -> int:
        return hash((self.name, self.digest))

    def require(self, name: str, where: str) -> None:
        """Refuse what was made with another arm.

        Raises
        ------
        UserError
            If `name` is not this robot's.
        """
        if name != self.name:
            raise UserError(f"{where}: is of the robot {name}, not {self.name}; say robot:={name}")

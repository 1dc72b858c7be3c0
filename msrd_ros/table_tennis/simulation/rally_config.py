"""What can be chosen about a rally in Bullet."""

from __future__ import annotations

from dataclasses import dataclass, field

from msrd_ros.robots.loading import default_robot
from msrd_ros.robots.robot import Robot
from msrd_ros.table_tennis.ball.scene import Scene
from msrd_ros.table_tennis.simulation.bullet_arm import ArmConfig
from msrd_ros.table_tennis.simulation.teach_mode import GuidanceConfig


@dataclass(frozen=True)
class RallyConfig:
    """Everything about a `Rally` that can be chosen.

    Attributes
    ----------
    scene
        Table, net, ball and air.
    arm
        How the arm differs from the robot's model of itself.
    guidance
        Gains of the teaching hand.
    robot
        Which arm plays.
    shortest_s, longest_s
        A rally is over when the referee has decided and `shortest_s` have passed since the launch, or after
        `longest_s` undecided.
    """

    scene: Scene = field(default_factory=Scene)
    arm: ArmConfig = field(default_factory=ArmConfig)
    guidance: GuidanceConfig = field(default_factory=GuidanceConfig)
    shortest_s: float = 1.95
    longest_s: float = 4.0
    robot: Robot = field(default_factory=default_robot)

"""Worlds unlike the one in which strokes are taught: what changes, by how much, and why by so much."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from msrd_ros.core.errors import UserError
from msrd_ros.robots.loading import default_robot
from msrd_ros.robots.robot import Robot
from msrd_ros.table_tennis.ball.camera import CameraConfig
from msrd_ros.table_tennis.ball.scene import Ball, Rubber, Scene, Table
from msrd_ros.table_tennis.simulation.batched import KinematicRalliesConfig
from msrd_ros.table_tennis.simulation.bullet_arm import ArmConfig
from msrd_ros.table_tennis.simulation.rally_config import RallyConfig
from msrd_ros.table_tennis.simulation.world import WorldConfig

AS_TAUGHT = "as_taught"

_ROLLING_KG = 0.4 * Ball().mass_kg
"""Tangential impulse over slip that ends the slip of a thin shell: 1 / (1 / m + r^2 / I)."""


@dataclass(frozen=True)
class WorldChange:
    """How a world differs from the one in which strokes are taught.

    Whoever plays does not know of it: driver, player and policies go by the robot's model of itself.

    Attributes
    ----------
    title
        As tables call it.
    why
        Why by so much.
    scene, arm, camera
        What the world then has.
    """

    title: str
    why: str = ""
    scene: Scene = field(default_factory=Scene)
    arm: ArmConfig = field(default_factory=ArmConfig)
    camera: CameraConfig = field(default_factory=CameraConfig)

    def in_bullet(self, robot: Robot | None = None, seed: int = 0) -> WorldConfig:
        """The changed world in Bullet; `seed` is that of the camera's noise."""
        rally = RallyConfig(scene=self.scene, arm=self.arm, robot=robot or default_robot())
        return WorldConfig(rally, self.camera, seed)

    def in_batch(self, config: KinematicRalliesConfig) -> KinematicRalliesConfig:
        """The batched simulator's world with what changes in scene and camera.

        Raises
        ------
        UserError
            If the change is one of the arm, or of the camera's frames: the batched simulator has an arm that
            follows exactly and sees the ball at every tick. Play these in Bullet.
        """
        if self.arm != ArmConfig():
            raise UserError(
                f"world {self.title!r}: the batched simulator's arm does exactly as commanded; play in Bullet"
            )
        usual = CameraConfig()
        if self.camera == usual:
            return replace(config, scene=self.scene)
        if (self.camera.rate_hz, self.camera.dropout) != (usual.rate_hz, usual.dropout):
            raise UserError(
                f"world {self.title!r}: the batched simulator sees the ball at every tick; play in Bullet"
            )
        variation = replace(
            config.variation,
            camera_noise_m=self.camera.noise_std_m,
            camera_latency_s=self.camera.latency_s,
        )
        return replace(config, scene=self.scene, variation=variation)


CHANGES = {
    AS_TAUGHT: WorldChange("as trained"),
    "payload": WorldChange(
        "2 kg more at the paddle",
        "half of what arms of this size may carry, 4 or 5 kg",
        arm=ArmConfig(payload_kg=2.0),
    ),
    "slow_driver": WorldChange(
        "driver at 60 % of speed and acceleration",
        "a speed slider that somebody has left at 60 %",
        arm=ArmConfig(limits_share=0.6),
    ),
    "late_driver": WorldChange(
        "commands act 30 ms late",
        "the shortest look-ahead of Universal Robots' servoj",
        arm=ArmConfig(dead_time_s=0.03),
    ),
    "backlash": WorldChange(
        "1 degree of backlash in every joint",
        "gears of hobby servos; encoders sit on the motors",
        arm=ArmConfig(backlash_rad=0.0175),
    ),
    "worn_rubber": WorldChange(
        "worn rubber",
        "stops the ball's slip and does not reverse it any more, and gives back a tenth less",
        scene=Scene(
            rubber=Rubber(restitution=0.9 * Rubber().restitution, tangential_stiffness_kg=_ROLLING_KG)
        ),
    ),
    "high_table": WorldChange(
        "table 2 cm higher",
        "a floor that is not level",
        scene=Scene(table=Table(height_m=0.78)),
    ),
}
"""By name; the first is the world as it is."""


def find_change(name: str) -> WorldChange:
    """The change of that name.

    Raises
    ------
    UserError
        If there is none.
    """
    if name not in CHANGES:
        raise UserError(f"world {name!r} is unknown; use one of {', '.join(CHANGES)}")
    return CHANGES[name]

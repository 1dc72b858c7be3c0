"""What a real camera, a real arm and a worse feeder cost the same policies."""

from __future__ import annotations

from dataclasses import replace

from msrd_ros.studies.table_tennis.playing import Conditions
from msrd_ros.table_tennis.ball.camera import CameraConfig
from msrd_ros.table_tennis.ball.feeder import STANDARD, WIDE
from msrd_ros.table_tennis.simulation.bullet_arm import ArmConfig
from msrd_ros.table_tennis.simulation.rally_config import RallyConfig
from msrd_ros.table_tennis.simulation.world import WorldConfig

NOMINAL = "as trained"


def robustness_conditions() -> dict[str, Conditions]:
    """By the name under which they stand in the table; each differs from the nominal in what it says."""
    cameras = {
        "3 mm noise": CameraConfig(noise_std_m=0.003),
        "20 ms latency": CameraConfig(latency_s=0.02),
        "60 Hz camera": CameraConfig(rate_hz=60.0),
        "20 % of frames lost": CameraConfig(dropout=0.2),
        "60 Hz, 3 mm, 20 ms, 10 % lost": CameraConfig(60.0, 0.003, 0.02, 0.1),
    }
    found = {NOMINAL: Conditions(), f"{NOMINAL}, estimator": Conditions(filtered=True)}
    for name, camera in cameras.items():
        plain = Conditions(WorldConfig(camera=camera))
        found[name] = plain
        found[f"{name}, estimator"] = replace(plain, filtered=True)
    arms = {
        "masses +10 %": ArmConfig(mass_scale=1.1),
        "masses -10 %": ArmConfig(mass_scale=0.9),
        "joint friction +10 %": ArmConfig(friction_scale=1.1),
        "joint friction -10 %": ArmConfig(friction_scale=0.9),
    }
    for name, arm in arms.items():
        found[name] = Conditions(WorldConfig(rally=RallyConfig(arm=arm)))
    found["feeds 1.5 times as wide"] = Conditions(spread=WIDE)
    found["feeds twice as wide"] = Conditions(spread=STANDARD.wider(2.0))
    return found

"""Under which conditions strokes are judged beside those in which they were taught."""

from __future__ import annotations

from dataclasses import replace

from msrd_ros.studies.table_tennis.playing import Conditions
from msrd_ros.table_tennis.ball.camera import CameraConfig
from msrd_ros.table_tennis.ball.feeder import SPREADS
from msrd_ros.table_tennis.simulation.changes import AS_TAUGHT, CHANGES, WorldChange

NOMINAL = CHANGES[AS_TAUGHT].title
WITH_ESTIMATOR = ", estimator"
_CAMERAS = (
    WorldChange("3 mm noise", camera=CameraConfig(noise_std_m=0.003)),
    WorldChange("20 ms latency", camera=CameraConfig(latency_s=0.02)),
    WorldChange("60 Hz camera", camera=CameraConfig(rate_hz=60.0)),
    WorldChange("20 % of frames lost", camera=CameraConfig(dropout=0.2)),
    WorldChange("60 Hz, 3 mm, 20 ms, 10 % lost", camera=CameraConfig(60.0, 0.003, 0.02, 0.1)),
)
_FEEDS = {"wide": "1.5 times as wide", "twice": "twice as wide", "thrice": "three times as wide"}


def robustness_conditions() -> dict[str, Conditions]:
    """By the name under which they stand in the table; each differs from the nominal in what it says.

    The ball through the estimator stands where it is hardest to see, and where it is easiest.
    """
    changes = [*CHANGES.values(), *_CAMERAS]
    found = {change.title: Conditions(change.in_bullet()) for change in changes}
    for change in (CHANGES[AS_TAUGHT], _CAMERAS[-1]):
        found[change.title + WITH_ESTIMATOR] = replace(found[change.title], filtered=True)
    for name, width in _FEEDS.items():
        found[f"feeds {width}"] = Conditions(spread=SPREADS[name])
    return found

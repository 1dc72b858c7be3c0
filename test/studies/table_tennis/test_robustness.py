"""Every condition of the table may fail: it changes what becomes of the same balls."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from msrd_ros.cluster.processes import ThisProcess
from msrd_ros.core.errors import UserError
from msrd_ros.robots.loading import default_robot
from msrd_ros.studies.table_tennis.playing import Conditions, LearnedStrokes, evaluation_balls, play_balls
from msrd_ros.studies.table_tennis.robustness import NOMINAL, robustness_conditions
from msrd_ros.table_tennis.ball.camera import CameraConfig
from msrd_ros.table_tennis.ball.feeder import STANDARD
from msrd_ros.table_tennis.simulation.batched import KinematicRallies, KinematicRalliesConfig, RallyPlan
from msrd_ros.table_tennis.simulation.bullet_arm import ArmConfig
from msrd_ros.table_tennis.simulation.changes import AS_TAUGHT, CHANGES, WorldChange, find_change
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS
from msrd_ros.table_tennis.strategies.table import Side
from msrd_ros.table_tennis.strokes.policies import StrokePolicies

pytestmark = pytest.mark.slow

SHIPPED = default_robot().folder / "policies.safetensors"
MISSED = np.array([9.0, 9.0])
"""Where a ball that was not returned counts as landed, m: far from any that was."""


def landings(conditions: Conditions) -> NDArray[np.float64]:
    """Where the same balls land under some conditions, (12, 2) in m."""
    balls = evaluation_balls(ALL_LABELS, 2, 77, STANDARD)
    played = play_balls(ThisProcess(), LearnedStrokes(StrokePolicies.load(SHIPPED)), balls, conditions)
    return np.array([(o.landing_x_m, o.landing_y_m) if o.returned else MISSED for o in played.outcomes])


@pytest.fixture(scope="module")
def usual() -> NDArray[np.float64]:
    return landings(Conditions())


@pytest.mark.parametrize("name", [name for name in CHANGES if name != AS_TAUGHT])
def test_a_change_of_the_world_moves_where_the_same_balls_land(usual: NDArray[np.float64], name: str) -> None:
    moved = np.linalg.norm(landings(Conditions(CHANGES[name].in_bullet())) - usual, axis=1)
    assert np.median(moved) > 0.01


def test_a_tenth_more_mass_is_no_such_change(usual: NDArray[np.float64]) -> None:
    # The driver's gains undo it: why there is no row of it.
    heavier = WorldChange("heavier", arm=ArmConfig(mass_scale=1.1))
    moved = np.linalg.norm(landings(Conditions(heavier.in_bullet())) - usual, axis=1)
    assert 0.0 < np.median(moved) < 0.005


@pytest.mark.parametrize("name", [n for n in robustness_conditions() if n != NOMINAL])
def test_a_condition_differs_from_the_nominal_one(name: str) -> None:
    conditions = robustness_conditions()
    assert conditions[name] != conditions[NOMINAL]
    assert conditions[NOMINAL] == Conditions()


def seen_balls(change: WorldChange) -> NDArray[np.float64]:
    """What the batched simulator shows of four balls past an arm that stands still, (1, 4, H, 3) in m."""
    policies = StrokePolicies.load(SHIPPED)
    plans = [RallyPlan(Side.FOREHAND, policies.require(ALL_LABELS[0]).ready_pose)]
    batch = KinematicRallies(plans, change.in_batch(KinematicRalliesConfig(threads=1)))
    batch.reset(1, 4, np.random.default_rng(5))
    return batch.play(np.zeros((1, 4, 1, len(plans[0].ready_position))))[..., -6:-3]


def test_training_in_the_batched_simulator_meets_the_same_change() -> None:
    paths = [seen_balls(find_change(name)) for name in ("high_table", AS_TAUGHT)]
    moved = np.abs(paths[0] - paths[1]).max(axis=(0, 1, 3))
    assert moved[5] == 0.0  # before the bounce
    assert moved[-1] > 0.01


def test_a_worn_rubber_is_that_of_the_batched_scene() -> None:
    change = find_change("worn_rubber")
    assert change.in_batch(KinematicRalliesConfig()).scene == change.scene
    assert change.in_bullet().rally.scene == change.scene


def test_a_worse_camera_is_what_is_trained_with() -> None:
    camera = CameraConfig(noise_std_m=0.003, latency_s=0.02)
    variation = WorldChange("camera", camera=camera).in_batch(KinematicRalliesConfig()).variation
    assert (variation.camera_noise_m, variation.camera_latency_s) == (0.003, 0.02)


@pytest.mark.parametrize(
    "change",
    [find_change("backlash"), WorldChange("slow", camera=replace(CameraConfig(), rate_hz=60.0))],
    ids=["arm", "camera"],
)
def test_what_the_batched_simulator_cannot_play_is_refused(change: WorldChange) -> None:
    with pytest.raises(UserError, match=f"{change.title}.*play in Bullet"):
        change.in_batch(KinematicRalliesConfig())


def test_an_unknown_world_is_refused_with_those_that_there_are() -> None:
    with pytest.raises(UserError, match=r"'moon' is unknown.*payload"):
        find_change("moon")


@pytest.mark.parametrize(
    ("name", "value"),
    [("payload_kg", -1.0), ("limits_share", 0.0), ("limits_share", 1.5), ("dead_time_s", float("nan"))],
)
def test_an_arm_that_cannot_be_is_refused_by_name(name: str, value: float) -> None:
    with pytest.raises(UserError, match=name):
        ArmConfig(**{name: value})

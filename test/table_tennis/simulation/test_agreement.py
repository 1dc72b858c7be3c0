"""The batched simulator against Bullet: the same actions and feeds, strokes good and bad."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from msrd_ros.contract.episode import (
    ACTING_STEPS,
    CONTROL_PERIOD_S,
    FIRST_ACTING_STEP,
    HORIZON,
    action_to_velocity,
)
from msrd_ros.contract.outcome import Outcome
from msrd_ros.robots.kinematics import paddle_pose
from msrd_ros.robots.limits import JointReference, shape_command
from msrd_ros.table_tennis.ball.feeder import STANDARD, Feed, Feeder
from msrd_ros.table_tennis.ball.referee import miss_reason
from msrd_ros.table_tennis.simulation.batched import (
    KinematicRallies,
    KinematicRalliesConfig,
    RallyPlan,
    RallyResults,
    RallyVariation,
)
from msrd_ros.table_tennis.simulation.rally import Rally
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS
from msrd_ros.table_tennis.teachers.planner import planned_strokes
from sawyer import ARM, ROBOT, SPEED_LIMIT_RAD_S

pytestmark = pytest.mark.slow

EPISODES = 50
"""Of each label."""
CLUMSINESS = 0.07
"""Standard deviation of each joint's velocity error over a stroke, as a share of its limit: enough that
between 30 and 70 % of the balls come back."""
CLUMSY_FROM_STEP = 25


@dataclass(frozen=True)
class BulletEpisode:
    """Blade centres (T + 1, 3) and balls (T + 1, 9) at the ticks, and the outcome."""

    paddle: np.ndarray
    ball: np.ndarray
    outcome: Outcome


def play_in_bullet(rally: Rally, feed: np.ndarray, ready: np.ndarray, actions: np.ndarray) -> BulletEpisode:
    """Play one ball with given actions (T, 7), commanded as the executor does."""
    rally.reset(ready)
    rally.launch(Feed.from_state(feed))
    reference = JointReference(ready.copy(), np.zeros(7))
    paddle, ball = [rally.paddle.position], [rally.ball]
    for tick in range(HORIZON):
        acting = FIRST_ACTING_STEP <= tick < FIRST_ACTING_STEP + ACTING_STEPS
        wanted = action_to_velocity(ROBOT, actions[tick - FIRST_ACTING_STEP]) if acting else np.zeros(7)
        reference = shape_command(ROBOT, reference, wanted, CONTROL_PERIOD_S)
        rally.command(reference.position, reference.velocity, CONTROL_PERIOD_S)
        rally.advance(CONTROL_PERIOD_S)
        paddle.append(rally.paddle.position)
        ball.append(rally.ball)
    outcome = rally.play_out() if rally.ball_in_play else rally.outcome
    assert outcome is not None
    return BulletEpisode(np.array(paddle), np.array(ball), outcome)


@dataclass(frozen=True)
class Comparison:
    """The same episodes in both simulators; arrays (S, K, ...)."""

    observations: np.ndarray
    results: RallyResults
    bullet: list[list[BulletEpisode]]

    def of_outcomes(self, name: str) -> np.ndarray:
        """One attribute of every outcome in Bullet, shape (S, K)."""
        return np.array([[getattr(episode.outcome, name) for episode in row] for row in self.bullet])


@pytest.fixture(scope="module")
def comparison() -> Comparison:
    rng = np.random.default_rng(20)
    strokes = [planned_strokes()[label] for label in ALL_LABELS]
    feeds = np.stack([Feeder().sample_states(label.side, STANDARD, EPISODES, rng) for label in ALL_LABELS])
    ready = np.stack([np.tile(stroke.start.position, (EPISODES, 1)) for stroke in strokes])
    ends = (FIRST_ACTING_STEP + 1.0 + np.arange(float(ACTING_STEPS))) * CONTROL_PERIOD_S
    planned = np.stack([stroke.sample(ends).velocity / SPEED_LIMIT_RAD_S for stroke in strokes])
    errors = CLUMSINESS * rng.standard_normal((len(strokes), EPISODES, 1, 7))
    actions = planned[:, None] + errors * (np.arange(ACTING_STEPS) >= CLUMSY_FROM_STEP)[:, None]

    plans = [
        RallyPlan(label.side, stroke.start.position)
        for label, stroke in zip(ALL_LABELS, strokes, strict=True)
    ]
    variation = RallyVariation(camera_noise_m=0.0)
    batched = KinematicRallies(plans, KinematicRalliesConfig(variation=variation, threads=1))
    batched.start(feeds, ready, rng)
    observations = batched.play(actions)
    with Rally() as rally:
        bullet = [
            [play_in_bullet(rally, *episode) for episode in zip(*row, strict=True)]
            for row in zip(feeds, ready, actions, strict=True)
        ]
        assert rally.limits.limits_exceeded == 0
    return Comparison(observations, batched.results(), bullet)


def test_returned_and_missed_balls_agree(comparison: Comparison) -> None:
    bullet, batched = comparison.of_outcomes("returned"), comparison.results.returned
    np.testing.assert_array_less(0.30, bullet.mean(axis=1))
    np.testing.assert_array_less(bullet.mean(axis=1), 0.70)
    assert np.mean(batched[bullet]) >= 0.95
    assert np.mean(~batched[~bullet]) >= 0.95
    assert abs(batched.mean() - bullet.mean()) <= 0.02
    np.testing.assert_allclose(batched.mean(axis=1), bullet.mean(axis=1), atol=0.0201)


def test_reasons_and_touches_agree(comparison: Comparison) -> None:
    struck = comparison.of_outcomes("struck")
    assert np.mean(struck == comparison.results.struck) >= 0.98
    reasons = [[miss_reason(int(verdict)) for verdict in row] for row in comparison.results.verdict]
    assert np.mean(comparison.of_outcomes("miss_reason") == np.array(reasons)) >= 0.95


def test_paddles_take_the_same_path(comparison: Comparison) -> None:
    """Bullet's arm leaves its commands only where its torques do not suffice or the table is in the way."""
    apart = []
    for row, episodes in zip(comparison.observations, comparison.bullet, strict=True):
        for seen, episode in zip(row, episodes, strict=True):
            centres = np.array([paddle_pose(ARM, joints)[0] for joints in seen[:, :7]])
            apart.append(np.linalg.norm(centres - episode.paddle[FIRST_ACTING_STEP + 1 :], axis=1))
    assert np.percentile(apart, 99.5) < 0.001
    # One clumsy stroke in 300 ends so low that the driver stops it above the table.
    assert np.sum(np.max(apart, axis=1) > 0.01) <= 3


def test_balls_take_the_same_path(comparison: Comparison) -> None:
    hit_tick = np.floor(comparison.results.hit_time / CONTROL_PERIOD_S)
    struck = comparison.results.struck & comparison.of_outcomes("struck")
    after = []
    for index in np.ndindex(*struck.shape):
        seen = comparison.observations[index][:, 7:10]
        truth = comparison.bullet[index[0]][index[1]].ball[FIRST_ACTING_STEP + 1 :, :3]
        apart = np.linalg.norm(seen - truth, axis=1)
        first = int(hit_tick[index]) - FIRST_ACTING_STEP - 1 if struck[index] else 60
        # Until the hit the same functions, with steps of 1 and 5 ms.
        assert apart[:first].max() < 1e-5
        if struck[index]:
            after.append(apart[first + 10])
    assert np.median(after) < 0.002
    assert np.percentile(after, 95) < 0.01


def test_spin_and_landing_agree(comparison: Comparison) -> None:
    returned = comparison.results.returned & comparison.of_outcomes("returned")
    spin = np.stack([comparison.of_outcomes(f"spin_{axis}_rad_s") for axis in "xyz"], axis=-1)
    landing = np.stack([comparison.of_outcomes(f"landing_{axis}_m") for axis in "xy"], axis=-1)
    assert np.percentile(np.abs(spin - comparison.results.spin)[returned], 95) < 2.0
    assert np.percentile(np.abs(landing - comparison.results.landing)[returned], 95) < 0.03
    hit_time = comparison.of_outcomes("hit_time_s")
    np.testing.assert_allclose(hit_time[returned], comparison.results.hit_time[returned], atol=0.001)

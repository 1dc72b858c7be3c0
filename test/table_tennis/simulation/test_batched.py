"""The batched simulator against a plain loop of the same functions, and its promises to learning."""

from __future__ import annotations

import numpy as np
import pytest

from msrd_ros.contract.episode import ACTING_STEPS, CONTROL_PERIOD_S, HORIZON, action_to_velocity
from msrd_ros.core.errors import UserError
from msrd_ros.learning.rollouts import BatchedEnvironment
from msrd_ros.robots.kinematics import place_moving_paddle
from msrd_ros.robots.limits import JointReference, shape_command
from msrd_ros.table_tennis.ball.feeder import NO_SPREAD, STANDARD, Feeder
from msrd_ros.table_tennis.ball.referee import RETURNED, new_referees
from msrd_ros.table_tennis.ball.scene import Scene
from msrd_ros.table_tennis.ball.step import step_ball
from msrd_ros.table_tennis.simulation.batched import (
    KinematicRallies,
    KinematicRalliesConfig,
    RallyPlan,
    RallyVariation,
)
from msrd_ros.table_tennis.strategies.table import Side
from sawyer import (
    ACCELERATION_LIMIT_RAD_S2,
    ARM,
    POSITION_LOWER_RAD,
    POSITION_UPPER_RAD,
    ROBOT,
    SPEED_LIMIT_RAD_S,
)

pytestmark = pytest.mark.slow

SCENE = Scene()
READY = {
    Side.FOREHAND: np.array([0.02, 0.68, -1.30, 0.66, -0.47, 1.68, -0.04]),
    Side.BACKHAND: np.array([-0.27, 0.79, -1.04, -0.95, -0.65, -1.66, 4.13]),
}
PLANS = [RallyPlan(side, READY[side]) for side in Side]


def rallies(threads: int = 1, **variation: object) -> KinematicRallies:
    return KinematicRallies(
        PLANS,
        KinematicRalliesConfig(variation=RallyVariation(**variation), threads=threads),  # type: ignore[arg-type]
    )


def swings(rng: np.random.Generator, episodes: int) -> np.ndarray:
    """Actions (S, K, T, 7) that move the arms about where the ball comes by."""
    return (
        rng.uniform(-0.6, 0.6, (len(PLANS), episodes, 1, 7))
        * np.sin(np.linspace(0, 6, ACTING_STEPS))[:, None]
    )


def reaching(episodes: int) -> np.ndarray:
    """Actions (S, K, T, 7) that lead the paddles into the ball's way, each a little differently."""
    rng = np.random.default_rng(11)
    hits = {
        Side.FOREHAND: np.array([-0.07, 0.45, -1.34, 0.38, -0.64, 1.51, -0.14]),
        Side.BACKHAND: np.array([-0.33, 0.82, -0.85, -0.90, -0.38, -1.62, 4.06]),
    }
    actions = np.zeros((len(PLANS), episodes, ACTING_STEPS, 7))
    for index, plan in enumerate(PLANS):
        speed = (hits[plan.side] - plan.ready_position) / 0.2 / SPEED_LIMIT_RAD_S
        actions[index, :, 36:50] = speed + rng.normal(0, 0.05, (episodes, 1, 7))
    return actions


def test_it_is_a_batched_environment() -> None:
    environment: BatchedEnvironment = rallies()
    observation = environment.reset(2, 3, np.random.default_rng(0))
    assert observation.shape == (2, 3, len(environment.observation_names)) == (2, 3, 13)
    assert environment.step(np.zeros((2, 3, 7))).shape == (2, 3, 13)
    assert len(environment.action_names) == 7
    assert environment.acting_steps == ACTING_STEPS
    assert environment.horizon == HORIZON - 1


def test_a_plain_loop_of_the_same_functions_gives_the_same_numbers() -> None:
    """Ball to the last bit of what matters with steps of 1 ms instead of 5; arm exactly."""
    episodes = 20
    environment = rallies(camera_noise_m=0.0)
    rng = np.random.default_rng(1)
    feeds = np.stack([Feeder().sample_states(plan.side, STANDARD, episodes, rng) for plan in PLANS])
    ready = np.stack([np.tile(plan.ready_position, (episodes, 1)) for plan in PLANS])
    actions = reaching(episodes)
    environment.start(feeds, ready, rng)
    observations = environment.play(actions)
    results = environment.results()
    assert 0.3 < results.struck.mean() <= 1.0
    for side, episode in np.ndindex(2, episodes):
        ball, referee = feeds[side, episode].copy(), new_referees(1)
        reference = JointReference(ready[side, episode].copy(), np.zeros(7))
        before, after = np.empty(12), np.empty(12)
        for tick in range(HORIZON):
            wanted = np.zeros(7)
            if 1 <= tick <= ACTING_STEPS:
                wanted = action_to_velocity(ROBOT, actions[side, episode, tick - 1])
            following = shape_command(ROBOT, reference, wanted, CONTROL_PERIOD_S)
            change = following.velocity - reference.velocity
            place_moving_paddle(ARM, *reference, before)
            for index in range(20):
                share = (index + 1) / 20
                position = reference.position + share * CONTROL_PERIOD_S * (
                    reference.velocity + 0.5 * share * change
                )
                place_moving_paddle(ARM, position, reference.velocity + share * change, after)
                time = tick * CONTROL_PERIOD_S + index * 0.001
                step_ball(ball, referee, before, after, time, 0.001, SCENE.constants())
                before[:] = after
            reference = following
            if tick >= 1:
                seen = observations[side, episode, tick - 1]
                np.testing.assert_allclose(seen[:7], reference.position, atol=1e-12)
                np.testing.assert_allclose(seen[7:10], ball[:3], atol=2e-3)
        assert (referee[0]["hits"] > 0) == results.struck[side, episode]
        if referee[0]["verdict"] and referee[0]["hits"]:
            assert referee[0]["verdict"] == results.verdict[side, episode]
            assert referee[0]["hit_time"] == pytest.approx(results.hit_time[side, episode], abs=1e-4)
            assert referee[0]["spin_y"] == pytest.approx(results.spin[side, episode, 1], abs=0.5)


def test_results_depend_on_the_seed_and_not_on_the_threads() -> None:
    def run(threads: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
        environment = rallies(threads=threads)
        environment.reset(2, 7, np.random.default_rng(seed))
        return environment.play(swings(np.random.default_rng(5), 7)), environment.results().hit_time

    one, again, two, three, other = run(1, 0), run(1, 0), run(2, 0), run(3, 0), run(1, 1)
    for left, right in ((one, again), (one, two), (one, three)):
        np.testing.assert_array_equal(left[0], right[0])
        np.testing.assert_array_equal(left[1], right[1])
    assert not np.array_equal(one[0], other[0])


def test_rallies_do_not_touch_one_another() -> None:
    environment = rallies(camera_noise_m=0.0)
    rng = np.random.default_rng(2)
    feeds = np.stack([Feeder().sample_states(plan.side, STANDARD, 6, rng) for plan in PLANS])
    ready = np.stack([np.tile(plan.ready_position, (6, 1)) for plan in PLANS])
    actions = reaching(6)
    environment.start(feeds, ready, rng)
    together = environment.play(actions)
    environment.start(feeds[:, 3:4], ready[:, 3:4], rng)
    np.testing.assert_array_equal(environment.play(actions[:, 3:4]), together[:, 3:4])


def test_observations_are_joints_and_the_ball_as_a_camera_sees_it() -> None:
    noise = 0.002
    environment = rallies(camera_noise_m=noise, feed_spread=NO_SPREAD, ready_std_rad=0.0)
    first = environment.reset(2, 400, np.random.default_rng(3))
    np.testing.assert_array_equal(first[..., :7], np.stack([[plan.ready_position] * 400 for plan in PLANS]))
    errors = first[..., 7:10] - environment.ball[..., :3]
    np.testing.assert_allclose(errors.std(axis=(0, 1)), noise, rtol=0.15)
    second = environment.step(np.zeros((2, 400, 7)))
    np.testing.assert_allclose(second[..., 10:], (second[..., 7:10] - first[..., 7:10]) / CONTROL_PERIOD_S)


def test_a_late_camera_shows_where_the_ball_was() -> None:
    latency_s = 0.015
    environment = rallies(camera_noise_m=0.0, camera_latency_s=latency_s)
    environment.reset(2, 300, np.random.default_rng(3))
    for _ in range(2):
        seen = environment.step(np.zeros((2, 300, 7)))[..., 7:10]
    ball = environment.ball
    # Free flight: the way to the ball over its speed is the age of what is seen.
    age_s = ((ball[..., :3] - seen) * ball[..., 3:6]).sum(axis=-1) / np.square(ball[..., 3:6]).sum(axis=-1)
    assert age_s.min() > -1e-4
    assert age_s.max() < 1.05 * latency_s
    np.testing.assert_allclose(age_s.mean(), latency_s / 2, rtol=0.1)
    with pytest.raises(UserError, match=r"camera_latency_s is 0\.1; the batched simulator knows 0 to 0\.02"):
        rallies(camera_latency_s=0.1)


def test_ready_poses_and_feeds_vary_as_asked() -> None:
    environment = rallies(ready_std_rad=0.05, feed_spread=STANDARD)
    environment.reset(2, 500, np.random.default_rng(4))
    offsets = environment.joint_position - np.stack([plan.ready_position for plan in PLANS])[:, None]
    np.testing.assert_allclose(offsets.std(axis=1), 0.05, rtol=0.2)
    assert environment.ball[0, :, 1].mean() < -0.005 < 0.005 < environment.ball[1, :, 1].mean()
    assert environment.ball[0, :, 4].std() > 0.03


def test_no_action_makes_a_joint_break_its_limits() -> None:
    environment = rallies()
    rng = np.random.default_rng(6)
    environment.reset(2, 30, rng)
    before = environment.joint_velocity
    for step in range(environment.horizon):
        action = rng.choice(
            [-1e9, -1.0, 0.3, 1.0, np.inf, -np.inf], (2, 30, 7), p=[0.3, 0.1, 0.1, 0.1, 0.3, 0.1]
        )
        environment.step(action)
        position, velocity = environment.joint_position, environment.joint_velocity
        assert (np.abs(velocity) <= SPEED_LIMIT_RAD_S + 1e-12).all()
        assert (position >= POSITION_LOWER_RAD).all()
        assert (position <= POSITION_UPPER_RAD).all()
        assert (np.abs(velocity - before) <= ACCELERATION_LIMIT_RAD_S2 * CONTROL_PERIOD_S + 1e-9).all()
        if step >= ACTING_STEPS + 10:
            np.testing.assert_array_equal(velocity, 0.0)
        before = velocity


def test_an_action_that_is_not_a_number_is_refused() -> None:
    environment = rallies()
    environment.reset(2, 1, np.random.default_rng(0))
    with pytest.raises(UserError, match="not a number"):
        environment.step(np.full((2, 1, 7), np.nan))


def test_as_many_strategies_as_plans_are_asked_for() -> None:
    with pytest.raises(UserError, match="3 strategies"):
        rallies().reset(3, 1, np.random.default_rng(0))


def test_results_look_ahead_without_changing_the_rallies() -> None:
    environment = rallies(camera_noise_m=0.0)
    environment.reset(2, 30, np.random.default_rng(8))
    actions = reaching(30)
    for step in range(55):
        environment.step(actions[:, :, step])
    ball = environment.ball
    early = environment.results()
    np.testing.assert_array_equal(environment.ball, ball)
    for step in range(55, environment.horizon):
        environment.step(actions[:, :, step] if step < ACTING_STEPS else np.zeros((2, 30, 7)))
    late = environment.results()
    assert (late.struck | ~early.struck).all()
    assert late.struck.any()
    returned = late.returned
    np.testing.assert_array_equal(returned, late.verdict == RETURNED)
    np.testing.assert_array_equal(returned, np.isfinite(late.landing).all(axis=-1))
    np.testing.assert_array_equal(late.struck, np.isfinite(late.spin).all(axis=-1))
    assert (late.landing[returned][:, 0] > 0).all()

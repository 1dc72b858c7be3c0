"""Playing a strategy: its phases, and that no policy, however wrong, makes an unsafe command."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from msrd_ros.contract.episode import ACTING_STEPS, CONTROL_PERIOD_S, FIRST_ACTING_STEP, HORIZON
from msrd_ros.core.errors import UserError
from msrd_ros.table_tennis.ball.feeder import STANDARD, Feeder
from msrd_ros.table_tennis.simulation.world import World, WorldConfig
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS
from msrd_ros.table_tennis.strokes.player import Phase, StrokePlayer
from msrd_ros.table_tennis.teachers.planner import planned_strokes
from sawyer import (
    ACCELERATION_LIMIT_RAD_S2,
    HOME_POSTURE_RAD,
    POSITION_LOWER_RAD,
    POSITION_UPPER_RAD,
    ROBOT,
    SPEED_LIMIT_RAD_S,
)

pytestmark = pytest.mark.slow

LABEL = ALL_LABELS[2]
ROUNDING = 1e-9
Wrong = Callable[[np.random.Generator, int], np.ndarray]

WRONG: dict[str, Wrong] = {
    "noise": lambda rng, step: 5.0 * rng.normal(size=7),
    "full_speed_to_and_fro": lambda rng, step: np.full(7, 1.0 if step % 40 < 20 else -1.0),
    "huge": lambda rng, step: 1e308 * rng.choice([-1.0, 1.0], size=7),
    "infinite": lambda rng, step: rng.choice([-np.inf, np.inf], size=7),
    "not_a_number": lambda rng, step: np.full(7, np.nan),
    "anything": lambda rng, step: rng.choice([0.3, -1.0, 1e308, -np.inf, np.inf, np.nan], size=7),
}


def at_ball(step: int) -> tuple[np.ndarray, int]:
    """A sample of a ball that is fed at step 3."""
    return np.array([1.5 - 0.1 * max(step - 3, 0), 0.0, 1.0]), 20_000_000 * step


@pytest.mark.parametrize("kind", WRONG)
def test_no_policy_leads_a_joint_over_a_limit(kind: str) -> None:
    """1,000 acting steps in Bullet, ball after ball; counted by the rally's own log."""
    rng = np.random.default_rng(0)
    world = World(WorldConfig())
    world.strategy = LABEL
    ready = planned_strokes()[LABEL].start.position
    world.rally.reset(ready)
    player = StrokePlayer(ROBOT, ready)
    acted = refused = 0

    def policy(_: np.ndarray) -> np.ndarray:
        nonlocal acted
        acted += 1
        return WRONG[kind](rng, acted)

    player.prepare(policy, ready)
    steps = 0
    # A stroke is over with its first output that is no number.
    while acted < 1000 and refused < 20:
        steps += 1
        assert steps < 10_000
        if not world.feeds_waiting and not world.rally.ball_in_play:
            world.feed(Feeder().sample(LABEL.side, STANDARD, rng))
        tick, before = world.tick(), player.reference
        try:
            after = player.tick(tick.joint_position, tick.ball_position, tick.ball_stamp_ns)
        except UserError:
            refused += 1
            after = player.hold()
        assert np.isfinite(after.position).all()
        assert np.isfinite(after.velocity).all()
        assert np.all(np.abs(after.velocity) <= SPEED_LIMIT_RAD_S + ROUNDING)
        change = np.abs(after.velocity - before.velocity)
        if player.phase is not Phase.READY:
            assert np.all(change <= ACCELERATION_LIMIT_RAD_S2 * CONTROL_PERIOD_S + ROUNDING)
        assert np.all((after.position >= POSITION_LOWER_RAD) & (after.position <= POSITION_UPPER_RAD))
        world.command(after.position, after.velocity, CONTROL_PERIOD_S, LABEL)
        world.advance(CONTROL_PERIOD_S)
    limits = world.rally.limits
    world.close()
    assert limits.limits_exceeded == 0, limits
    assert (refused > 0) == (kind in ("not_a_number", "anything"))
    if kind not in ("not_a_number", "anything"):
        assert limits.samples >= 20 * acted
        assert limits.speed_fraction.max() > 0.5


def test_a_stroke_holds_a_tick_acts_rests_and_makes_ready_again() -> None:
    """The first action answers the second sample: only then is the ball's velocity known."""
    seen: list[int] = []
    player = StrokePlayer(ROBOT, HOME_POSTURE_RAD)
    step = 0

    def policy(observation: np.ndarray) -> np.ndarray:
        seen.append(step)
        assert observation[10] == pytest.approx(-5.0)
        return np.full(7, 0.2)

    player.prepare(policy, HOME_POSTURE_RAD)
    phases = []
    for step in range(3 + HORIZON + 40):
        player.tick(player.reference.position, *at_ball(step))
        phases.append(player.phase)
    assert seen == list(range(3 + FIRST_ACTING_STEP, 3 + FIRST_ACTING_STEP + ACTING_STEPS))
    assert phases[:4] == [Phase.READY] * 4
    assert phases[4 : 3 + ACTING_STEPS] == [Phase.STROKE] * (ACTING_STEPS - 1)
    assert phases[3 + ACTING_STEPS] is Phase.RESTING
    assert phases[3 + HORIZON - 1] is Phase.READYING
    assert phases[-1] is Phase.READY
    assert player.strokes_begun == 1
    # Landed exactly, so that the next stroke starts from the same numbers.
    np.testing.assert_array_equal(player.reference.position, HOME_POSTURE_RAD)
    np.testing.assert_array_equal(player.reference.velocity, 0.0)


def test_a_ball_that_comes_before_the_arm_is_ready_is_let_through() -> None:
    player = StrokePlayer(ROBOT, HOME_POSTURE_RAD)

    def policy(_: np.ndarray) -> np.ndarray:
        raise AssertionError("nothing to play")

    player.prepare(policy, HOME_POSTURE_RAD + 0.5)
    for step in range(60):
        player.tick(player.reference.position, *at_ball(step))
    assert player.strokes_begun == 0
    assert player.between_strokes


def test_a_ready_pose_beyond_the_limits_is_drawn_in() -> None:
    player = StrokePlayer(ROBOT, HOME_POSTURE_RAD)
    pose = HOME_POSTURE_RAD.copy()
    pose[1] = POSITION_UPPER_RAD[1] + 0.02
    player.prepare(None, pose)
    for step in range(300):
        player.tick(player.reference.position, np.array([1.5, 0.0, 1.0]), 20_000_000 * step)
    assert player.phase is Phase.READY
    assert 0.0 < POSITION_UPPER_RAD[1] - player.reference.position[1] < 0.02
    np.testing.assert_array_equal(np.delete(player.reference.position, 1), np.delete(pose, 1))


def test_without_a_policy_the_arm_stays_ready() -> None:
    player = StrokePlayer(ROBOT, HOME_POSTURE_RAD)
    for step in range(20):
        reference = player.tick(HOME_POSTURE_RAD, *at_ball(step))
    assert player.phase is Phase.READY
    np.testing.assert_array_equal(reference.position, HOME_POSTURE_RAD)


def test_a_hold_decelerates_and_ends_the_stroke() -> None:
    player = StrokePlayer(ROBOT, HOME_POSTURE_RAD)
    player.prepare(lambda _: np.full(7, 0.8), HOME_POSTURE_RAD)
    for step in range(15):
        player.tick(player.reference.position, *at_ball(step))
    assert player.phase is Phase.STROKE
    speeds = [np.abs(player.reference.velocity)]
    speeds += [np.abs(player.hold().velocity) for _ in range(30)]
    assert np.all(np.diff(speeds, axis=0) <= 0.0)
    assert not speeds[-1].any()
    assert not player.between_strokes
    held = player.reference.position
    np.testing.assert_array_equal(player.hold().position, held)


@pytest.mark.parametrize("start", [POSITION_LOWER_RAD, POSITION_UPPER_RAD])
def test_an_arm_found_at_its_limits_is_led_away_from_them(start: np.ndarray) -> None:
    player = StrokePlayer(ROBOT, start)
    player.prepare(None, HOME_POSTURE_RAD)
    for step in range(600):
        reference = player.tick(player.reference.position, np.array([1.5, 0.0, 1.0]), 20_000_000 * step)
        assert np.all((reference.position >= POSITION_LOWER_RAD) & (reference.position <= POSITION_UPPER_RAD))
    assert player.phase is Phase.READY


def test_an_arm_that_strays_is_led_on_from_where_it_is() -> None:
    player = StrokePlayer(ROBOT, HOME_POSTURE_RAD, tracking_tolerance_rad=0.1)
    player.prepare(lambda _: np.full(7, 0.5), HOME_POSTURE_RAD)
    for step in range(15):
        player.tick(player.reference.position, *at_ball(step))
    before = player.phase
    held_up = player.reference.position - np.array([0.0, 0.0, 0.11, 0.0, 0.0, 0.0, 0.0])
    references = [player.reference, *(player.tick(held_up, *at_ball(step)) for step in range(15, 45))]
    assert (before, player.phase) == (Phase.STROKE, Phase.RESTING)
    # Back to where the arm is, within the limits all the way.
    assert np.abs(references[-1].position - held_up).max() < 0.1 * 0.2
    changes = np.abs(np.diff([reference.velocity for reference in references], axis=0))
    assert np.all(changes <= ACCELERATION_LIMIT_RAD_S2 * CONTROL_PERIOD_S + ROUNDING)
    # The stroke counts, and the next one comes after its time.
    for step in range(45, 3 + HORIZON):
        player.tick(player.reference.position, *at_ball(step))
    assert (player.phase, player.strokes_begun) == (Phase.READYING, 1)

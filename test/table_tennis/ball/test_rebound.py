"""Rebounds against the published formulas, and touches that nothing slips through."""

from __future__ import annotations

import numpy as np
import pytest

from msrd_ros.table_tennis.ball.flight import ball_state, fly, mechanical_energy
from msrd_ros.table_tennis.ball.rebound import rebound_rigid, rebound_rubber
from msrd_ros.table_tennis.ball.referee import new_referees
from msrd_ros.table_tennis.ball.scene import Scene
from msrd_ros.table_tennis.ball.step import step_ball
from msrd_ros.table_tennis.ball.surfaces import (
    NET,
    NO_PADDLE,
    PADDLE,
    TABLE,
    TABLE_SIDE,
    blade_gap,
    box_gap,
    fixed_gap,
)

SCENE = Scene()
CONSTANTS = SCENE.constants()
RADIUS, MASS, INERTIA = SCENE.ball.radius_m, SCENE.ball.mass_kg, SCENE.ball.inertia_kg_m2
BLADE_RADIUS, HALF_THICKNESS = SCENE.blade.radius_m, SCENE.blade.thickness_m / 2


def random_unit(rng: np.random.Generator) -> np.ndarray:
    vector = rng.normal(size=3)
    return vector / np.linalg.norm(vector)


def xyz(vector: np.ndarray) -> tuple[float, float, float]:
    x, y, z = vector
    return x, y, z


def split(ball: np.ndarray, normal: np.ndarray, surface: np.ndarray) -> tuple[float, np.ndarray]:
    """Normal speed of the ball relative to a surface, and slip of its contact point."""
    velocity = ball[3:6] - surface
    speed = float(velocity @ normal)
    return speed, velocity - speed * normal + np.cross(ball[6:9], -RADIUS * normal)


def paddle_at(
    centre: np.ndarray, normal: np.ndarray, velocity: np.ndarray | None = None, spin: np.ndarray | None = None
) -> np.ndarray:
    zero = np.zeros(3)
    return np.concatenate(
        [centre, normal, zero if velocity is None else velocity, zero if spin is None else spin]
    )


def test_table_rebound_slides_or_grips_as_published() -> None:
    rng = np.random.default_rng(2)
    normal = np.array([0.0, 0.0, 1.0])
    grips = 0
    for _ in range(500):
        ball = ball_state((0, 0, 1), [*rng.normal(0, 4, 2), -rng.uniform(0.2, 6)], rng.normal(0, 100, 3))
        speed, slip = split(ball, normal, np.zeros(3))
        before = ball.copy()
        rebound_rigid(ball, 0.0, 0.0, 1.0, 0.9, 0.25, CONSTANTS[0])
        after_speed, after_slip = split(ball, normal, np.zeros(3))
        assert after_speed == pytest.approx(-0.9 * speed)
        # Nakashima 2010: Coulomb friction while it slides, no slip once it grips.
        slide = 0.25 * 1.9 * abs(speed)
        if slide * 2.5 >= np.linalg.norm(slip):
            grips += 1
            np.testing.assert_allclose(after_slip, 0.0, atol=1e-9)
        else:
            np.testing.assert_allclose(
                ball[3:5] - before[3:5], -slide * slip[:2] / np.linalg.norm(slip), rtol=1e-9, atol=1e-12
            )
        # Angular momentum about the contact point is kept.
        for state in (before, ball):
            state[3:6] *= MASS
        lever = np.array([0.0, 0.0, RADIUS])
        moment = np.cross(lever, ball[3:6] - before[3:6]) + INERTIA * (ball[6:] - before[6:])
        np.testing.assert_allclose(moment, 0.0, atol=1e-12)
    assert 50 < grips < 450


def test_rubber_rebound_loses_speed_and_reverses_slip_as_measured() -> None:
    rng = np.random.default_rng(3)
    for _ in range(500):
        normal, surface = random_unit(rng), rng.normal(0, 2, 3)
        ball = ball_state((0, 0, 1), surface + rng.normal(0, 3, 3), rng.normal(0, 100, 3))
        speed, slip = split(ball, normal, surface)
        if speed >= 0:
            continue
        before = ball.copy()
        rebound_rubber(ball, *xyz(normal), *xyz(surface), CONSTANTS[0])
        after_speed, after_slip = split(ball, normal, surface)
        restitution = 0.917 - 0.0217 * abs(speed)
        assert after_speed == pytest.approx(-restitution * speed)
        tangential = ball[3:6] - before[3:6] - (after_speed - speed) * normal
        np.testing.assert_allclose(tangential, -1.84e-3 / MASS * slip, atol=1e-9)
        # A thin shell's contact point is 5/2 as mobile as its mass: the slip comes back reversed.
        np.testing.assert_allclose(after_slip, (1 - 2.5 * 1.84e-3 / MASS) * slip, atol=1e-9)
        assert (1 - 2.5 * 1.84e-3 / MASS) < -0.6


def test_rebounds_leave_a_parting_ball_alone() -> None:
    ball = ball_state((0, 0, 1), (1.0, 0.0, 0.5), (0.0, 50.0, 0.0))
    before = ball.copy()
    rebound_rigid(ball, 0.0, 0.0, 1.0, 0.9, 0.25, CONSTANTS[0])
    rebound_rubber(ball, 0.0, 0.0, 1.0, 0.0, 0.0, 0.4, CONSTANTS[0])
    np.testing.assert_array_equal(ball, before)


def test_a_resting_paddle_never_adds_energy() -> None:
    rng = np.random.default_rng(4)
    for _ in range(300):
        normal = random_unit(rng)
        ball = ball_state((0, 0, 1), rng.normal(0, 5, 3), rng.normal(0, 150, 3))
        before = mechanical_energy(ball, CONSTANTS)
        rebound_rubber(ball, *xyz(normal), 0.0, 0.0, 0.0, CONSTANTS[0])
        assert mechanical_energy(ball, CONSTANTS) <= before + 1e-12


@pytest.mark.parametrize("period", [0.001, 0.005])
def test_a_moving_paddle_hits_with_its_velocity_at_the_contact(period: float) -> None:
    """Through the whole step: the rebound seen from the blade's own point obeys the formulas."""
    rng = np.random.default_rng(5)
    for _ in range(100):
        normal = random_unit(rng)
        turn, velocity = rng.normal(0, 5, 3), rng.normal(0, 1.5, 3)
        offset = np.cross(normal, random_unit(rng)) * 0.05
        # Where and how fast both are at the contact, half a step after its start.
        centre = np.array([-1.6, 0.0, 1.1])
        surface = velocity + np.cross(turn, offset + HALF_THICKNESS * normal)
        ball = ball_state(
            centre + offset + (HALF_THICKNESS + RADIUS) * normal,
            surface - rng.uniform(1.0, 6.0) * normal + 0.5 * np.cross(normal, rng.normal(size=3)),
            rng.normal(0, 60, 3),
        )
        expected = ball.copy()
        rebound_rubber(expected, *xyz(normal), *xyz(surface), CONSTANTS[0])
        half = period / 2
        before = turned_paddle(centre, normal, velocity, turn, -half)
        after = turned_paddle(centre, normal, velocity, turn, half)
        fly(ball, -half, CONSTANTS)
        referee = new_referees(1)
        referee["own_bounces"] = 1
        assert step_ball(ball, referee, before, after, 0.0, period, CONSTANTS) == PADDLE
        assert referee[0]["hit_time"] == pytest.approx(half, abs=2e-5)
        got = np.array([referee[0][f"velocity_{axis}"] for axis in "xyz"])
        np.testing.assert_allclose(got, expected[3:6], atol=0.01)
        got = np.array([referee[0][f"spin_{axis}"] for axis in "xyz"])
        np.testing.assert_allclose(got, expected[6:9], atol=0.6)


def turned_paddle(
    centre: np.ndarray, normal: np.ndarray, velocity: np.ndarray, turn: np.ndarray, time: float
) -> np.ndarray:
    """A paddle in steady motion, `time` seconds after it is at `centre` with `normal`."""
    angle = np.linalg.norm(turn) * time
    axis = turn / np.linalg.norm(turn)
    turned = (
        normal * np.cos(angle)
        + np.cross(axis, normal) * np.sin(angle)
        + axis * (axis @ normal) * (1 - np.cos(angle))
    )
    return paddle_at(centre + velocity * time, turned, velocity, turn)


def test_gaps_are_distances() -> None:
    """Against brute force over points of the bodies."""
    rng = np.random.default_rng(6)
    angles = np.linspace(0, 2 * np.pi, 721)
    radii = np.linspace(0, BLADE_RADIUS, 61)
    disk = np.stack(
        [
            np.outer(radii, np.cos(angles)).ravel(),
            np.outer(radii, np.sin(angles)).ravel(),
        ],
        axis=1,
    )
    for _ in range(40):
        point = rng.uniform(-0.15, 0.15, 3)
        gap, *gradient = blade_gap(*xyz(point), 0.0, 0.0, 1.0, BLADE_RADIUS, HALF_THICKNESS)
        if gap <= 0:
            continue
        heights = np.clip(point[2], -HALF_THICKNESS, HALF_THICKNESS)
        nearest = np.sqrt(((disk - point[:2]) ** 2).sum(axis=1) + (point[2] - heights) ** 2).min()
        assert gap == pytest.approx(nearest, abs=2e-4)
        assert np.linalg.norm(gradient) == pytest.approx(1.0)
    for _ in range(200):
        point = rng.uniform(-2, 2, 3)
        gap, *gradient = box_gap(*xyz(point), 1.0, 0.5, -0.2, 0.3)
        nearest = np.clip(point, [-1.0, -0.5, -0.2], [1.0, 0.5, 0.3])
        if gap > 0:
            assert gap == pytest.approx(np.linalg.norm(point - nearest))
            np.testing.assert_allclose(point - gap * np.array(gradient), nearest, atol=1e-12)
        else:
            np.testing.assert_array_equal(point, nearest)


def blade_clearance(ball: np.ndarray, paddle: np.ndarray) -> float:
    return blade_gap(*xyz(ball[:3] - paddle[:3]), *xyz(paddle[3:6]), BLADE_RADIUS, HALF_THICKNESS)[0] - RADIUS


@pytest.mark.parametrize("period", [0.001, 0.005])
def test_no_ball_tunnels_through_the_blade(period: float) -> None:
    """At up to 12 m/s of ball and paddle each, any way round: never inside one another, never through."""
    rng = np.random.default_rng(7)
    lead, meetings = 0.03, 0
    for _ in range(1000):
        normal, face = random_unit(rng), rng.choice([-1.0, 1.0])
        turn, paddle_velocity = rng.normal(0, 8, 3), random_unit(rng) * rng.uniform(0, 12)
        # Relative to the blade the ball comes steeply at a point inside its rim, at a moment inside a step.
        direction = -face * normal + rng.uniform(0, 0.5) * random_unit(rng)
        ball_velocity = paddle_velocity + direction / np.linalg.norm(direction) * rng.uniform(2, 12)
        centre = np.array([-1.6, 0.3, 1.5])
        aim = np.cross(normal, random_unit(rng)) * rng.uniform(0, 0.9 * BLADE_RADIUS)
        ball = ball_state(centre + aim + face * (HALF_THICKNESS + RADIUS) * normal, ball_velocity)
        ball[6:] = rng.normal(0, 100, 3)
        begin = -lead - rng.uniform(0, period)
        fly(ball, begin, CONSTANTS)
        after = turned_paddle(centre, normal, paddle_velocity, turn, begin)
        if blade_clearance(ball, after) < 0:
            continue
        meetings += 1
        referee, touched, index = new_referees(1), 0, 0
        while not touched and begin + index * period < lead:
            before = after
            after = turned_paddle(centre, normal, paddle_velocity, turn, begin + (index + 1) * period)
            touched = step_ball(ball, referee, before, after, 0.0, period, CONSTANTS)
            assert blade_clearance(ball, after) > -1e-5
            index += 1
        assert touched == PADDLE
    assert meetings > 800


@pytest.mark.parametrize("period", [0.001, 0.005])
def test_no_ball_tunnels_through_table_or_net(period: float) -> None:
    rng = np.random.default_rng(8)
    touches = 0
    for _ in range(1000):
        target = np.array([0.0, rng.uniform(-0.8, 0.8), rng.uniform(0.77, 0.91)])
        if rng.random() < 0.5:
            target = np.array([rng.uniform(-1.36, 1.36), rng.uniform(-0.75, 0.75), 0.76])
        velocity = random_unit(rng) * rng.uniform(1.0, 12.0)
        velocity[2] = -abs(velocity[2])
        ball = ball_state(target - velocity * 0.06, velocity, rng.normal(0, 100, 3))
        if min(fixed_gap(surface, *xyz(ball[:3]), CONSTANTS[0])[0] for surface in (TABLE, NET)) < 0:
            continue
        referee = new_referees(1)
        touched = 0
        for index in range(round(0.12 / period)):
            touched |= step_ball(ball, referee, NO_PADDLE, NO_PADDLE, index * period, period, CONSTANTS)
            for surface in (TABLE, NET):
                assert fixed_gap(surface, *xyz(ball[:3]), CONSTANTS[0])[0] > -2e-5
        touches += bool(touched & (TABLE | TABLE_SIDE | NET))
    assert touches > 850


def test_a_ball_past_the_rim_is_a_miss_and_a_rim_touch_a_hit() -> None:
    normal, centre = np.array([1.0, 0.0, 0.0]), np.array([-1.6, 0.0, 1.1])
    paddle = paddle_at(centre, normal)
    for offset, hit in (
        (0.0, True),
        (BLADE_RADIUS + 0.3 * RADIUS, True),
        (BLADE_RADIUS + 1.05 * RADIUS, False),
    ):
        ball = ball_state(centre + np.array([0.1, offset, 0.01]), (-6.0, 0.0, 0.0))
        referee = new_referees(1)
        referee["own_bounces"] = 1
        for index in range(40):
            step_ball(ball, referee, paddle, paddle, index * 0.001, 0.001, CONSTANTS)
        assert referee[0]["hits"] == int(hit)
        assert (ball[0] < -1.7) == (not hit)


def test_a_ball_behind_the_paddle_is_hit_on_the_other_face_only_if_caught_up() -> None:
    """A paddle that swings away from a ball that has passed it leaves the ball alone."""
    normal, centre = np.array([1.0, 0.0, 0.0]), np.array([-1.6, 0.0, 1.1])
    for speed, hit in ((2.0, False), (-5.0, True)):
        velocity = np.array([speed, 0.0, 0.0])
        ball = ball_state(centre - np.array([0.04, 0.0, 0.0]), (-2.0, 0.0, 0.0))
        referee = new_referees(1)
        for index in range(30):
            before = paddle_at(centre + velocity * index * 0.001, normal, velocity)
            after = paddle_at(centre + velocity * (index + 1) * 0.001, normal, velocity)
            step_ball(ball, referee, before, after, index * 0.001, 0.001, CONSTANTS)
        assert bool(referee[0]["hits"]) == hit
        if hit:
            assert ball[3] < -5.0


def test_the_net_takes_the_speed_away() -> None:
    ball, referee = ball_state((-0.1, 0.0, 0.84), (5.0, 0.3, 0.0)), new_referees(1)
    touched = 0
    for index in range(40):
        touched |= step_ball(ball, referee, NO_PADDLE, NO_PADDLE, index * 0.001, 0.001, CONSTANTS)
    assert touched == NET
    assert -0.26 < ball[3] < -0.2
    assert ball[4] == pytest.approx(0.3, abs=0.02)
    assert ball[0] < -RADIUS


def test_the_tables_edge_is_a_bounce_and_its_side_is_not() -> None:
    for height, surface in ((0.765, TABLE), (0.745, TABLE_SIDE)):
        ball, referee = ball_state((1.5, 0.0, height), (-4.0, 0.0, 0.0)), new_referees(1)
        touched = 0
        for index in range(35):
            touched |= step_ball(ball, referee, NO_PADDLE, NO_PADDLE, index * 0.001, 0.001, CONSTANTS)
        assert touched == surface
        assert ball[3] > 0.0

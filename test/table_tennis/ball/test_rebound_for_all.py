"""A rebound never adds energy, for all balls, surfaces and coefficients; seen from the surface itself."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st

from msrd_ros.table_tennis.ball.flight import ball_state
from msrd_ros.table_tennis.ball.rebound import rebound_rigid, rebound_rubber
from msrd_ros.table_tennis.ball.scene import Scene

SCENE = Scene()
CONSTANTS = SCENE.constants()

Vector = tuple[float, float, float]


def vectors(most: float) -> st.SearchStrategy[Vector]:
    part = st.floats(-most, most)
    return st.tuples(part, part, part)


def unit(vector: Vector) -> Vector:
    length = math.hypot(*vector)
    assume(length > 1e-3)
    x, y, z = vector
    return x / length, y / length, z / length


def energy(ball: np.ndarray, surface: Vector) -> float:
    """Of motion and spin, in J, in the frame that moves with the surface."""
    velocity = ball[3:6] - np.array(surface)
    return float(
        0.5 * SCENE.ball.mass_kg * velocity @ velocity
        + 0.5 * SCENE.ball.inertia_kg_m2 * ball[6:9] @ ball[6:9]
    )


@given(vectors(1.0), vectors(30.0), vectors(1000.0), st.floats(0.0, 1.0), st.floats(0.0, 2.0))
def test_off_a_rigid_surface(
    normal: Vector, velocity: Vector, spin: Vector, restitution: float, friction: float
) -> None:
    ball = ball_state((0.0, 0.0, 1.0), velocity, spin)
    before = energy(ball, (0.0, 0.0, 0.0))
    rebound_rigid(ball, *unit(normal), restitution, friction, CONSTANTS[0])
    assert energy(ball, (0.0, 0.0, 0.0)) <= before * (1.0 + 1e-9) + 1e-12


@given(vectors(1.0), vectors(30.0), vectors(1000.0), vectors(20.0))
def test_off_moving_rubber(normal: Vector, velocity: Vector, spin: Vector, surface: Vector) -> None:
    ball = ball_state((0.0, 0.0, 1.0), velocity, spin)
    before = energy(ball, surface)
    rebound_rubber(ball, *unit(normal), *surface, CONSTANTS[0])
    assert energy(ball, surface) <= before * (1.0 + 1e-9) + 1e-12

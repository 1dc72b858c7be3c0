"""A stroke as a motion of the joints: swing to the hit, follow through, rest.

All parts are polynomials of the fifth degree. The swing meets a wanted position and velocity at the hit
without acceleration, so that a mistimed hit still finds the wanted velocity; the follow-through brakes all
joints to rest, where they come to or where it is said. Another stroke may lead up to the swing.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from msrd_ros.core.compiled import njit
from msrd_ros.robots.arm_model import Arm
from msrd_ros.robots.robot import JointLimits, Robot

Array = NDArray[np.float64]


class JointState(NamedTuple):
    """Joint angles (N,) in rad, their rates in rad/s and accelerations in rad/s^2."""

    position: Array
    velocity: Array
    acceleration: Array


@njit(cache=True, nogil=True)
def swing_state(
    position: Array,
    velocity: Array,
    acceleration: Array,
    hit_position: Array,
    hit_velocity: Array,
    duration: float,
    phase: float,
) -> tuple[Array, Array, Array]:
    """State on the way to the hit, where the acceleration vanishes.

    Parameters
    ----------
    position, velocity, acceleration
        State of the joints at the start, shape (N,); rad, rad/s, rad/s^2.
    hit_position, hit_velocity
        State at the hit, shape (N,).
    duration
        From start to hit, s, positive.
    phase
        0 at the start, 1 at the hit.
    """
    s, t = phase, duration
    # Polynomial in s on top of the start's own parabola; c, d, e follow from the three end conditions.
    gap = hit_position - position - t * velocity - 0.5 * t * t * acceleration
    rate = (hit_velocity - velocity - t * acceleration) * t
    curve = -acceleration * t * t
    c = 10.0 * gap - 4.0 * rate + 0.5 * curve
    d = -15.0 * gap + 7.0 * rate - curve
    e = 6.0 * gap - 3.0 * rate + 0.5 * curve
    there = position + s * t * velocity + 0.5 * (s * t) ** 2 * acceleration + s**3 * (c + s * (d + s * e))
    speed = velocity + s * t * acceleration + s * s * (3.0 * c + s * (4.0 * d + s * 5.0 * e)) / t
    change = acceleration + s * (6.0 * c + s * (12.0 * d + s * 20.0 * e)) / (t * t)
    return there, speed, change


@njit(cache=True, nogil=True)
def follow_state(
    hit_position: Array, hit_velocity: Array, duration: float, phase: float
) -> tuple[Array, Array, Array]:
    """State after the hit, braking smoothly to rest within `duration` s; `phase` is 1 at rest."""
    s = phase
    there = hit_position + hit_velocity * (duration * (s - s**3 + 0.5 * s**4))
    speed = hit_velocity * (1.0 - 3.0 * s * s + 2.0 * s**3)
    change = hit_velocity * (6.0 * (s * s - s) / duration)
    return there, speed, change


@dataclass(frozen=True)
class JointStroke:
    """One stroke of the arm. Times in s since the launch of the ball.

    Attributes
    ----------
    start_time_s
        Before it the joints rest (or are handed over) at the start state.
    start
        State of the joints there.
    hit_time_s
        When the ball is met.
    hit_position, hit_velocity
        State of the joints at the hit, shape (N,), rad and rad/s.
    follow_s
        How long the follow-through takes to come to rest.
    end_position
        Where it comes to rest, shape (N,), rad; where smooth braking leads to if None.
    lead_in
        What leads up to the start state, and is at rest there by then.
    """

    start_time_s: float
    start: JointState
    hit_time_s: float
    hit_position: Array
    hit_velocity: Array
    follow_s: float
    end_position: Array | None = None
    lead_in: JointStroke | None = None

    @property
    def first_time_s(self) -> float:
        """Before it the joints rest (or are handed over)."""
        return self.start_time_s if self.lead_in is None else self.lead_in.first_time_s

    @property
    def end_time_s(self) -> float:
        """From when on the joints rest."""
        return self.hit_time_s + self.follow_s

    def at(self, time_s: float) -> JointState:
        """State of the joints at one time."""
        if time_s <= self.start_time_s:
            return self.start if self.lead_in is None else self.lead_in.at(time_s)
        if time_s <= self.hit_time_s:
            duration = self.hit_time_s - self.start_time_s
            phase = (time_s - self.start_time_s) / duration
            return JointState(
                *swing_state(*self.start, self.hit_position, self.hit_velocity, duration, phase)
            )
        phase = min((time_s - self.hit_time_s) / self.follow_s, 1.0)
        if self.end_position is None:
            return JointState(*follow_state(self.hit_position, self.hit_velocity, self.follow_s, phase))
        still = np.zeros_like(self.hit_velocity)
        hit = (self.hit_position, self.hit_velocity, still)
        return JointState(*swing_state(*hit, self.end_position, still, self.follow_s, phase))

    def sample(self, times_s: Array) -> JointState:
        """States at many times (T,): arrays of shape (T, N)."""
        states = [self.at(float(time)) for time in times_s]
        return JointState(
            np.array([state.position for state in states]),
            np.array([state.velocity for state in states]),
            np.array([state.acceleration for state in states]),
        )

    def continued_from(
        self, time_s: float, hit_time_s: float, hit_position: Array, hit_velocity: Array
    ) -> JointStroke:
        """The same stroke, led from its state at `time_s` to another hit; what leads up to it stays."""
        handed_over = time_s > self.start_time_s
        return replace(
            self,
            start_time_s=max(time_s, self.start_time_s),
            start=self.at(time_s) if handed_over else self.start,
            hit_time_s=hit_time_s,
            hit_position=hit_position,
            hit_velocity=hit_velocity,
            lead_in=None if handed_over else self.lead_in,
        )

    def peak_fractions(self, limits: JointLimits, period_s: float = 0.005) -> tuple[Array, Array]:
        """Largest |speed| and |acceleration| of each joint, (N,) each, as fractions of the limits."""
        states = self.sample(np.arange(self.first_time_s, self.end_time_s + period_s, period_s))
        speed = np.abs(states.velocity).max(axis=0) / limits.speed_rad_s
        return speed, np.abs(states.acceleration).max(axis=0) / limits.acceleration_rad_s2


def stroke_from_rest(
    ready_position: Array,
    hit_time_s: float,
    hit_position: Array,
    hit_velocity: Array,
    *,
    swing_s: float,
    follow_s: float,
) -> JointStroke:
    """A whole stroke: at rest in the ready pose (N,) until `swing_s` before the hit."""
    rest = JointState(
        np.array(ready_position, dtype=np.float64),
        np.zeros_like(ready_position),
        np.zeros_like(ready_position),
    )
    return JointStroke(hit_time_s - swing_s, rest, hit_time_s, hit_position, hit_velocity, follow_s)


def minimum_jerk_velocity(
    start: Array, hit_position: Array, end: Array, swing_s: float, follow_s: float
) -> Array:
    """Joint rates (N,) at the hit with which a stroke from rest to rest through it has the least jerk.

    Both parts being without acceleration at the hit, a part of `h` s over the way `D` costs
    (192 (h v)^2 - 720 h v D + 720 D^2) / h^5, after Flash and Hogan (1985); of both together v is the best.

    Parameters
    ----------
    start, hit_position, end
        Joint angles (N,) in rad.
    swing_s, follow_s
        From the start to the hit, and from there to the end, s.
    """
    pull = (hit_position - start) / swing_s**4 + (end - hit_position) / follow_s**4
    rate: Array = 1.875 * pull / (1.0 / swing_s**3 + 1.0 / follow_s**3)
    return rate


@njit(cache=True, nogil=True)
def _swing_effort(
    arm: Arm,
    position: Array,
    velocity: Array,
    acceleration: Array,
    hit_position: Array,
    hit_velocity: Array,
    duration: float,
) -> float:
    peak = 0.0
    for phase in range(1, 11):
        _, speed, change = swing_state(
            position, velocity, acceleration, hit_position, hit_velocity, duration, phase / 10.0
        )
        peak = max(peak, np.max(np.abs(speed) / arm[0].speed), np.max(np.abs(change) / arm[0].acceleration))
    return peak


def swing_effort(stroke: JointStroke, robot: Robot) -> float:
    """Largest share of its speed or acceleration limit that a joint takes on the way to the hit."""
    duration = stroke.hit_time_s - stroke.start_time_s
    return float(
        _swing_effort(robot.model, *stroke.start, stroke.hit_position, stroke.hit_velocity, duration)
    )

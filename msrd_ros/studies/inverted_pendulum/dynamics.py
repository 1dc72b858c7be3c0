"""The inverted pendulum's equations of motion, as MuJoCo integrates them, for many episodes at once.

The model is Gymnasium's ``inverted_pendulum.xml``: a cart on a rail of 2 m, a pole on a hinge, joint damping,
soft joint limits, fourth-order Runge-Kutta. MuJoCo's generic engine steps it at tens of thousands of steps a
second; these equations, compiled, at millions. `test_pendulum_dynamics.py` holds them to MuJoCo.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from msrd_ros.core.compiled import njit

TIME_STEP_S = 0.02
FRAME_SKIP = 2
CONTROL_PERIOD_S = TIME_STEP_S * FRAME_SKIP

_GRAVITY = 9.81
_GEAR_N = 100.0
CONTROL_LIMIT = 3.0
_SLIDE_LIMIT_M = 1.0
_HINGE_LIMIT_RAD = math.pi / 2.0
# MuJoCo's default solref (0.02, 1), raised to twice the time step ("refsafe"), and solimp.
_TIME_CONSTANT_S = 2.0 * TIME_STEP_S
_IMPEDANCE_MIN, _IMPEDANCE_MAX, _IMPEDANCE_WIDTH_M = 0.9, 0.95, 0.001


@dataclass(frozen=True)
class PendulumBody:
    """Masses and lengths of cart and pole.

    Attributes
    ----------
    cart_mass_kg, pole_mass_kg
        Masses.
    centre_distance_m, centre_angle_rad
        The pole's centre of mass, seen from the hinge: distance, and angle from the pole's axis.
    pole_inertia_kg_m2
        About the centre of mass, around the hinge's direction.
    slide_damping_n_s_m, hinge_damping_n_m_s
        Viscous friction of the two joints.
    """

    cart_mass_kg: float = 10.47197551196598
    pole_mass_kg: float = 5.018591641363306
    centre_distance_m: float = math.hypot(0.0005, 0.3)
    centre_angle_rad: float = math.atan2(0.0005, 0.3)
    pole_inertia_kg_m2: float = 0.1887497668730885
    slide_damping_n_s_m: float = 1.0
    hinge_damping_n_m_s: float = 1.0

    def changed(self, pole_length: float = 1.0, cart_friction: float = 1.0) -> PendulumBody:
        """The same pendulum with a longer pole (uniform scaling of its length) or a stickier cart.

        Parameters
        ----------
        pole_length
            Factor on the length at constant mass per length: mass grows with it, inertia with its cube.
        cart_friction
            Factor on the damping of the slide.
        """
        return PendulumBody(
            self.cart_mass_kg,
            self.pole_mass_kg * pole_length,
            self.centre_distance_m * pole_length,
            self.centre_angle_rad,
            self.pole_inertia_kg_m2 * pole_length**3,
            self.slide_damping_n_s_m * cart_friction,
            self.hinge_damping_n_m_s,
        )

    def inverse_weights(self) -> tuple[float, float]:
        """Diagonal of the inverse mass matrix of the upright pendulum (MuJoCo's ``dof_invweight0``)."""
        total = self.cart_mass_kg + self.pole_mass_kg
        coupling = self.pole_mass_kg * self.centre_distance_m * math.cos(self.centre_angle_rad)
        swing = self.pole_inertia_kg_m2 + self.pole_mass_kg * self.centre_distance_m**2
        determinant = total * swing - coupling**2
        return swing / determinant, total / determinant

    def as_array(self) -> NDArray[np.float64]:
        """Numbers for the compiled functions."""
        return np.array(
            [
                self.cart_mass_kg,
                self.pole_mass_kg,
                self.centre_distance_m,
                self.centre_angle_rad,
                self.pole_inertia_kg_m2,
                self.slide_damping_n_s_m,
                self.hinge_damping_n_m_s,
                *self.inverse_weights(),
            ]
        )


@njit(cache=True)
def _limit(position: float, velocity: float, limit: float, weight: float) -> tuple[float, float, float]:
    """MuJoCo's soft joint limit: direction (0 if not touched), wanted acceleration, 1 / regularisation."""
    if abs(position) <= limit:
        return 0.0, 0.0, 0.0
    direction = -1.0 if position > 0.0 else 1.0
    distance = limit - abs(position)
    depth = min(1.0, -distance / _IMPEDANCE_WIDTH_M)
    rise = 2.0 * depth * depth if depth <= 0.5 else 1.0 - 2.0 * (1.0 - depth) ** 2
    impedance = _IMPEDANCE_MIN + rise * (_IMPEDANCE_MAX - _IMPEDANCE_MIN)
    damping = 2.0 / (_IMPEDANCE_MAX * _TIME_CONSTANT_S)
    stiffness = 1.0 / (_IMPEDANCE_MAX * _TIME_CONSTANT_S) ** 2
    wanted = -damping * direction * velocity - stiffness * impedance * distance
    return direction, wanted, impedance / ((1.0 - impedance) * weight)


@njit(cache=True)
def acceleration(
    slide: float, hinge: float, speed: float, rate: float, force: float, body: NDArray[np.float64]
) -> tuple[float, float]:
    """Accelerations of cart (m/s^2) and pole (rad/s^2).

    Gauss's principle with soft limits: the accelerations minimise ``|a - a_free|_M^2`` plus, for each touched
    limit that would be violated, ``(J a - wanted)^2 / R``; at most two limits, so a few Newton
    steps are exact.
    """
    angle = hinge + body[3]
    moment = body[1] * body[2]
    m00, m01 = body[0] + body[1], moment * math.cos(angle)
    m11 = body[4] + moment * body[2]
    f0 = force + moment * math.sin(angle) * rate * rate - body[5] * speed
    f1 = moment * _GRAVITY * math.sin(angle) - body[6] * rate
    determinant = m00 * m11 - m01 * m01
    a0, a1 = (m11 * f0 - m01 * f1) / determinant, (m00 * f1 - m01 * f0) / determinant
    d0, w0, k0 = _limit(slide, speed, _SLIDE_LIMIT_M, body[7])
    d1, w1, k1 = _limit(hinge, rate, _HINGE_LIMIT_RAD, body[8])
    if d0 == 0.0 and d1 == 0.0:
        return a0, a1
    was0, was1 = False, False
    for _ in range(6):
        on0, on1 = d0 != 0.0 and d0 * a0 < w0, d1 != 0.0 and d1 * a1 < w1
        if on0 == was0 and on1 == was1:
            break
        h00, h11, g0, g1 = m00, m11, f0, f1
        if on0:
            h00, g0 = h00 + k0, g0 + k0 * d0 * w0
        if on1:
            h11, g1 = h11 + k1, g1 + k1 * d1 * w1
        determinant = h00 * h11 - m01 * m01
        a0, a1 = (h11 * g0 - m01 * g1) / determinant, (h00 * g1 - m01 * g0) / determinant
        was0, was1 = on0, on1
    return a0, a1


@njit(cache=True, nogil=True)
def advance(states: NDArray[np.float64], controls: NDArray[np.float64], body: NDArray[np.float64]) -> None:
    """One control period for every episode, in place.

    Parameters
    ----------
    states
        ``[N, 4]``: cart position (m), pole angle (rad, positive leans to +x), and their rates.
    controls
        ``[N]``, clipped to [-3, 3], times 100 N.
    body
        `PendulumBody.as_array`.
    """
    h = TIME_STEP_S
    for episode in range(states.shape[0]):
        x, q = states[episode, 0], states[episode, 1]
        v, w = states[episode, 2], states[episode, 3]
        force = _GEAR_N * min(max(controls[episode], -CONTROL_LIMIT), CONTROL_LIMIT)
        for _ in range(FRAME_SKIP):
            a1, b1 = acceleration(x, q, v, w, force, body)
            v2, w2 = v + 0.5 * h * a1, w + 0.5 * h * b1
            a2, b2 = acceleration(x + 0.5 * h * v, q + 0.5 * h * w, v2, w2, force, body)
            v3, w3 = v + 0.5 * h * a2, w + 0.5 * h * b2
            a3, b3 = acceleration(x + 0.5 * h * v2, q + 0.5 * h * w2, v3, w3, force, body)
            v4, w4 = v + h * a3, w + h * b3
            a4, b4 = acceleration(x + h * v3, q + h * w3, v4, w4, force, body)
            x += h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4)
            q += h / 6.0 * (w + 2.0 * w2 + 2.0 * w3 + w4)
            v += h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
            w += h / 6.0 * (b1 + 2.0 * b2 + 2.0 * b3 + b4)
        states[episode, 0], states[episode, 1] = x, q
        states[episode, 2], states[episode, 3] = v, w

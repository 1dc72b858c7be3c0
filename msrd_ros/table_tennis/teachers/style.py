"""What makes synthetic teachers different from each other, and one stroke different from the next."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from msrd_ros.core.errors import UserError
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS, PaperLabel

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PopulationConfig:
    """How much teachers differ. Standard deviations, unless said otherwise.

    Attributes
    ----------
    hit_time_s
        Of when a teacher likes to meet the ball.
    timing_s
        Of a teacher's usual lateness (negative: too early).
    landing_x_m, landing_y_m
        Of the place a teacher aims at.
    spin_fraction, push_spin_rad_s
        Of the spin a teacher puts into slice and topspin, and into the push.
    swing_shortest, swing_longest
        Uniform range of the duration of the swing, as a factor; a long swing starts with a backswing.
    ready_rad
        Of each joint in a teacher's own ready pose.
    skill_least
        Uniform range, up to 1, of the share of the arm's resistance that a teacher's hand makes up for.
    slip_least, slip_most
        Uniform range of the probability that a stroke goes wrong.
    start_rad
        Of each joint's start posture from stroke to stroke.
    stroke_timing_s
        Of the moment of the hit, from stroke to stroke.
    stroke_aim_rad
        Of the blade's direction about each axis, from stroke to stroke.
    stroke_place_m
        Of the blade's place along each axis, from stroke to stroke.
    stroke_speed
        Of the speed at the hit, from stroke to stroke, as a fraction.
    tremor_m, tremor_rad
        Of the hand's slow unsteadiness.
    """

    hit_time_s: float = 0.010
    timing_s: float = 0.004
    landing_x_m: float = 0.08
    landing_y_m: float = 0.12
    spin_fraction: float = 0.03
    push_spin_rad_s: float = 3.0
    swing_shortest: float = 0.95
    swing_longest: float = 1.12
    ready_rad: float = 0.03
    skill_least: float = 0.8
    slip_least: float = 0.12
    slip_most: float = 0.4
    start_rad: float = 0.03
    stroke_timing_s: float = 0.006
    stroke_aim_rad: float = 0.03
    stroke_place_m: float = 0.006
    stroke_speed: float = 0.02
    tremor_m: float = 0.002
    tremor_rad: float = 0.01

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not np.isfinite(value) or value < 0.0:
                raise UserError(f"population: {name} is {value}; give a finite number that is not negative")


@dataclass(frozen=True)
class Style:
    """One teacher's own ways; see `PopulationConfig`. Per label where the strokes may differ."""

    hit_time_s: dict[PaperLabel, float]
    timing_s: float
    landing_m: dict[PaperLabel, tuple[float, float]]
    spin_fraction: float
    push_spin_rad_s: float
    swing: float
    ready_rad: dict[PaperLabel, Array]
    skill: float
    slip: float

    @classmethod
    def draw(cls, config: PopulationConfig, joints: int, rng: np.random.Generator) -> Style:
        """A teacher from the population."""

        def normal(sd: float) -> float:
            return float(sd * np.clip(rng.standard_normal(), -2.0, 2.0))

        return cls(
            hit_time_s={label: normal(config.hit_time_s) for label in ALL_LABELS},
            timing_s=normal(config.timing_s),
            landing_m={
                label: (normal(config.landing_x_m), normal(config.landing_y_m)) for label in ALL_LABELS
            },
            spin_fraction=normal(config.spin_fraction),
            push_spin_rad_s=normal(config.push_spin_rad_s),
            swing=float(rng.uniform(config.swing_shortest, config.swing_longest)),
            ready_rad={
                label: config.ready_rad * np.clip(rng.standard_normal(joints), -2.0, 2.0)
                for label in ALL_LABELS
            },
            skill=float(rng.uniform(config.skill_least, 1.0)),
            slip=float(rng.uniform(config.slip_least, config.slip_most)),
        )


class Slip(StrEnum):
    """How a stroke goes wrong."""

    NONE = "none"
    MISTIMED = "mistimed"
    MISAIMED = "misaimed"
    MISPLACED = "misplaced"
    INATTENTIVE = "inattentive"
    """The ball is not watched: the stroke is played as if it came as always."""


_MISTIMED_S = (0.06, 0.12)
_MISAIMED_RAD = (0.35, 0.6)
_MISPLACED_M = (0.08, 0.14)
_TREMOR_HZ = (0.8, 2.5)
_TREMOR_WAVES = 3


@dataclass(frozen=True)
class Flaws:
    """What is wrong with one stroke.

    Attributes
    ----------
    slip
        What went wrong outright, if anything.
    delay_s
        How late the motion is.
    shift
        Displacement of the blade at the hit, m over rad, shape (6,).
    speed
        Factor on the joint rates at the hit.
    tremor_size, tremor_rate, tremor_phase
        Waves of the hand's unsteadiness: shape (3, 6) in m and rad, (3, 1) in rad/s, (3, 6) in rad.
    """

    slip: Slip
    delay_s: float
    shift: Array
    speed: float
    tremor_size: Array
    tremor_rate: Array
    tremor_phase: Array

    @classmethod
    def none(cls) -> Flaws:
        """Nothing wrong at all."""
        still, turn = np.zeros((1, 6)), np.zeros((1, 1))
        return cls(Slip.NONE, 0.0, np.zeros(6), 1.0, still, turn, still)

    @classmethod
    def draw(cls, style: Style, config: PopulationConfig, rng: np.random.Generator) -> Flaws:
        """The flaws of a teacher's next stroke."""
        slips = [slip for slip in Slip if slip is not Slip.NONE]
        slipped, which = rng.random() < style.slip, slips[rng.integers(len(slips))]
        slip = which if slipped else Slip.NONE
        delay = style.timing_s + config.stroke_timing_s * rng.standard_normal()
        shift = np.concatenate(
            [
                config.stroke_place_m * rng.standard_normal(3),
                config.stroke_aim_rad * rng.standard_normal(3),
            ]
        )
        speed = 1.0 + config.stroke_speed * float(np.clip(rng.standard_normal(), -2.0, 2.0))
        late = rng.uniform(*_MISTIMED_S) * rng.choice([-1.0, 1.0])
        turn = _direction(rng) * rng.uniform(*_MISAIMED_RAD)
        away = _direction(rng) * rng.uniform(*_MISPLACED_M)
        if slip is Slip.MISTIMED:
            delay += late
        elif slip is Slip.MISAIMED:
            shift[3:] += turn
        elif slip is Slip.MISPLACED:
            shift[:3] += away
        scale = np.repeat([config.tremor_m, config.tremor_rad], 3) * np.sqrt(2.0 / _TREMOR_WAVES)
        return cls(
            slip=slip,
            delay_s=float(delay),
            shift=shift,
            speed=speed,
            tremor_size=scale * rng.standard_normal((_TREMOR_WAVES, 6)) / np.sqrt(2.0),
            tremor_rate=2.0 * np.pi * rng.uniform(*_TREMOR_HZ, size=(_TREMOR_WAVES, 1)),
            tremor_phase=rng.uniform(0.0, 2.0 * np.pi, size=(_TREMOR_WAVES, 6)),
        )

    def tremor(self, time_s: float) -> tuple[Array, Array]:
        """Displacement of the hand (m over rad) and its rate, shape (6,) each."""
        angle = self.tremor_rate * time_s + self.tremor_phase
        waves = self.tremor_size * np.sin(angle)
        return waves.sum(axis=0), (self.tremor_size * self.tremor_rate * np.cos(angle)).sum(axis=0)


def _direction(rng: np.random.Generator) -> Array:
    vector = rng.standard_normal(3)
    return vector / np.linalg.norm(vector)

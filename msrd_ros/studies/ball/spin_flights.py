"""Flights with measured spin: their frames, how they bounce, and how well their second half is foretold."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import OptimizeResult, least_squares
from scipy.spatial.transform import Rotation

from msrd_ros.studies.ball.law import BallLaw
from msrd_ros.studies.ball.recordings import SpinFlight
from msrd_ros.table_tennis.ball.estimator import fit_flight
from msrd_ros.table_tennis.ball.flight import BALL_SIZE, fly
from msrd_ros.table_tennis.ball.scene import Air, Ball, Scene
from msrd_ros.table_tennis.ball.trajectory import ball_path

Array = NDArray[np.float64]

# A turn: the slopes of straight lines through so many samples before and after differ by so much.
_TURN_SAMPLES = 6
_TURN_M_S = 1.5
_BESIDE_TURN = 2
"""Samples left out on either side of a turn."""
_FEWEST_SAMPLES = 12
_NEAR_TABLE_M = 0.08
_SIDE_S = 0.16
_TURN_GAP_S = 0.01
"""What is looked at before and after a bounce, but for this beside it."""
_HIGH_M = 10.0
"""Where a flight touches nothing."""
_GRAVITY_M_S2 = Scene().gravity_m_s2
_POSITION_M = 0.003
_FASTEST_SPIN_RAD_S = 800.0
"""Nobody's ball spins faster (Ace's fastest: 450 rad/s); measured spins beyond it are not used."""

# Fitting the first half of a flight.
_SAMPLE_SD_M = 0.005
_SPIN_SD_RAD_S = 50.0
_UNKNOWN_SPIN_SD_RAD_S = 200.0
_STEPS = 12
_PERIOD_S = 0.002
_FEWEST_IN_HALF = 10


class Frames(NamedTuple):
    """How the flights' frames lie.

    Attributes
    ----------
    gravity_m_s2
        In the frame of the positions, shape (3,).
    drag_coefficient
        That goes with it.
    spin_to_position
        Rotation vector in rad, shape (3,), from the frame of the spins to that of the positions.
    unexplained
        Share of the misfit that is left of what drag and gravity alone leave.
    segments
        How many pieces of flight it was found from.
    """

    gravity_m_s2: Array
    drag_coefficient: float
    spin_to_position: Array
    unexplained: float
    segments: int


class Bounces(NamedTuple):
    """Bounces seen from both sides: restitution and height of the ball's centre (m), shape (B,) each."""

    restitution: Array
    height_m: Array


class Pieces(NamedTuple):
    """Smooth pieces of flights at their middle: velocity, acceleration, its error, spin; rows of (P, ...)."""

    velocity: Array
    acceleration: Array
    error: Array
    spin: Array


def turns(flight: SpinFlight) -> list[int]:
    """Samples at which a ball turns at once: bounces, hits."""
    times, count = flight.times_s, _TURN_SAMPLES
    sharpness = np.zeros(len(times))
    for row in range(count, len(times) - count):
        before = np.polyfit(times[row - count : row + 1], flight.positions[row - count : row + 1], 1)[0]
        after = np.polyfit(times[row : row + count + 1], flight.positions[row : row + count + 1], 1)[0]
        sharpness[row] = np.linalg.norm(after - before)
    found = []
    while (row := int(sharpness.argmax())) and sharpness[row] > _TURN_M_S:
        found.append(row)
        sharpness[max(0, row - count) : row + count + 1] = 0.0
    return sorted(found)


def bounces(flights: list[SpinFlight], law: BallLaw) -> Bounces:
    """Restitution from flights fitted to what was seen before and after, up to where they meet.

    Both flights are fitted by the law's drag, with a spin that is as good as free.
    """
    found = []
    for flight in flights:
        times, height = flight.times_s, flight.positions[:, 2]
        for row in turns(flight):
            at = times[row]
            before = (times < at - _TURN_GAP_S) & (times > at - _SIDE_S)
            after = (times > at + _TURN_GAP_S) & (times < at + _SIDE_S)
            if abs(height[row]) > _NEAR_TABLE_M or min(before.sum(), after.sum()) < _FEWEST_SAMPLES:
                continue
            down = _ball_at(at, times[before], flight.positions[before], law)
            up = _ball_at(at, times[after], flight.positions[after], law)
            # Close to the turn both fall alike, so that their distance changes at a constant rate.
            meeting = (down[2] - up[2]) / (up[5] - down[5])
            if abs(meeting) < _TURN_GAP_S:
                fall, rise = (ball[5] - _GRAVITY_M_S2 * meeting for ball in (down, up))
                found.append((-rise / fall, down[2] + meeting * down[5]))
    return Bounces(*np.array(found).reshape(-1, 2).T)


def _ball_at(time_s: float, times: Array, positions: Array, law: BallLaw) -> Array:
    """State (9,) at a time of the free flight that fits samples around or beside it."""
    scene = law.constants()
    high = positions + np.array([0.0, 0.0, _HIGH_M])
    slope, offset = np.polyfit(times - times[0], high, 1)
    weights = np.concatenate([np.zeros(6), np.full(3, 1.0 / _UNKNOWN_SPIN_SD_RAD_S)])
    ball, _ = fit_flight(
        np.concatenate([offset, slope, np.zeros(3)]),
        times - times[0],
        high,
        np.zeros(BALL_SIZE),
        weights,
        _POSITION_M,
        _STEPS,
        scene,
    )
    fly(ball, time_s - times[0], scene)
    ball[2] -= _HIGH_M
    return ball


def frames(flights: list[SpinFlight], law: BallLaw) -> Frames:
    """Gravity, and the rotation of the spins that best explains how the flights curve.

    The lift is the law's; gravity, drag and rotation are free.
    """
    pieces = _first_pieces(flights)
    force = Scene(air=Air(drag_coefficient=1.0)).constants()["drag"][0]
    radius = Ball().radius_m
    speed = np.linalg.norm(pieces.velocity, axis=1, keepdims=True)
    ratio = radius * np.linalg.norm(pieces.spin, axis=1, keepdims=True) / speed
    magnus = force * radius * law.lift_slope / (1.0 + law.lift_saturation * ratio)

    def misfit(unknowns: Array, lift: float) -> Array:
        spin = Rotation.from_rotvec(unknowns[:3]).apply(pieces.spin)
        expected = unknowns[4:7] - unknowns[3] * force * speed * pieces.velocity
        expected = expected + lift * magnus * np.cross(spin, pieces.velocity)
        return np.asarray(((pieces.acceleration - expected) / pieces.error).ravel())

    def fit(turn: Array, lift: float) -> OptimizeResult:
        start = np.concatenate([turn, [0.5, 0.0, 0.0, -9.81]])
        return least_squares(misfit, start, loss="soft_l1", args=(lift,))

    starts = Rotation.create_group("O").as_rotvec()
    best = min((fit(turn, 1.0) for turn in starts), key=lambda found: float(found.cost))
    without = fit(np.zeros(3), 0.0)
    rotation = Rotation.from_rotvec(best.x[:3]).as_rotvec()
    return Frames(best.x[4:7], float(best.x[3]), rotation, float(best.cost / without.cost), len(speed))


def end_errors(flights: list[SpinFlight], law: BallLaw, spin_to_position: Array, table_m: float) -> Array:
    """Distance in m of prediction and last sample of each flight, shape (F,); NaN where half has too few.

    A flight ends where the ball touches anything but the table, at the latest with the recording. A state is
    fitted to its first half, with the measured spin as what is expected.

    Parameters
    ----------
    flights
        As recorded.
    law
        How balls fly and bounce.
    spin_to_position
        As in `Frames`.
    table_m
        Height of the ball's centre on the table in the flights' frame.
    """
    scene = law.constants()
    constants = scene[0]
    lift = constants["table_top"] + constants["ball_radius"] - table_m
    rotation = Rotation.from_rotvec(spin_to_position)
    return np.array([_end_error(flight, rotation, float(lift), scene) for flight in flights])


def _end_error(flight: SpinFlight, rotation: Rotation, lift: float, scene: NDArray[np.void]) -> float:
    height = flight.positions[:, 2]
    hits = [row for row in turns(flight) if abs(height[row]) > _NEAR_TABLE_M]
    last = hits[0] - _BESIDE_TURN if hits else len(height) - 1
    times = flight.times_s[: last + 1] - flight.times_s[0]
    # The table's length lies along y there, and along x here.
    positions = np.stack([flight.positions[:, 1], -flight.positions[:, 0], height + lift], axis=1)[: last + 1]
    half = int(np.searchsorted(times, times[-1] / 2.0))
    if half < _FEWEST_IN_HALF:
        return np.nan
    spin, sd = rotation.apply(flight.spin), _SPIN_SD_RAD_S
    if np.linalg.norm(spin) > _FASTEST_SPIN_RAD_S:
        spin, sd = np.zeros(3), _UNKNOWN_SPIN_SD_RAD_S
    expected, weights = np.zeros(BALL_SIZE), np.zeros(BALL_SIZE)
    expected[6:] = spin[1], -spin[0], spin[2]
    weights[6:] = 1.0 / sd
    slope, offset = np.polyfit(times[: _TURN_SAMPLES + 1], positions[: _TURN_SAMPLES + 1], 1)
    start = np.concatenate([offset, slope, expected[6:]])
    launch, _ = fit_flight(
        start, times[:half], positions[:half], expected, weights, _SAMPLE_SD_M, _STEPS, scene
    )
    path = ball_path(launch, _PERIOD_S, int(times[-1] / _PERIOD_S) + 2, scene)
    end = [np.interp(times[-1], _PERIOD_S * np.arange(len(path)), path[:, axis]) for axis in range(3)]
    return float(np.linalg.norm(end - positions[-1]))


def _first_pieces(flights: list[SpinFlight]) -> Pieces:
    """From the launch, where the spin was measured, to the first turn."""
    rows = []
    for flight in flights:
        ends = turns(flight)
        last = ends[0] - _BESIDE_TURN if ends else len(flight.times_s)
        if last < _FEWEST_SAMPLES or np.linalg.norm(flight.spin) > _FASTEST_SPIN_RAD_S:
            continue
        times = flight.times_s[:last] - flight.times_s[:last].mean()
        degree = 3 if np.ptp(times) > 0.25 else 2
        if np.ptp(times) < 0.12:
            continue
        fit = np.polyfit(times, flight.positions[:last], degree)
        powers = np.vander(times, degree + 1)
        if np.std(flight.positions[:last] - powers @ fit) > 2.0 * _POSITION_M:
            continue
        error = 2.0 * _POSITION_M * np.sqrt(np.linalg.inv(powers.T @ powers)[-3, -3])
        rows.append((fit[-2], 2.0 * fit[-3], np.full(3, max(float(error), 0.3)), flight.spin))
    return Pieces(*(np.array([row[part] for row in rows]) for part in range(4)))

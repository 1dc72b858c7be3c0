"""Rollouts that are played again, a little differently each time, until their balls land where they shall.

Iterative learning control: the same feed comes again, and what the policy did is done again with smooth
offsets; were the policy asked again, one that holds on to its path would undo them. How the landing answers
them is fitted to random offsets at first, and for each rollout corrected by what its own repetitions show
(Broyden's rank-one update). Of all offsets that would do, the smallest are taken, and the spin is kept, so
that the stroke stays what it was; and the ball is met with the middle of the blade, so that small errors do
not make it miss.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from msrd_ros.contract.episode import CONTROL_PERIOD_S, FIRST_ACTING_STEP
from msrd_ros.robots.kinematics import paddle_pose
from msrd_ros.robots.robot import Robot
from msrd_ros.table_tennis.ball.flight import POSITION, VELOCITY
from msrd_ros.table_tennis.simulation.batched import KinematicRallies
from msrd_ros.table_tennis.strokes.batched_play import BatchPolicy

Array = NDArray[np.float64]

_SPIN_M_S = 0.002
"""What a rad/s of spin about y counts as in metres of landing: 50 rad/s off are as bad as 10 cm."""
MOST_SPIN_RAD_S = 30.0
"""By which a rollout's spin may be another than it was, for the stroke to count as the same."""
_BLADE_WEIGHT = 2.0
"""What a metre beside the middle of the blade counts as in metres of landing."""
_STIFFNESS_M2 = 1e-3
"""Damping of the step: offsets are dear where the landing hardly answers them."""


@dataclass(frozen=True)
class CorrectionConfig:
    """Settings of the repetitions.

    Attributes
    ----------
    repetitions
        How often each rollout is played again.
    longest_step_m
        By which the landing is to move from one repetition to the next, at most.
    first_offset
        Standard deviation of the random offsets that the first answer is fitted to, as a fraction of full
        speed.
    before_hit_steps
        Centres of the bumps that offsets are made of, in control steps before the mean hit.
    width_steps
        Standard deviation of a bump.
    broyden_rate
        Share of a repetition's surprise that goes into its rollout's own answer.
    """

    repetitions: int = 10
    longest_step_m: float = 0.25
    first_offset: float = 0.04
    before_hit_steps: tuple[int, ...] = (25, 19, 13, 7, 1)
    width_steps: float = 5.0
    broyden_rate: float = 0.7


class Feeds(NamedTuple):
    """What is played again and again: launches (S, K, 9) and start postures (S, K, N)."""

    balls: Array
    ready: Array


class Landed(NamedTuple):
    """What became of rollouts.

    `returned` and `hit_step` are (S, K); `answer` (S, K, 5) has the landing point in m, and in its measure
    the spin about y and where on the blade the ball was met; NaN where nothing was returned.
    """

    returned: NDArray[np.bool_]
    answer: Array
    hit_step: Array

    @property
    def landing(self) -> Array:
        """Where balls landed, (S, K, 2), m."""
        return self.answer[..., :2]


class Rollout(NamedTuple):
    """What was seen and done: (S, K, T_act + 1, N + 6) and (S, K, T_act, N), speed fractions as they came."""

    observations: NDArray[np.float32]
    actions: NDArray[np.float32]


class Corrected(NamedTuple):
    """The nearest that each repeated rollout came to its target; whose spin is as it was `keeps_spin`."""

    landed: Landed
    rollout: Rollout
    keeps_spin: NDArray[np.bool_]


class RepeatedRallies:
    """The same rallies as often as one likes, with offsets added to what was done.

    Parameters
    ----------
    simulator
        Where they are played.
    feeds
        What is played.
    config
        Of the offsets.
    """

    def __init__(self, simulator: KinematicRallies, feeds: Feeds, config: CorrectionConfig) -> None:
        self._simulator, self.feeds, self._config = simulator, feeds, config
        self._bumps: Array = np.zeros(0)
        self._done: list[Array] = []

    @property
    def weights_shape(self) -> tuple[int, int, int]:
        """Shape of the offsets' weights, (S, K, B N) with B bumps."""
        strategies, count, joints = self.feeds.ready.shape
        return strategies, count, len(self._config.before_hit_steps) * joints

    def place_bumps(self, hit_step: Array) -> None:
        """Put the bumps where the strategies hit, (S, K) in control steps; NaN where nothing was hit."""
        mean = np.nanmean(hit_step, axis=1)
        centres = mean[:, None] - np.array(self._config.before_hit_steps, dtype=np.float64)
        steps = np.arange(self._simulator.acting_steps)[:, None, None]
        self._bumps = np.exp(-0.5 * ((steps - centres) / self._config.width_steps) ** 2)

    def play(self, policy: BatchPolicy) -> tuple[Landed, Rollout]:
        """Play them all for the first time."""
        self._done = []

        def act(seen: NDArray[Any]) -> Array:
            self._done.append(np.asarray(policy(seen), dtype=np.float64))
            return self._done[-1]

        return self._play(lambda _, seen: act(seen))

    def repeat(self, weights: Array) -> tuple[Landed, Rollout]:
        """Play them all again as at first, with offsets.

        Parameters
        ----------
        weights
            Of the offsets, see `weights_shape`.
        """
        shaped = weights.reshape(*weights.shape[:2], -1, self.feeds.ready.shape[2])
        return self._play(
            lambda step, _: self._done[step] + np.einsum("sb,skbn->skn", self._bumps[step], shaped)
        )

    def _play(self, act: Callable[[int, NDArray[Any]], Array]) -> tuple[Landed, Rollout]:
        simulator = self._simulator
        strategies, count, joints = self.feeds.ready.shape
        path: list[tuple[Array, Array, Array]] = []
        # Without noise of the camera nothing is drawn: what changes a landing is the offsets alone.
        seen = simulator.start(self.feeds.balls, self.feeds.ready, np.random.default_rng(0))
        steps, speed = simulator.acting_steps, simulator.config.robot.limits.speed_rad_s
        observations = np.empty((strategies, count, steps + 1, seen.shape[-1]), np.float32)
        actions = np.empty((strategies, count, steps, joints), np.float32)
        observations[:, :, 0] = seen
        for step in range(steps):
            action = act(step, seen)
            path.append((simulator.joint_position, simulator.joint_velocity, simulator.ball))
            seen = simulator.step(action)
            # What limits have made of the command is what is to be learned, as with demonstrations.
            actions[:, :, step] = simulator.joint_velocity / speed
            observations[:, :, step + 1] = seen
        results = simulator.results()
        hit_step = results.hit_time / CONTROL_PERIOD_S - FIRST_ACTING_STEP
        blade = _places_on_blade(simulator.config.robot, path, np.where(results.returned, hit_step, np.nan))
        spin = _SPIN_M_S * results.spin[..., 1:2]
        answer = np.concatenate([results.landing, spin, _BLADE_WEIGHT * blade], axis=-1)
        returned = results.returned & np.isfinite(answer).all(axis=-1)
        answer[~returned] = np.nan
        return Landed(returned, answer, hit_step), Rollout(observations, actions)


def fit_response(
    rallies: RepeatedRallies, policy: BatchPolicy, config: CorrectionConfig, rng: np.random.Generator
) -> Array:
    """How `Landed.answer` follows the offsets' weights, (S, 5, B N), by ridge regression on random ones."""
    plain, _ = rallies.play(policy)
    rallies.place_bumps(plain.hit_step)
    weights = config.first_offset * rng.standard_normal(rallies.weights_shape)
    changed, _ = rallies.repeat(weights)
    width = weights.shape[2]
    response = np.zeros((len(weights), plain.answer.shape[-1], width))
    for row, (own, before, after) in enumerate(zip(weights, plain.answer, changed.answer, strict=True)):
        both = plain.returned[row] & changed.returned[row]
        chosen, change = own[both], (after - before)[both]
        ridge = 0.1 * config.first_offset**2 * np.eye(width)
        response[row] = np.linalg.solve(chosen.T @ chosen + ridge, chosen.T @ change).T
    return response


def correct(
    rallies: RepeatedRallies,
    policy: BatchPolicy,
    targets: Array,
    response: Array,
    config: CorrectionConfig,
    rng: np.random.Generator,
    look: Callable[[], None] = lambda: None,
) -> Corrected:
    """Play rallies again until their balls land at their `targets` (S, K, 2) with the spin that they had.

    Parameters
    ----------
    response
        As from `fit_response`.
    look
        Called before each repetition; what it raises ends the work.
    """
    landed, rollout = rallies.play(policy)
    rallies.place_bumps(landed.hit_step)
    spin = landed.answer[..., 2:3]
    spin = np.where(np.isnan(spin), np.nanmean(spin, axis=1, keepdims=True), spin)
    wanted = np.concatenate([targets, spin, np.zeros((*spin.shape[:2], 2))], axis=-1)
    weights = np.zeros(rallies.weights_shape)
    own = np.repeat(response[:, None], weights.shape[1], axis=1)
    caution = np.ones(landed.returned.shape)
    for _ in range(config.repetitions):
        look()
        # Where a ball has not come back there is nothing to go by but to try something else.
        lost = 0.05 * rng.standard_normal(wanted.shape)
        step = np.where(landed.returned[..., None], wanted - landed.answer, lost)
        length = np.linalg.norm(step, axis=-1)
        step *= (caution * np.minimum(1.0, config.longest_step_m / np.maximum(length, 1e-9)))[..., None]
        normal = own @ own.swapaxes(-1, -2) + _STIFFNESS_M2 * np.eye(wanted.shape[-1])
        change = (own.swapaxes(-1, -2) @ np.linalg.solve(normal, step[..., None]))[..., 0]
        tried, again = rallies.repeat(weights + change)
        both = tried.returned & landed.returned
        surprise = tried.answer - landed.answer - (own @ change[..., None])[..., 0]
        rank_one = surprise[..., :, None] * change[..., None, :]
        rank_one /= np.maximum((change**2).sum(axis=-1), 1e-6)[..., None, None]
        own = np.where(both[..., None, None], own + config.broyden_rate * rank_one, own)
        is_nearer = np.linalg.norm(wanted - tried.answer, axis=-1) < length
        better = tried.returned & (is_nearer | ~landed.returned)
        weights = np.where(better[..., None], weights + change, weights)
        kept: list[tuple[NDArray[Any], NDArray[Any]]] = [*zip(landed, tried, strict=True)]
        for old, new in (*kept, *zip(rollout, again, strict=True)):
            old[better] = new[better]
        caution = np.where(better, np.minimum(1.0, 1.5 * caution), 0.5 * caution)
    keeps_spin = np.abs(landed.answer[..., 2] - wanted[..., 2]) < _SPIN_M_S * MOST_SPIN_RAD_S
    return Corrected(landed, rollout, keeps_spin)


def _places_on_blade(robot: Robot, path: Sequence[tuple[Array, Array, Array]], hit_step: Array) -> Array:
    """Where balls were met, beside the middle of the blade: across and along the handle, (S, K, 2) in m.

    Parameters
    ----------
    path
        Joint positions, joint rates and balls of each step, (S, K, ...).
    hit_step
        When, (S, K), in steps; NaN where there is nothing to tell.
    """
    places = np.full((*hit_step.shape, 2), np.nan)
    for row, column in np.argwhere((hit_step > 0.0) & (hit_step < len(path) - 1)):
        step = int(hit_step[row, column])
        share = hit_step[row, column] - step
        position, rate, ball = (array[row, column] for array in path[step])
        gain = share * (path[step + 1][1][row, column] - rate)
        centre, rotation = paddle_pose(robot.model, position + share * CONTROL_PERIOD_S * (rate + 0.5 * gain))
        met = ball[POSITION] + share * CONTROL_PERIOD_S * ball[VELOCITY] - centre
        places[row, column] = rotation[:, [0, 2]].T @ met
    return places

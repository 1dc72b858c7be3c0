"""The Hopper without termination, the paper's second simulated task: MuJoCo, many episodes side by side."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from mujoco import rollout
from numpy.typing import NDArray

from msrd_ros.core.errors import UserError
from msrd_ros.core.processors import usable_processors
from msrd_ros.learning.layout import Layout

SPEED_NAME = "forward_speed"
FEATURE_NAMES = (
    "torso_z",
    "torso_angle",
    "thigh_angle",
    "leg_angle",
    "foot_angle",
    "torso_vx",
    "torso_vz",
    "torso_rate",
    "thigh_rate",
    "leg_rate",
    "foot_rate",
)
"""What Gymnasium's Hopper-v5 observes, and all that policies and rewards see."""
TRUNK_NAMES = ("torso_z", "torso_angle", "torso_vx", "torso_vz", "torso_rate")
"""Where the body is and how it moves, without the limbs that move it."""
OBSERVATION_NAMES = (SPEED_NAME, *FEATURE_NAMES)
"""The distance covered in the last step, over its duration, goes first: the true reward, Gymnasium's
``forward_reward``. It is there for judging only; no network gets this column."""
ACTION_NAMES = ("thigh_torque", "leg_torque", "foot_torque")

EPISODE_STEPS = 1000
FRAME_SKIP = 4
CONTROL_PERIOD_S = 0.008
RESET_NOISE = 0.005
_RATE_LIMIT = 10.0
_COORDINATES = 6


@dataclass(frozen=True)
class HopperBody:
    """Changes of the standard Hopper, for studies of transfer.

    Attributes
    ----------
    mass
        Factor on the masses and inertias of all links.
    friction
        Factor on the friction of all contacts.
    """

    mass: float = 1.0
    friction: float = 1.0

    def model(self) -> mujoco.MjModel:
        """The compiled model: Gymnasium's ``hopper.xml`` with these changes.

        Raises
        ------
        UserError
            If Gymnasium's model file is not where it should be.
        """
        model = mujoco.MjModel.from_xml_string(_standard_xml())
        model.body_mass *= self.mass
        model.body_inertia *= self.mass
        model.geom_friction *= self.friction
        mujoco.mj_setConst(model, mujoco.MjData(model))
        return model


@cache
def _standard_xml() -> str:
    import gymnasium

    path = Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets" / "hopper.xml"
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({error.strerror}); reinstall gymnasium") from None


class Hopper:
    """Episodes side by side on all cores the process may use, through MuJoCo's batched rollouts.

    Equal to Gymnasium's Hopper-v5 with ``terminate_when_unhealthy=False``, step by step.

    Parameters
    ----------
    horizon
        Steps of an episode, of 0.008 s each; the paper's timeout is 1,000.
    body
        Masses and friction.
    random_actions
        Probability with which an action is replaced by a uniformly random one, one value for all or
        ``[S, K]``: the noise injection (Brown et al., 2019) that makes trajectories of various quality.
    autoreset
        Whether an episode starts again, one step after it stopped being healthy, for all or per strategy: for
        training demonstrators, and for bad examples.
    """

    observation_names = OBSERVATION_NAMES
    action_names = ACTION_NAMES

    def __init__(
        self,
        horizon: int = EPISODE_STEPS,
        body: HopperBody | None = None,
        random_actions: float | NDArray[np.float64] = 0.0,
        autoreset: bool | tuple[bool, ...] = False,
    ) -> None:
        self.horizon = self.acting_steps = horizon
        self._random_actions = np.asarray(random_actions, dtype=np.float64)
        self._autoreset = autoreset
        self._model = (body or HopperBody()).model()
        threads = usable_processors()
        self._data = [mujoco.MjData(self._model) for _ in range(threads)]
        self._pool = rollout.Rollout(nthread=threads if threads > 1 else 0)
        self._physics = np.zeros((0, 0))
        self._results = np.zeros((0, FRAME_SKIP, 0))
        self._shape = (0, 0)
        self._rng = np.random.default_rng(0)

    def reset(self, strategies: int, episodes: int, rng: np.random.Generator) -> NDArray[np.float64]:
        """Standing but for uniform noise of 0.005 in every coordinate and rate, as Gymnasium has it."""
        self._shape, self._rng = (strategies, episodes), rng
        self._physics = self._starts(strategies * episodes)
        self._results = np.empty((len(self._physics), FRAME_SKIP, self._physics.shape[1]))
        return self._observe(np.zeros(len(self._physics)))

    def step(self, action: NDArray[np.floating]) -> NDArray[np.float64]:
        """Apply ``action [S, K, 3]``, clipped to [-1, 1] by the motors, for 0.008 s."""
        control = np.asarray(action, dtype=np.float64)
        if self._random_actions.any():
            replaced = self._rng.random(self._shape) < self._random_actions
            drawn = self._rng.uniform(-1.0, 1.0, control.shape)
            control = np.where(replaced[..., None], drawn, control)
        count = self._physics.shape[0]
        held = np.repeat(control.reshape(count, 1, -1), FRAME_SKIP, axis=1)
        arguments: dict[str, Any] = {"nstep": FRAME_SKIP, "skip_checks": True}
        self._pool.rollout(
            [self._model] * count,
            self._data,
            self._physics,
            held,
            state=self._results,
            **arguments,
        )
        fallen = self._down() if self._autoreset else None
        speed = (self._results[:, -1, 1] - self._physics[:, 1]) / CONTROL_PERIOD_S
        self._physics = self._results[:, -1].copy()
        if fallen is not None and fallen.any():
            self._physics[fallen] = self._starts(int(fallen.sum()))
            speed[fallen] = 0.0
        return self._observe(speed)

    def _starts(self, count: int) -> NDArray[np.float64]:
        width = mujoco.mj_stateSize(self._model, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        physics = np.zeros((count, width))
        physics[:, 1 : 1 + _COORDINATES] = self._model.qpos0
        physics[:, 1:] += self._rng.uniform(-RESET_NOISE, RESET_NOISE, size=(count, 2 * _COORDINATES))
        return physics

    def _down(self) -> NDArray[np.bool_]:
        """Episodes that are to start again, ``[S * K]``."""
        strategies, episodes = self._shape
        strict = np.repeat(np.broadcast_to(self._autoreset, strategies), episodes)
        return np.asarray(strict & ~is_healthy(self._physics[:, 1:]))

    def _observe(self, speed: NDArray[np.float64]) -> NDArray[np.float64]:
        seen = self._physics[:, 1:].copy()
        seen[:, 0] = speed
        seen[:, _COORDINATES:] = seen[:, _COORDINATES:].clip(-_RATE_LIMIT, _RATE_LIMIT)
        return seen.reshape(*self._shape, -1)


def task_reward(observations: NDArray[np.floating]) -> NDArray[np.float64]:
    """True task reward of states ``[..., 12]``: forward speed in m/s, ``[...]`` (paper, Section 5.1)."""
    return np.asarray(observations[..., 0], dtype=np.float64)


def mean_speed(observations: NDArray[np.floating]) -> NDArray[np.float64]:
    """Mean forward speed of trajectories ``[..., T+1, 12]`` in m/s, ``[...]``."""
    return np.asarray(task_reward(observations)[..., 1:].mean(axis=-1), dtype=np.float64)


def is_healthy(observations: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Gymnasium's measure for states ``[..., 12]``: torso above 0.7 m and within 0.2 rad of upright."""
    height, angle = observations[..., 1], observations[..., 2]
    rest = np.abs(observations[..., 2:]).max(axis=-1)
    return np.asarray((height > 0.7) & (np.abs(angle) < 0.2) & (rest < 100.0))


def hopper_layout(labels: tuple[str, ...]) -> Layout:
    """Layout of demonstrations and policies on this task."""
    return Layout(OBSERVATION_NAMES, ACTION_NAMES, labels, CONTROL_PERIOD_S)

"""Policies of table tennis strokes: a policy set with each strategy's ready pose, ready to play."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from msrd_ros.contract.episode import ACTING_STEPS, CONTROL_PERIOD_S, action_names, observation_names
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.core.errors import UserError
from msrd_ros.learning.layout import Layout
from msrd_ros.learning.policy import PolicySet
from msrd_ros.robots.default import DEFAULT_ROBOT
from msrd_ros.robots.loading import default_robot
from msrd_ros.robots.robot import Robot
from msrd_ros.table_tennis.strategies.table import Side, Strategies
from msrd_ros.table_tennis.strokes.reach import TARGET_NAMES, Reach, say_point

PolicyFunction = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""Maps an observation (N + 6,) to an action (N,)."""
RALLY_POLICIES_FILE = "rally.safetensors"
"""Beside ``robot.yaml``: policies that learned from balls of rallies."""
MOST_NOISE_RAD = 0.2
"""Of the start posture while exploring; the trainer's parameter goes as far."""


def stroke_layout(robot: Robot, labels: Sequence[StrategyLabel] = (), takes_target: bool = False) -> Layout:
    """The layout of strokes of an arm: what every policy that the executor plays must have.

    Parameters
    ----------
    takes_target
        Whether policies see where the ball is to land, behind the rest.
    """
    seen = (*observation_names(robot), *(TARGET_NAMES if takes_target else ()))
    return Layout(seen, action_names(robot), tuple(map(str, labels)), CONTROL_PERIOD_S)


class StrokeDraws(NamedTuple):
    """Standard normal draws of one stroke: start posture (N,) and exploration (T_act, N)."""

    ready: NDArray[np.float64]
    action: NDArray[np.float64]

    @classmethod
    def of(cls, seed: int, index: int, joints: int) -> StrokeDraws:
        """The draws of stroke number `index`: the same whoever plays it, in process or over topics."""
        rng = np.random.default_rng((seed, index))
        return cls(rng.standard_normal(joints), rng.standard_normal((ACTING_STEPS, joints)))


@dataclass(frozen=True)
class StrokeFacts:
    """What the demonstrations say of one strategy beside its policy.

    Attributes
    ----------
    ready_pose
        Mean posture in which they begin, shape (N,), rad.
    landing_point
        Mean landing point of their returned balls, shape (2,), m; NaN where unknown.
    side
        Where balls are fed.
    reach
        Where balls land when they are told to; None of policies that take no target.
    """

    ready_pose: NDArray[np.float64]
    landing_point: NDArray[np.float64]
    side: Side
    reach: Reach | None = None

    def require_reach(self, target: NDArray[np.float64], whose: str) -> None:
        """Refuse a target (2,), m, that the strategy cannot be told to hit.

        Raises
        ------
        UserError
            If its policy takes none, or it is out of reach; names the nearest that is in reach.
        """
        if self.reach is None:
            raise UserError(
                f"target {say_point(target)}: the policy of {whose} takes no target; learn targets for it: "
                "`python -m msrd_ros aim`"
            )
        self.reach.require(target, whose)


@dataclass(frozen=True)
class StrokePolicies:
    """Policies of several strategies with what is needed to play them on the robot.

    Attributes
    ----------
    policies
        The networks.
    facts
        By strategy.
    exploration_seed
        Of the draws with which actions are to be varied; None plays the means.
    ready_noise_rad
        Spread of the start posture while exploring.
    robot
        The arm that plays them.
    """

    policies: PolicySet
    facts: Mapping[StrategyLabel, StrokeFacts]
    exploration_seed: int | None = None
    ready_noise_rad: float = 0.0
    robot: Robot = field(default_factory=default_robot)

    @property
    def labels(self) -> tuple[StrategyLabel, ...]:
        """Strategies that can be played."""
        return tuple(self.facts)

    @property
    def takes_target(self) -> bool:
        """Whether these policies can be told where the ball is to land; those of 0.1.0 cannot."""
        return self.policies.layout.observation_names[-len(TARGET_NAMES) :] == TARGET_NAMES

    @property
    def digest(self) -> str:
        """Tells these policies and their draws from others, in few letters."""
        weights = self.policies.digest[:12]
        return weights if self.exploration_seed is None else f"{weights}/{self.exploration_seed}"

    def require(self, label: StrategyLabel) -> StrokeFacts:
        """What is known of a strategy.

        Raises
        ------
        UserError
            If there is no such strategy.
        """
        if label not in self.facts:
            known = ", ".join(map(str, self.facts))
            raise UserError(f"no policy for strategy {label}; the checkpoint has {known}")
        return self.facts[label]

    def play(
        self, label: StrategyLabel, draws: StrokeDraws, target: NDArray[np.float64] | None = None
    ) -> PolicyFunction:
        """One stroke of a strategy: its mean actions, varied by `draws` if exploration is wanted.

        Parameters
        ----------
        target
            Where the ball is to land, (2,), m; None: at the teacher's mean point. Whether it is in reach is
            for `StrokeFacts.reach` to say.

        Raises
        ------
        UserError
            If a target is given to policies that take none.
        """
        if target is not None and not self.takes_target:
            raise UserError(f"policies {self.digest} take no target; learn targets for them with `aim`")
        policy = self.policies.policy(str(label))
        aimed_at = self.facts[label].landing_point if target is None else target
        tail = aimed_at if self.takes_target else np.zeros(0)
        noise = None if self.exploration_seed is None else iter(draws.action)

        def act(observation: NDArray[np.float64]) -> NDArray[np.float64]:
            seen = np.concatenate([observation, tail])
            return np.asarray(policy.act(seen, None if noise is None else next(noise)), dtype=np.float64)

        return act

    @property
    def described(self) -> PolicySet:
        """The networks with the strokes' facts among their details."""
        details = {
            **self.policies.details,
            "strokes": {
                str(label): {
                    "ready_pose": facts.ready_pose.tolist(),
                    "landing_point": [None if math.isnan(x) else x for x in facts.landing_point.tolist()],
                    "side": facts.side.value,
                    **({} if facts.reach is None else {"reach": facts.reach.to_json()}),
                }
                for label, facts in self.facts.items()
            },
            "exploration_seed": self.exploration_seed,
            "ready_noise_rad": self.ready_noise_rad,
            "robot": self.robot.identity,
        }
        return replace(self.policies, details=details)

    def to_bytes(self) -> bytes:
        """A policy file that holds the strokes' facts, too."""
        return self.described.to_bytes()

    @classmethod
    def from_bytes(cls, data: bytes, where: str, robot: Robot | None = None) -> StrokePolicies:
        """Read what `to_bytes` wrote, for an arm (the default one if None).

        Raises
        ------
        UserError
            If it is no policy file, made for another robot, or a ready pose is missing or unreachable.
        """
        policies = PolicySet.from_bytes(data, where)
        arm = robot or default_robot()
        details = policies.details
        # 0.1.0 knew one arm and did not say so.
        arm.require(str(details.get("robot", DEFAULT_ROBOT)), where)
        told = policies.layout.observation_names[-len(TARGET_NAMES) :] == TARGET_NAMES
        policies.layout.require(stroke_layout(arm, takes_target=told), where)
        strokes = details.get("strokes")
        if not isinstance(strokes, dict):
            raise UserError(f"{where}: has no ready poses; give a policies file that the trainer node wrote")
        facts = {}
        for text in policies.layout.labels:
            label = StrategyLabel.parse(text, where)
            stroke = strokes.get(text)
            if not isinstance(stroke, dict):
                raise UserError(f"{where}: the ready pose of {text} is missing; train again")
            ready_pose = _read_numbers(stroke, "ready_pose", label, where)
            landing_point = _read_numbers(stroke, "landing_point", label, where)
            if ready_pose.shape != (arm.joint_count,):
                raise UserError(
                    f"{where}: ready pose of {text} has {ready_pose.size} joints, {arm.name} has "
                    f"{arm.joint_count}; train again"
                )
            if landing_point.shape != (2,) or np.isinf(landing_point).any():
                raise UserError(
                    f"{where}: landing point of {text} is {landing_point.tolist()}, not x and y; train again"
                )
            fits = (ready_pose >= arm.limits.lower_rad) & (ready_pose <= arm.limits.upper_rad)
            if not fits.all():
                joint = arm.joint_names[int(np.argmin(fits))]
                raise UserError(f"{where}: ready pose of {text}: joint {joint} is out of its limits")
            reach = _read_reach(stroke, landing_point, label, where) if told else None
            facts[label] = StrokeFacts(ready_pose, landing_point, _read_side(stroke, label, where), reach)
        seed, noise_rad = _read_exploration(details, where)
        return cls(policies, facts, seed, noise_rad, arm)

    @classmethod
    def load(cls, path: Path, robot: Robot | None = None) -> StrokePolicies:
        """Read a file; see `from_bytes`."""
        try:
            data = Path(path).expanduser().read_bytes()
        except OSError as error:
            raise UserError(
                f"{path}: cannot read the checkpoint ({error.strerror}); train one, or mend the path"
            ) from None
        return cls.from_bytes(data, str(path), robot)


def rally_policies(robot: Robot) -> StrokePolicies:
    """The policies for rallies that come with an arm.

    Raises
    ------
    UserError
        If none do.
    """
    path = robot.folder / RALLY_POLICIES_FILE
    if not path.is_file():
        raise UserError(
            f"{robot.name}: no policies for rallies come with it ({path}); give a checkpoint, or learn them "
            f"with python -m msrd_ros learn-rally --robot {robot.name}"
        )
    return StrokePolicies.load(path, robot)


def _read_numbers(
    stroke: Mapping[str, Any], name: str, label: StrategyLabel, where: str
) -> NDArray[np.float64]:
    """A list of numbers; null stands for one that is not known."""
    what = f"{where}: the {name.replace('_', ' ')} of {label}"
    if name not in stroke:
        raise UserError(f"{what} is missing; train again")
    try:
        numbers = np.array(stroke[name], dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise UserError(f"{what} does not hold numbers; train again") from None
    return numbers


def _read_reach(
    stroke: Mapping[str, Any], landing_point: NDArray[np.float64], label: StrategyLabel, where: str
) -> Reach:
    """The reach of a strategy that takes a target, and a landing point for when there is none."""
    if not np.isfinite(landing_point).all():
        raise UserError(f"{where}: the landing point of {label} is not known; learn the targets again")
    return Reach.from_json(stroke.get("reach"), f"{where}: {label}")


def _read_exploration(details: Mapping[str, Any], where: str) -> tuple[int | None, float]:
    """Seed and spread of the start posture while exploring; files of policies to be played have none."""
    seed, noise_rad = details.get("exploration_seed"), details.get("ready_noise_rad", 0.0)
    if seed is not None and (not isinstance(seed, int) or isinstance(seed, bool) or seed < 0):
        raise UserError(f"{where}: exploration_seed is {seed!r}, not a whole number; train again")
    is_number = isinstance(noise_rad, int | float) and not isinstance(noise_rad, bool)
    if not is_number or not 0.0 <= noise_rad <= MOST_NOISE_RAD:
        raise UserError(
            f"{where}: ready_noise_rad is {noise_rad!r}, not from 0 to {MOST_NOISE_RAD:g}; train again"
        )
    return seed, float(noise_rad)


def _read_side(stroke: Mapping[str, Any], label: StrategyLabel, where: str) -> Side:
    """The side that a file tells; files of version 0.1.0 tell none and hold listed strategies only."""
    told, listed = stroke.get("side"), Strategies.shipped().of(label).side
    if told is None and listed is not None:
        return listed
    try:
        return Side(str(told))
    except ValueError:
        raise UserError(f"{where}: the side of {label} is missing or unknown; train again") from None

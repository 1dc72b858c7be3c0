"""Multi-Strategy Reward Distillation as a library: ``import msrd_ros.learning as msrd``.

Demonstrations of one task in several ways go in; what the ways have in common and what is each one's own come
out, as rewards and as policies. Knows neither ROS nor Bullet nor table tennis.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from msrd_ros.core.errors import UserError
    from msrd_ros.learning.config import MSRDConfig
    from msrd_ros.learning.data_sets import demonstrations_from_lerobot, demonstrations_from_minari
    from msrd_ros.learning.demonstration_sets import demonstrations_from_arrays
    from msrd_ros.learning.discovery.discover import discover, discovered
    from msrd_ros.learning.discovery.recheck import Recheck, recheck
    from msrd_ros.learning.discovery.result import Discovery
    from msrd_ros.learning.environment import GymEnvironment
    from msrd_ros.learning.examples import example_demonstrations
    from msrd_ros.learning.layout import Layout
    from msrd_ros.learning.learned import Learned
    from msrd_ros.learning.method import Learner, Method, Problem
    from msrd_ros.learning.methods import METHODS, find_method
    from msrd_ros.learning.newcomers.newcomers import Meeting, Newcomers
    from msrd_ros.learning.newcomers.recognition import Recognition
    from msrd_ros.learning.playing import play
    from msrd_ros.learning.policy import Policy, PolicySet
    from msrd_ros.learning.recipe import default_config
    from msrd_ros.learning.reward_wrapper import LearnedReward
    from msrd_ros.learning.rollouts import BatchedEnvironment, Collector
    from msrd_ros.learning.training import train
    from msrd_ros.learning.trajectories import Demonstrations, Rollouts

__all__ = [
    "METHODS",
    "BatchedEnvironment",
    "Collector",
    "Demonstrations",
    "Discovery",
    "GymEnvironment",
    "Layout",
    "Learned",
    "LearnedReward",
    "Learner",
    "MSRDConfig",
    "Meeting",
    "Method",
    "Newcomers",
    "Policy",
    "PolicySet",
    "Problem",
    "Recheck",
    "Recognition",
    "Rollouts",
    "UserError",
    "default_config",
    "demonstrations_from_arrays",
    "demonstrations_from_lerobot",
    "demonstrations_from_minari",
    "discover",
    "discovered",
    "example_demonstrations",
    "find_method",
    "play",
    "recheck",
    "train",
]

_HOMES = {
    "METHODS": "methods",
    "BatchedEnvironment": "rollouts",
    "Collector": "rollouts",
    "Demonstrations": "trajectories",
    "Discovery": "discovery.result",
    "GymEnvironment": "environment",
    "Layout": "layout",
    "Learned": "learned",
    "LearnedReward": "reward_wrapper",
    "Learner": "method",
    "MSRDConfig": "config",
    "Meeting": "newcomers.newcomers",
    "Method": "method",
    "Newcomers": "newcomers.newcomers",
    "Policy": "policy",
    "PolicySet": "policy",
    "Problem": "method",
    "Recheck": "discovery.recheck",
    "Recognition": "newcomers.recognition",
    "Rollouts": "trajectories",
    "default_config": "recipe",
    "demonstrations_from_arrays": "demonstration_sets",
    "demonstrations_from_lerobot": "data_sets",
    "demonstrations_from_minari": "data_sets",
    "discover": "discovery.discover",
    "discovered": "discovery.discover",
    "example_demonstrations": "examples",
    "find_method": "methods",
    "play": "playing",
    "recheck": "discovery.recheck",
    "train": "training",
}
"""Modules are loaded when they are first asked for: other rooms need one or two of them, and no torch."""


def __getattr__(name: str) -> Any:
    if name == "UserError":
        return import_module("msrd_ros.core.errors").UserError
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])

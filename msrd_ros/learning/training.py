"""From demonstrations and an environment to rewards and policies, in one call."""

from __future__ import annotations

from dataclasses import replace
from importlib.metadata import version
from typing import Any

import numpy as np

from msrd_ros.core.errors import UserError
from msrd_ros.learning.action_scale import ActionScale
from msrd_ros.learning.checkpoints import export_policies
from msrd_ros.learning.config import MSRDConfig
from msrd_ros.learning.discovery.discover import discovered
from msrd_ros.learning.discovery.recheck import recheck
from msrd_ros.learning.harness import Harness, Task
from msrd_ros.learning.learned import Learned
from msrd_ros.learning.method import Learner, Method, Problem
from msrd_ros.learning.methods import find_method
from msrd_ros.learning.places import Place, find_place
from msrd_ros.learning.policy import PolicySet
from msrd_ros.learning.recipe import default_config
from msrd_ros.learning.threads import one_thread
from msrd_ros.learning.trajectories import NO_LABEL, Demonstrations


def train(
    demonstrations: Demonstrations,
    environment: Any,
    method: str | Method = "msrd",
    config: MSRDConfig | None = None,
    labels: str = "given",
    seed: int = 0,
    progress: bool = True,
) -> Learned:
    """Learn what all strategies want, what each of them wants beside it, and how to do it.

    Parameters
    ----------
    demonstrations
        Of `demonstrations_from_arrays` and its like.
    environment
        Where policies are played: the id of a Gymnasium environment, one of its environments, a function
        that makes one, a `GymEnvironment`; or a `BatchedEnvironment` or `Collector` of your own.
    method
        A name of `METHODS`, or a `Method`.
    config
        Settings; None: `default_config`.
    labels
        ``"given"``: the demonstrations say whose they are. ``"discover"``: they say so in part, wrongly or
        not at all, and `discover` finds out; each is then trained as the strategy that was found for it,
        also where its label says another. What was found is in the result's ``details["discovery"]``.
    seed
        Everything random follows from it: the same seed gives the same result on one machine.
    progress
        Whether to show a progress bar.

    Raises
    ------
    UserError
        If demonstrations and environment do not go together, a setting is wrong, or a rollout or the
        training gave numbers that are not finite.

    Warns
    -----
    UserWarning
        If the demonstrations look as if they were made in another environment.
    """
    if labels not in ("given", "discover"):
        raise UserError(f"labels={labels!r}: there are 'given' and 'discover'")
    chosen = find_method(method)
    found, shown = None, demonstrations
    if labels == "discover":
        demonstrations, found = discovered(shown, seed)
    elif NO_LABEL in demonstrations.layout.labels:
        raise UserError(
            "demonstrations: some have no label; label every one, or train with labels='discover'"
        )
    place = find_place(environment, demonstrations)
    settings = config or default_config(restarts=place.autoreset is not None)
    if settings.cloning.restarts and place.autoreset is None:
        raise UserError("cloning.restarts: only Gymnasium environments start again; leave it empty")
    scale, scaled = place.scale, demonstrations
    if scale:
        scaled = replace(demonstrations, actions=scale.to_unit(demonstrations.actions))
        settings = _in_units(settings, demonstrations, scale)
    with one_thread():
        learner = chosen.start(Problem(settings, scaled, place.collector, seed, autoreset=place.autoreset))
        Harness(learner, _Returns(place), title=chosen.title if progress else None).run()
    details = {
        "method": chosen.name,
        "seed": seed,
        "config": learner.config.to_dict(),
        "curve": place.curve,
        "environment_steps": learner.environment_steps,
        "versions": {name: version(name) for name in ("torch", "numpy")},
    }
    if scale:
        details["action_scale"] = {"centre": scale.centre.tolist(), "half": scale.half.tolist()}
    rewards = learner.averaged_rewards.requires_grad_(False) if chosen.has_rewards else None
    learned = Learned(_policies_of_all(learner, demonstrations, scale), rewards, details)
    if found is not None:
        details["discovery"] = {**found.to_dict(), "recheck": recheck(learned, shown, found.labels).to_dict()}
    return learned


class _Returns(Task):
    """Shows what the environment itself pays.

    Parameters
    ----------
    place
        Where policies are played.
    """

    def __init__(self, place: Place) -> None:
        self._curve = place.curve

    def at_point(self, harness: Harness) -> None:
        """Leave out what was played while cloning."""
        self._curve.clear()

    def summary(self, harness: Harness) -> str:
        """The latest mean returns."""
        if not self._curve:
            return ""
        return "the environment's own return " + ", ".join(f"{value:.0f}" for value in self._curve[-1])


def _in_units(config: MSRDConfig, demonstrations: Demonstrations, scale: ActionScale) -> MSRDConfig:
    """The gains of recovery labels, which are in the environment's units, in those of the policies."""
    half = dict(zip(demonstrations.layout.action_names, scale.half, strict=True))
    labels = tuple(
        (column, action, gain / float(half.get(action, 1.0)))
        for column, action, gain in config.cloning.recovery_labels
    )
    return replace(config, cloning=replace(config.cloning, recovery_labels=labels))


def _policies_of_all(
    learner: Learner, demonstrations: Demonstrations, scale: ActionScale | None
) -> PolicySet:
    """One policy for every label, in the environment's units; a method's only policy serves all."""
    found = export_policies(learner.policies, demonstrations.layout)
    tensors = dict(found.tensors)
    last = sum(name.startswith("weight/") for name in tensors) - 1
    if scale is not None:
        half, centre = scale.half.astype(np.float32), scale.centre.astype(np.float32)
        tensors[f"weight/{last}"] = tensors[f"weight/{last}"] * half
        tensors[f"bias/{last}"] = tensors[f"bias/{last}"] * half + centre
        tensors["log_std"] = tensors["log_std"] + np.log(half)
    if learner.policies.strategies == 1:
        for name in found.stacked:
            tensors[name] = np.repeat(tensors[name], demonstrations.strategies, axis=0)
    return PolicySet(found.layout, tensors, {})

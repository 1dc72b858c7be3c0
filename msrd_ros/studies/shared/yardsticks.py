"""Rows beside the methods: a classifier without inverse reinforcement learning, and two that know more."""

from __future__ import annotations

import time
from typing import TypeVar

import numpy as np
import torch
from torch import Tensor

from msrd_ros.learning.baselines import StrategyClassifier, SupervisedRewards
from msrd_ros.learning.replay import DemonstrationPool
from msrd_ros.studies.shared.estimates import Estimate, from_classifier, from_places, from_teaching
from msrd_ros.studies.shared.method import Exercise, StudyMethod
from msrd_ros.studies.shared.task import VirtualTask

N = TypeVar("N", StrategyClassifier, SupervisedRewards)


class Classifier(StudyMethod):
    """Whose state is it: a softmax classifier of the demonstrated states."""

    name = "classifier"
    title = "softmax classifier, no inverse RL"

    def train(self, exercise: Exercise) -> Estimate:
        """Fit it."""
        started = time.perf_counter()
        classifier = _fresh(StrategyClassifier, exercise)
        classifier.fit(DemonstrationPool(exercise.demonstrations), exercise.budget.classifier_steps)
        return from_classifier(classifier, time.perf_counter() - started)

    def restore(self, exercise: Exercise, weights: dict[str, Tensor], seconds: float, steps: int) -> Estimate:
        """The classifier with these weights."""
        classifier = _fresh(StrategyClassifier, exercise)
        classifier.network.load_state_dict(weights)
        return from_classifier(classifier, seconds)


class Oracle(StudyMethod):
    """Knows the form of the answer: where the strategy's identifying feature settles."""

    name = "oracle"
    title = "oracle: distance to where the strategy settles"

    def train(self, exercise: Exercise) -> Estimate:
        """Take the mean of the second half of the demonstrations."""
        started, task = time.perf_counter(), _known(exercise)
        observations = exercise.demonstrations.observations
        half = observations.shape[2] // 2
        settled = np.asarray(observations[:, :, half:, task.identifying_feature], dtype=np.float64)
        places = torch.as_tensor(settled.mean(axis=(1, 2)), dtype=torch.float32)
        return from_places(task, places, time.perf_counter() - started)

    def restore(self, exercise: Exercise, weights: dict[str, Tensor], seconds: float, steps: int) -> Estimate:
        """From these places."""
        return from_places(_known(exercise), weights["places"], seconds)


class Supervised(StudyMethod):
    """Knows the true strategy rewards of all demonstrated states."""

    name = "supervised"
    title = "regression on the truth of all demonstrated states"

    def train(self, exercise: Exercise) -> Estimate:
        """Fit it to the truth."""
        if exercise.truth is None:
            raise ValueError("the regression on the truth needs the true strategy rewards: pass truth")
        started = time.perf_counter()
        supervised = _fresh(SupervisedRewards, exercise)
        pool, steps = DemonstrationPool(exercise.demonstrations), exercise.budget.classifier_steps
        supervised.fit(pool, exercise.truth.table, steps)
        return from_teaching(supervised, time.perf_counter() - started)

    def restore(self, exercise: Exercise, weights: dict[str, Tensor], seconds: float, steps: int) -> Estimate:
        """The regression with these weights."""
        supervised = _fresh(SupervisedRewards, exercise)
        supervised.bounds = weights.pop("bounds")
        supervised.network.load_state_dict(weights)
        return from_teaching(supervised, seconds)


def _known(exercise: Exercise) -> VirtualTask:
    """The task, of which it is known what tells its strategies apart."""
    if not isinstance(exercise.task, VirtualTask):
        raise ValueError(f"{exercise.task.name}: nobody knows which feature tells its strategies apart")
    return exercise.task


def _fresh(network: type[N], exercise: Exercise) -> N:
    """A network on the demonstrations' states, untrained."""
    generator = torch.Generator().manual_seed(exercise.seed)
    return network(exercise.demonstrations.strategies, exercise.task.features, (32, 32), generator)

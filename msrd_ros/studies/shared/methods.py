"""Rows of the tables of all studies in simulation, by name: every method with rewards, and the yardsticks."""

from __future__ import annotations

from msrd_ros.learning import methods as learning
from msrd_ros.studies.shared.method import InverseLearning, StudyMethod
from msrd_ros.studies.shared.yardsticks import Classifier, Oracle, Supervised

PLAYING = {name: InverseLearning(method) for name, method in learning.METHODS.items() if method.has_rewards}
METHODS: dict[str, StudyMethod] = {
    **PLAYING,
    **{method.name: method for method in (Classifier(), Oracle(), Supervised())},
}

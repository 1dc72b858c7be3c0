"""Training runs of a study, each kept as a file and not run again: an interrupted study resumes.

Seeds are kept apart: demonstrations, training, and test trajectories of repetition k are drawn from seeds
2000 + k, 1000 + k and 3000 + k; everything tuned was tuned on seeds from 9000 on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from safetensors.torch import load as load_tensors
from safetensors.torch import save as save_tensors

from msrd_ros.experiments.run_keys import digest
from msrd_ros.experiments.virtual_studies.evaluation import TestSet, evaluate, make_test_set
from msrd_ros.experiments.virtual_studies.methods import Budget, Estimate, Method, configure, restore, train
from msrd_ros.experiments.virtual_studies.statistics import summarise
from msrd_ros.experiments.virtual_studies.task import Demonstrators, VirtualTask
from msrd_ros.learning.checkpoints import write_atomically
from msrd_ros.learning.trajectories import Demonstrations

TRAINING_SEED, DEMONSTRATION_SEED, TEST_SEED = 1000, 2000, 3000


@dataclass(frozen=True)
class Runs:
    """Runs of any method and repetition on one task and one set of demonstrators.

    Attributes
    ----------
    task, demonstrators
        What is studied.
    name
        Of the demonstrators, at the head of file names.
    budget
        What each method may use.
    demonstrations
        Trajectories of each strategy.
    test_repeats, test_clean
        Test trajectories per strategy and noise level, and without noise.
    folder
        Where the files are.
    progress
        Told what is going on.
    """

    task: VirtualTask
    demonstrators: Demonstrators
    name: str
    budget: Budget
    demonstrations: int
    test_repeats: int
    test_clean: int
    folder: Path
    progress: Callable[[str], None] = lambda line: None

    def estimate(self, method: Method, repetition: int) -> Estimate:
        """Train `method`, or take the run that is already there."""
        path = self.path(method, repetition)
        data = self.demonstrate(repetition)
        if path.exists():
            return restore(self.task, load_tensors(path.read_bytes()), method, data, self.budget)
        self.progress(f"{self.name}: {method.value}, seed {repetition}")
        estimate = train(self.task, method, data, self.budget, TRAINING_SEED + repetition, self.progress)
        write_atomically(path, save_tensors(estimate.tensors()))
        return estimate

    def demonstrate(self, repetition: int) -> Demonstrations:
        """The demonstrations of a repetition, the same for every method."""
        return self.demonstrators.demonstrate(self.demonstrations, DEMONSTRATION_SEED + repetition)

    def test_set(self, repetition: int) -> TestSet:
        """The test trajectories of a repetition."""
        seed = TEST_SEED + repetition
        return make_test_set(self.task, self.demonstrators, seed, self.test_repeats, self.test_clean)

    def compare(self, methods: Iterable[Method], repetitions: int) -> dict[str, Any]:
        """Every method on every repetition: seeds, scores by method (lists over seeds), tests."""
        scores: dict[str, dict[str, list[Any]]] = {}
        for repetition in range(repetitions):
            test = self.test_set(repetition)
            for method in methods:
                estimate = self.estimate(method, repetition)
                result: dict[str, Any] = asdict(evaluate(estimate, test))
                result |= {"seconds": estimate.seconds, "env_steps": estimate.environment_steps}
                result["fallen_share"] = float(test.fallen.mean())
                row = scores.setdefault(method.value, {})
                for name, value in result.items():
                    row.setdefault(name, []).append(value)
        return {
            "seeds": list(range(repetitions)),
            "demonstrators": self.demonstrators.report | {"recipe": asdict(self.demonstrators.recipe)},
            "methods": scores,
            "tests": summarise(scores),
        }

    def path(self, method: Method, repetition: int) -> Path:
        """File of a run; another one as soon as anything about the run has changed."""
        recipe = asdict(self.demonstrators.recipe)
        key = digest(self.name, self.settings(method), recipe, self.demonstrations, repetition)
        return self.folder / f"{self.name}-{method.value}-{repetition}-{key}.safetensors"

    def settings(self, method: Method) -> Any:
        """Everything that a method's run depends on, as data for JSON."""
        if method in (Method.CLASSIFIER, Method.ORACLE):
            return [method.value, self.budget.classifier_steps]
        return [configure(self.task, method, self.budget).to_dict(), self.budget.horizon]

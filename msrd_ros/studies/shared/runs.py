"""Training runs of a study, each kept as a file and not run again: an interrupted study resumes.

Seeds are kept apart: training, demonstrations and test trajectories of repetition k are drawn from seeds
11000 + k, 12000 + k and 13000 + k (run m of an average trains on 11000 + k + 100 m). Everything tuned was
tuned on seeds from 9000 to 9999; those that earlier recipes were judged on, 1000 to 3999, are not used again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cache, partial
from pathlib import Path
from typing import Any, TypeVar

from safetensors.torch import load as load_tensors
from safetensors.torch import save as save_tensors

from msrd_ros.cluster.unit import Unit
from msrd_ros.cluster.workers import Workers
from msrd_ros.core.files import write_atomically
from msrd_ros.learning.trajectories import Demonstrations
from msrd_ros.studies.shared.cache import cache_key, cached
from msrd_ros.studies.shared.estimates import Estimate
from msrd_ros.studies.shared.evaluation import TestSet, evaluate, make_test_set, task_correlation
from msrd_ros.studies.shared.method import Budget, Exercise, StudyMethod, restore
from msrd_ros.studies.shared.methods import METHODS
from msrd_ros.studies.shared.statistics import summarise
from msrd_ros.studies.shared.task import DemonstrationSource, Demonstrators, LearningTask, VirtualTask

T = TypeVar("T")

TRAINING_SEED, DEMONSTRATION_SEED, TEST_SEED = 11_000, 12_000, 13_000


@dataclass(frozen=True)
class SharedPlan:
    """What every plan of a study in simulation says.

    Attributes
    ----------
    seeds
        Repetitions.
    budget
        What each method may use.
    demonstrations
        Trajectories of each strategy.
    test_repeats, test_clean
        Test trajectories per strategy and noise level, and without noise.
    """

    seeds: int = 5
    budget: Budget = field(default_factory=Budget)
    demonstrations: int = 20
    test_repeats: int = 2
    test_clean: int = 5


@dataclass(frozen=True)
class Runs:
    """Runs of any method and repetition on one task and one set of demonstrators.

    Attributes
    ----------
    task, demonstrators
        What is studied.
    name
        Of the demonstrators, at the head of file names.
    plan
        How much of everything.
    folder
        Where the files are.
    methods
        Rows of the tables, by name.
    """

    task: LearningTask
    demonstrators: DemonstrationSource
    name: str
    plan: SharedPlan
    folder: Path
    methods: Mapping[str, StudyMethod] = field(default_factory=lambda: METHODS)

    def estimate(self, method: str, repetition: int) -> Estimate:
        """Train `method`, or take the run that is already there."""
        path = self.path(method, repetition)
        if not path.exists():
            write_atomically(path, self.train(method, repetition))
        return restore(self.methods[method], self._exercise(repetition), load_tensors(path.read_bytes()))

    def train(self, method: str, repetition: int) -> bytes:
        """Train `method`; the content of its file."""
        return save_tensors(self.methods[method].train(self._exercise(repetition)).tensors())

    def _exercise(self, repetition: int) -> Exercise:
        """What every method is given in a repetition."""
        return Exercise(
            self.task,
            self.demonstrate(repetition),
            self.plan.budget,
            TRAINING_SEED + repetition,
            self.demonstrators.truth,
        )

    def demonstrate(self, repetition: int) -> Demonstrations:
        """The demonstrations of a repetition, the same for every method."""
        return self.demonstrators.demonstrate(self.plan.demonstrations, DEMONSTRATION_SEED + repetition)

    @property
    def demonstrators_report(self) -> dict[str, Any]:
        """What the demonstrators are, and the recipe that made them."""
        return self.demonstrators.report | {"recipe": asdict(self.demonstrators.recipe)}

    def marks(
        self,
        methods: Iterable[str],
        repetition: int,
        make_test: Callable[[int], T],
        judge: Callable[[Estimate, T], dict[str, Any]],
        *conditions: Any,
    ) -> dict[str, dict[str, Any]]:
        """Marks of `methods` on one repetition, by name; those given once are kept as files.

        Parameters
        ----------
        make_test
            Gives the repetition's test set; called if marks are missing.
        judge
            Gives an estimate its marks (data for JSON).
        conditions
            Whatever the marks depend on beside the run and this object's test set (data for JSON).
        """
        test = cache(partial(make_test, repetition))

        def mark(method: str) -> dict[str, Any]:
            return judge(self.estimate(method, repetition), test())

        found = {}
        for method in methods:
            run = self.path(method, repetition)
            key = cache_key(run.name, self.plan.test_repeats, self.plan.test_clean, *conditions)
            file = run.with_name(f"{self.name}-{method}-{repetition}-{key}.json")
            found[method] = cached(file, partial(mark, method))
        return found

    def path(self, method: str, repetition: int) -> Path:
        """File of a run; another one as soon as anything about the run has changed."""
        recipe = asdict(self.demonstrators.recipe)
        key = cache_key(self.name, self.settings(method), recipe, self.plan.demonstrations, repetition)
        return self.folder / f"{self.name}-{method}-{repetition}-{key}.safetensors"

    def settings(self, method: str) -> Any:
        """Everything that a method's run depends on, as data for JSON."""
        return self.methods[method].settings(self.task, self.plan.budget)


@dataclass(frozen=True)
class VirtualRuns(Runs):
    """Runs on demonstrators of our own, who also play the test trajectories."""

    task: VirtualTask
    demonstrators: Demonstrators

    def test_set(self, repetition: int) -> TestSet:
        """The test trajectories of a repetition."""
        seed = TEST_SEED + repetition
        return make_test_set(
            self.task, self.demonstrators, seed, self.plan.test_repeats, self.plan.test_clean
        )

    def compare(self, methods: Sequence[str], repetitions: int) -> dict[str, Any]:
        """Every method on every repetition: seeds, scores by method (lists over seeds), tests."""
        scores: dict[str, dict[str, list[Any]]] = {}
        for repetition in range(repetitions):
            append_marks(scores, self.marks(methods, repetition, self.test_set, _judge))
        return {
            "seeds": list(range(repetitions)),
            "demonstrators": self.demonstrators_report,
            "methods": scores,
            "tests": summarise(scores),
        }


def prepare(
    workers: Workers, wanted: Iterable[tuple[Runs, Iterable[str], int]], progress: Callable[[str], None]
) -> None:
    """Train what `Runs.estimate` will be asked for, all of it side by side.

    Parameters
    ----------
    wanted
        Methods and number of repetitions of some runs.
    progress
        Told how many runs are done.
    """
    wanted = list(wanted)
    all_runs = [runs for runs, _, _ in wanted]
    units = [
        Unit(f"{runs.name}, {method}, seed {repetition}", (index, method, repetition))
        for index, (runs, methods, repetitions) in enumerate(wanted)
        for repetition in range(repetitions)
        for method in methods
        if not runs.path(method, repetition).exists()
    ]

    def keep(unit: Unit, content: bytes) -> None:
        index, method, repetition = unit.arguments
        write_atomically(all_runs[index].path(method, repetition), content)

    workers.run(_train, units, keep, all_runs, progress)


def _train(all_runs: Sequence[Runs], index: int, method: str, repetition: int) -> bytes:
    return all_runs[index].train(method, repetition)


def append_marks(scores: dict[str, dict[str, list[Any]]], marks: Mapping[str, Mapping[str, Any]]) -> None:
    """Add one repetition's marks to the lists by method and name."""
    for method, result in marks.items():
        row = scores.setdefault(method, {})
        for name, value in result.items():
            row.setdefault(name, []).append(value)


def _judge(estimate: Estimate, test: TestSet) -> dict[str, Any]:
    return {
        **asdict(evaluate(estimate, test)),
        "task_r_members": [
            None if member.task is None else task_correlation(member.task, test)
            for member in estimate.members
        ],
        "seconds": estimate.seconds,
        "env_steps": estimate.environment_steps,
        "fallen_share": float(test.fallen.mean()),
        "truth_diagonal": test.truth_diagonal,
    }

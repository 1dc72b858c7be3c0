"""The lander study from start to end, resumable; see `shared.runs` for the seeds.

Nothing is tuned here: the methods take the library's default recipe. Test sets are the same for all
repetitions and are kept apart from the runs: other code makes new runs, which are judged on the same sets.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from msrd_ros.cluster.workers import Workers, silent
from msrd_ros.studies.lunar_lander import drawing, environment, test_sets
from msrd_ros.studies.lunar_lander.ceiling import ceilings
from msrd_ros.studies.lunar_lander.demonstrations import LanderDemonstrations, load_demonstrations
from msrd_ros.studies.lunar_lander.evaluation import LanderTest, judge
from msrd_ros.studies.lunar_lander.methods import METHODS
from msrd_ros.studies.lunar_lander.task import LANDER, default_budget
from msrd_ros.studies.lunar_lander.test_sets import SetPlan, TestSet, kept_test_set, make_test_set
from msrd_ros.studies.shared.cache import cache_key, cached
from msrd_ros.studies.shared.method import Budget
from msrd_ros.studies.shared.runs import TEST_SEED, Runs, SharedPlan, append_marks, prepare
from msrd_ros.studies.shared.statistics import diagonal_test, paired_test

SETS = {"A": 21_000, "B": 22_000}
"""Seeds of the test sets by name."""
RIVALS = ("airl", "nearness")
"""Pooled AIRL and the distance to the demonstrations: what inverse learning of strategies has to beat."""
TASK_MARKS = ("task_r", "task_spearman", "middle_r")


@dataclass(frozen=True)
class StudyPlan(SharedPlan):
    """What to run.

    Attributes
    ----------
    methods
        Rows of the table.
    sets
        How each test set is made.
    episodes
        Played by each strategy's policy to judge it.
    taught_steps
        Adam steps of the reward that is taught the truth (`ceiling`).
    """

    budget: Budget = field(default_factory=default_budget)
    demonstrations: int = 3
    methods: tuple[str, ...] = tuple(METHODS)
    sets: SetPlan = field(default_factory=SetPlan)
    episodes: int = 10
    taught_steps: int = 2500

    @classmethod
    def quick(cls) -> StudyPlan:
        """A small version for a first look and for the tests: one seed, a short training, few methods."""
        return cls(
            seeds=1,
            budget=Budget(iterations=1, episodes=1, horizon=150, cloning_steps=60, classifier_steps=200),
            demonstrations=2,
            methods=("msrd", "airl", "classifier", "nearness", "slowness", "potential"),
            sets=SetPlan(30, 2, 1, 2, 1, 1, (0.2, 1.0), 1),
            episodes=1,
            taught_steps=50,
        )

    def runs(self, source: LanderDemonstrations, folder: Path) -> Runs:
        """The runs on these demonstrations, kept in `folder`."""
        return Runs(LANDER, source, LANDER.name, self, folder, METHODS)

    def set_path(self, source: LanderDemonstrations, folder: Path, name: str) -> Path:
        """File of a test set; another one as soon as what defines the set has changed.

        The code that learns does not belong to it: reinforcement learning comes out otherwise after any
        change anywhere, and a method that is changed has to be judged on what it was judged on before.
        Whoever wants the set played anew removes the file.
        """
        code = [Path(module.__file__ or "").read_text() for module in (environment, drawing, test_sets)]
        parts = [asdict(self.sets), asdict(source.recipe), self.demonstrations, SETS[name], code]
        return folder / f"test-set-{name}-{sha256(json.dumps(parts).encode()).hexdigest()[:12]}.npz"

    def test_sets(
        self, source: LanderDemonstrations, folder: Path, progress: Callable[[str], None] = silent
    ) -> dict[str, TestSet]:
        """Both sets, made if they are not there."""
        demonstrations = source.demonstrate(self.demonstrations)
        return {
            name: kept_test_set(
                self.set_path(source, folder, name),
                partial(make_test_set, demonstrations, self.sets, seed, progress),
            )
            for name, seed in SETS.items()
        }


def run_study(
    plan: StudyPlan,
    folder: Path,
    workers: Workers,
    progress: Callable[[str], None],
    data: Path | None = None,
) -> dict[str, Any]:
    """Everything; returns the content of ``metrics.json``.

    Parameters
    ----------
    folder
        Where runs are kept, so that an interrupted study goes on where it was.
    workers
        Who trains.
    data
        Demonstrations; None: those that ship.
    """
    source = load_demonstrations() if data is None else load_demonstrations(data)
    folder.mkdir(parents=True, exist_ok=True)
    sets = plan.test_sets(source, folder, progress)
    runs = plan.runs(source, folder)
    prepare(workers, [(runs, plan.methods, plan.seeds)], progress)
    digests = {name: _digest(found) for name, found in sets.items()}
    ceiling = cached(
        folder / f"ceiling-{cache_key(plan.taught_steps, digests)}.json",
        partial(ceilings, sets, plan.taught_steps, SETS),
    )
    scores: dict[str, dict[str, list[Any]]] = {}
    for repetition in range(plan.seeds):
        make_test = partial(_lander_test, plan, source, sets)
        append_marks(scores, runs.marks(plan.methods, repetition, make_test, judge, plan.episodes, digests))
    return {
        "study": LANDER.name,
        "seeds": list(range(plan.seeds)),
        "methods": scores,
        "ceiling": ceiling,
        "sets": {name: found.describe() for name, found in sets.items()},
        "tests": summarise(scores),
        "demonstrators": runs.demonstrators_report,
        "plan": asdict(plan),
    }


def _lander_test(
    plan: StudyPlan, source: LanderDemonstrations, sets: dict[str, TestSet], repetition: int
) -> LanderTest:
    return LanderTest(sets, source.demonstrate(plan.demonstrations), plan.episodes, TEST_SEED + repetition)


def _digest(test: TestSet) -> str:
    digest = sha256()
    for values in vars(test).values():
        digest.update(np.ascontiguousarray(values).tobytes())
    return digest.hexdigest()[:12]


def summarise(methods: dict[str, dict[str, list[Any]]]) -> dict[str, Any]:
    """MSRD against its rivals: rewards paired by seed, set by set, policies paired by strategy.

    A strategy's return and divergence are first averaged over the seeds; of the divergence less is better.
    """
    tests: dict[str, Any] = {}
    ours = methods.get("msrd")
    if ours is None:
        return tests
    for rival in (name for name in RIVALS if name in methods):
        theirs = methods[rival]
        for set_name in ours["sets"][0]:
            for mark in TASK_MARKS:
                pair = [np.array([found[set_name][mark] for found in one["sets"]]) for one in (ours, theirs)]
                tests[f"{mark}_{set_name}_msrd_over_{rival}"] = paired_test(*pair)
    for rival in (name for name in ("airl", "airl_each") if name in methods):
        for mark, sign in (("returns", 1.0), ("kl", -1.0)):
            pair = [
                sign * np.array([found[mark] for found in one["learned"]]).mean(axis=0)
                for one in (ours, methods[rival])
            ]
            better = {"better_in": int((pair[0] > pair[1]).sum())}
            tests[f"{mark}_msrd_over_{rival}"] = paired_test(*pair) | better
    tests |= {
        f"diagonal_{name}": diagonal_test(round(float(np.median(one["diagonal"]))), len(one["matrix"][0]))
        for name, one in methods.items()
        if one["diagonal"][0] is not None
    }
    return tests

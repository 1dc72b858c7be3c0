"""The inverted pendulum study from start to end, resumable: every run leaves a file that is not run again.

Seeds are kept apart: demonstrations, training, and test trajectories of repetition k are drawn from seeds
2000 + k, 1000 + k and 3000 + k; everything tuned was tuned on seeds from 9000 on.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from hashlib import sha256
from pathlib import Path
from typing import Any

import torch
from safetensors.torch import load as load_tensors
from safetensors.torch import save as save_tensors

from msrd_ros.experiments.inverted_pendulum.demonstrators import (
    Demonstrators,
    Kind,
    cached_demonstrators,
)
from msrd_ros.experiments.inverted_pendulum.evaluation import evaluate, make_test_set
from msrd_ros.experiments.inverted_pendulum.methods import Budget, Estimate, Method, configure, restore, train
from msrd_ros.experiments.inverted_pendulum.statistics import summarise
from msrd_ros.experiments.inverted_pendulum.transfer import TransferPlan, run_transfer
from msrd_ros.learning.checkpoints import write_atomically

TRAINING_SEED, DEMONSTRATION_SEED, TEST_SEED = 1000, 2000, 3000
NON_CIRCULAR_METHODS = (
    Method.MSRD,
    Method.MSRD_AS_PRINTED,
    Method.AIRL,
    Method.AIRL_EACH,
    Method.AIRL_EACH_CROSS,
    Method.CLASSIFIER,
    Method.ORACLE,
)


@dataclass(frozen=True)
class StudyPlan:
    """What to run.

    Attributes
    ----------
    seeds
        Repetitions of the main table.
    other_truth_seeds
        Repetitions with the other demonstrators.
    budget
        What each method may use.
    demonstrations
        Trajectories of each strategy.
    test_repeats, test_clean
        Test trajectories per strategy and noise level, and without noise.
    transfer
        Fresh policies on frozen rewards; None leaves them out.
    kinds
        Demonstrators to study; the first gives the main table.
    """

    seeds: int = 5
    other_truth_seeds: int = 1
    budget: Budget = field(default_factory=Budget)
    demonstrations: int = 20
    test_repeats: int = 2
    test_clean: int = 5
    transfer: TransferPlan | None = field(default_factory=TransferPlan)
    kinds: tuple[Kind, ...] = (Kind.DIAYN, Kind.KNOWN_PREFERENCE)

    @classmethod
    def quick(cls) -> StudyPlan:
        """A small version for a first look and for the tests: one seed, a short training."""
        return cls(
            seeds=1,
            other_truth_seeds=0,
            budget=Budget(sweeps=8, episodes=1, horizon=1000, cloning_steps=200, classifier_steps=400),
            demonstrations=8,
            test_repeats=1,
            test_clean=2,
            transfer=None,
            kinds=(Kind.DIAYN,),
        )


def run_study(plan: StudyPlan, folder: Path, progress: Callable[[str], None]) -> dict[str, Any]:
    """Everything; returns the content of ``metrics.json``.

    Parameters
    ----------
    folder
        Where runs are kept, so that an interrupted study goes on where it was.
    """
    populations: dict[str, Any] = {}
    for kind in plan.kinds:
        demonstrators = cached_demonstrators(kind)
        main = kind is plan.kinds[0]
        repetitions = plan.seeds if main else plan.other_truth_seeds
        methods = tuple(Method) if main else NON_CIRCULAR_METHODS
        scores: dict[str, dict[str, list[Any]]] = {}
        for repetition in range(repetitions):
            for method, result in _repetition(plan, demonstrators, methods, repetition, folder, progress):
                row = scores.setdefault(method.value, {})
                for name, value in result.items():
                    row.setdefault(name, []).append(value)
        populations[kind.value] = {
            "seeds": list(range(repetitions)),
            "demonstrators": demonstrators.report | {"recipe": asdict(demonstrators.recipe)},
            "methods": scores,
            "tests": summarise(scores),
        }
    first = populations[plan.kinds[0].value]
    transfer = {}
    if plan.transfer is not None:
        demonstrators = cached_demonstrators(plan.kinds[0])
        estimates = {
            method: _run(plan, demonstrators, method, 0, folder, progress)
            for method in (Method.MSRD, Method.AIRL_EACH_CROSS, Method.CLASSIFIER)
        }
        key = _key("transfer", asdict(plan.transfer), [_config_of(method, plan) for method in estimates])
        path = folder / f"transfer-{key}.json"
        if path.exists():
            transfer = json.loads(path.read_text())
        else:
            transfer = run_transfer(plan.transfer, demonstrators, estimates, progress)
            write_atomically(path, json.dumps(transfer).encode())
    return {
        "study": "inverted_pendulum",
        "seeds": first["seeds"],
        "methods": first["methods"],
        "tests": first["tests"],
        "transfer": transfer,
        "demonstrators": first["demonstrators"],
        "other_truths": {name: value for name, value in populations.items() if name != plan.kinds[0].value},
        "plan": asdict(plan),
    }


def _repetition(
    plan: StudyPlan,
    demonstrators: Demonstrators,
    methods: tuple[Method, ...],
    repetition: int,
    folder: Path,
    progress: Callable[[str], None],
) -> list[tuple[Method, dict[str, Any]]]:
    """All methods on one repetition's demonstrations and test trajectories."""
    test = make_test_set(demonstrators, TEST_SEED + repetition, plan.test_repeats, plan.test_clean)
    results = []
    for method in methods:
        estimate = _run(plan, demonstrators, method, repetition, folder, progress)
        result = asdict(evaluate(estimate, test))
        result |= {"seconds": estimate.seconds, "env_steps": estimate.environment_steps}
        result["fallen_share"] = float(test.fallen.mean())
        results.append((method, result))
    return results


def _run(
    plan: StudyPlan,
    demonstrators: Demonstrators,
    method: Method,
    repetition: int,
    folder: Path,
    progress: Callable[[str], None],
) -> Estimate:
    """Train `method`, or take the run that is already there."""
    path = _run_path(plan, demonstrators, method, repetition, folder)
    if path.exists():
        return restored(plan, demonstrators, method, repetition, folder)
    progress(f"{demonstrators.recipe.kind}: {method.value}, seed {repetition}")
    data = demonstrators.demonstrate(plan.demonstrations, DEMONSTRATION_SEED + repetition)
    estimate = train(method, data, plan.budget, TRAINING_SEED + repetition, progress)
    write_atomically(path, save_tensors(estimate.tensors()))
    return estimate


def restored(
    plan: StudyPlan, demonstrators: Demonstrators, method: Method, repetition: int, folder: Path
) -> Estimate:
    """A run that was made before."""
    data = demonstrators.demonstrate(plan.demonstrations, DEMONSTRATION_SEED + repetition)
    path = _run_path(plan, demonstrators, method, repetition, folder)
    return restore(load_tensors(path.read_bytes()), method, data, plan.budget)


def _run_path(
    plan: StudyPlan, demonstrators: Demonstrators, method: Method, repetition: int, folder: Path
) -> Path:
    kind = demonstrators.recipe.kind.value
    recipe = asdict(demonstrators.recipe)
    key = _key(kind, _config_of(method, plan), recipe, plan.demonstrations, repetition)
    return folder / f"{kind}-{method.value}-{repetition}-{key}.safetensors"


def _config_of(method: Method, plan: StudyPlan) -> Any:
    if method in (Method.CLASSIFIER, Method.ORACLE):
        return [method.value, plan.budget.classifier_steps]
    return [configure(method, plan.budget).to_dict(), plan.budget.horizon]


def _key(*parts: Any) -> str:
    """Short digest of settings: a run is taken up only if nothing about it has changed."""
    return sha256(json.dumps([*parts, torch.__version__]).encode()).hexdigest()[:12]

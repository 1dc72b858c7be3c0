"""Training runs of the table tennis study, each kept in a folder and not run again."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path

from safetensors.torch import load as load_tensors
from safetensors.torch import save as save_tensors
from torch import Tensor

from msrd_ros.cluster.unit import Unit
from msrd_ros.cluster.workers import Workers
from msrd_ros.core.files import write_atomically
from msrd_ros.studies.shared.cache import cache_key
from msrd_ros.studies.table_tennis.methods import METHODS, Budget, Learned, learn, run_settings
from msrd_ros.studies.table_tennis.recording import Progress, StudyData
from msrd_ros.table_tennis.strokes.policies import StrokePolicies

TRAINING_SEED = 1000
FILES = "policies.safetensors", "rewards.safetensors", "refit_on_replay.safetensors", "training.json"


@dataclass(frozen=True)
class LearnedRuns:
    """Runs of any method and training seed on one set of recordings.

    Attributes
    ----------
    data
        What is learned from.
    budget
        What each method may use.
    root
        Below it each run has its folder.
    """

    data: StudyData
    budget: Budget
    root: Path

    def prepare(self, workers: Workers, wanted: Iterable[tuple[str, int]], progress: Progress) -> None:
        """Learn what `take` will be asked for, side by side, and before it whatever rewards that needs.

        Parameters
        ----------
        wanted
            Methods and seeds; such as learn nothing are passed over.
        """
        rows = [row for row in dict.fromkeys(wanted) if METHODS[row[0]].learns is not None]
        later = [row for row in rows if METHODS[row[0]].frozen_from]
        sources = [(str(METHODS[method].frozen_from), seed) for method, seed in later]
        first = dict.fromkeys([*(row for row in rows if row not in later), *sources])
        self._learn(workers, first, progress)
        self._learn(workers, later, progress)

    def _learn(self, workers: Workers, rows: Iterable[tuple[str, int]], progress: Progress) -> None:
        units = []
        for method, seed in rows:
            if not self._is_there(method, seed):
                source = METHODS[method].frozen_from
                frozen = self.take(source, seed).lasting if source else None
                units.append(Unit(f"{method}, seed {seed}", (method, seed, frozen)))

        def keep(unit: Unit, contents: tuple[bytes, ...]) -> None:
            folder = self.folder(*unit.arguments[:2])
            for name, content in zip(FILES, contents, strict=True):
                write_atomically(folder / name, content)

        workers.run(_learn, units, keep, (self.data, self.budget), progress)

    def take(self, method: str, seed: int) -> Learned:
        """What a method has learned."""
        policies, rewards, lasting, report = (self.folder(method, seed) / name for name in FILES)
        return Learned(
            StrokePolicies.load(policies),
            load_tensors(rewards.read_bytes()),
            load_tensors(lasting.read_bytes()),
            json.loads(report.read_text()),
        )

    def folder(self, method: str, seed: int) -> Path:
        """Where a run is kept: a run is taken up only if nothing about it has changed."""
        names = [method, *filter(None, [METHODS[method].frozen_from])]  # and whose rewards they are
        settings = [run_settings(METHODS[name], self.data, self.budget) for name in names]
        key = cache_key(settings, asdict(self.budget), self.data.digest)
        return self.root / f"{method}-{seed}-{key}"

    def _is_there(self, method: str, seed: int) -> bool:
        folder = self.folder(method, seed)
        return all((folder / name).exists() for name in FILES)


def _learn(
    shared: tuple[StudyData, Budget], method: str, seed: int, frozen: dict[str, Tensor] | None
) -> tuple[bytes, ...]:
    """Contents of a run's files."""
    data, budget = shared
    learned = learn(METHODS[method], data, budget, TRAINING_SEED + seed, frozen)
    rewards, lasting = (
        {name: value.contiguous() for name, value in weights.items()}
        for weights in (learned.rewards, learned.lasting)
    )
    return (
        learned.policies.to_bytes(),
        save_tensors(rewards),
        save_tensors(lasting),
        json.dumps(learned.report).encode(),
    )

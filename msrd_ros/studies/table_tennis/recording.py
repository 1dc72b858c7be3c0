"""The study's data: recorded through simulator, demonstrator and recorder nodes, and parted by subject."""

from __future__ import annotations

import shutil
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from msrd_ros.bags.reader import Bag
from msrd_ros.contract.episode import Episode
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.core.errors import UserError
from msrd_ros.recordings.episodes import read_episodes
from msrd_ros.recordings.library import BagLibrary
from msrd_ros.stack.processes import NodeProcess, own_domain
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS
from msrd_ros.table_tennis.strokes.training import mean_landing_points
from msrd_ros.table_tennis.teachers.study_design import subject_name

Progress = Callable[[str], None]

RECORDING_SEED = 7
"""Of a population that nothing was tuned on."""
_TRIES = 3
_CONNECT_S = 90.0


@dataclass(frozen=True)
class StudyData:
    """Recorded strokes, parted by who showed them.

    Attributes
    ----------
    training, held_out
        Strokes to learn from, and strokes of other subjects that no learner ever sees.
    """

    training: tuple[Episode, ...]
    held_out: tuple[Episode, ...]

    @property
    def landing_points(self) -> dict[StrategyLabel, NDArray[np.float64]]:
        """Where the training strokes landed on average, (2,) in m by label."""
        return mean_landing_points(self.training)

    @property
    def digest(self) -> str:
        """Tells one training set from another, in few letters."""
        text = sha256()
        for episode in self.training:
            text.update(str(episode.label).encode() + episode.observations.tobytes())
        return text.hexdigest()[:12]


def split(episodes: Sequence[Episode], held_out: int) -> StudyData:
    """Part strokes by subject: the last `held_out` subjects by name are kept from training.

    Raises
    ------
    UserError
        If a label or everybody would be missing on one of the sides.
    """
    subjects = sorted({episode.subject for episode in episodes})
    if len(subjects) <= held_out:
        raise UserError(
            f"study: {len(subjects)} subjects are too few to keep {held_out} of them from training; "
            f"record more"
        )
    away = set(subjects[len(subjects) - held_out :])
    data = StudyData(
        tuple(episode for episode in episodes if episode.subject not in away),
        tuple(episode for episode in episodes if episode.subject in away),
    )
    for name, part in (("training", data.training), ("held-out", data.held_out)):
        missing = [str(label) for label in ALL_LABELS if not any(e.label == label for e in part)]
        if missing:
            raise UserError(f"study: no {name} stroke of {', '.join(missing)}; record the whole study")
    return data


def load_episodes(folder: Path, progress: Progress) -> list[Episode]:
    """All kept strokes below a folder, in the order of their paths."""
    episodes: list[Episode] = []
    chosen = BagLibrary.scan(folder, strict=True).select()
    for index, info in enumerate(chosen):
        if index % 30 == 0:
            progress(f"reads bag {index + 1} of {len(chosen)}")
        episodes += read_episodes(Bag(info.path))
    return episodes


def record(folder: Path, logs: Path, subjects: int, recordings: int, progress: Progress) -> None:
    """Record the study into `folder`, or what is missing of it.

    An interrupted recording goes on with the first subject that is not complete.

    Raises
    ------
    UserError
        If a node fails again and again; names it and its log.
    """
    for attempt in range(_TRIES):
        first = first_incomplete(folder, subjects, recordings)
        if first is None:
            return
        for index in range(first, subjects):
            shutil.rmtree(folder / subject_name(index), ignore_errors=True)
        progress(f"records subjects {first + 1} to {subjects}, {6 * recordings} strokes each")
        try:
            _run_nodes(folder, logs, first, subjects - first, recordings)
        except UserError as error:
            if attempt == _TRIES - 1:
                raise
            progress(f"{error}; tries again")


def first_incomplete(folder: Path, subjects: int, recordings: int) -> int | None:
    """Index of the first subject with fewer than `recordings` kept strokes of a label; None if none."""
    counts: Counter[tuple[str, str]] = Counter()
    if folder.is_dir() and any(folder.iterdir()):
        for bag in BagLibrary.scan(folder).bags:
            counts[bag.subject, str(bag.label)] += bag.kept
    for index in range(subjects):
        if any(counts[subject_name(index), str(label)] < recordings for label in ALL_LABELS):
            return index
    return None


def _run_nodes(folder: Path, logs: Path, first: int, subjects: int, recordings: int) -> None:
    from msrd_ros.stack.monitor import Monitor

    environment = own_domain()
    study = {
        "first_subject": first,
        "subjects": subjects,
        "recordings": recordings,
        "seed": RECORDING_SEED,
    }
    with (
        Monitor(environment) as monitor,
        NodeProcess("simulator", {"seed": RECORDING_SEED}, environment, logs / "simulator.log") as simulator,
        NodeProcess("recorder", {"directory": folder}, environment, logs / "recorder.log") as recorder,
    ):
        # A recorder that meets the referee only during the first stroke would wait for its outcome for ever.
        deadline = time.monotonic() + _CONNECT_S
        while "rally/outcome" not in monitor.values("recorder").get("hears", ""):
            simulator.require_alive()
            recorder.require_alive()
            if time.monotonic() > deadline:
                raise UserError(f"study: the recorder does not hear the simulator; see {logs}")
            time.sleep(0.2)
        with NodeProcess("demonstrator", study, environment, None) as demonstrator:
            demonstrator.wait((simulator, recorder))

"""A training run from cloning to the last sweep: curve, TensorBoard, checkpoints and results on disk."""

from __future__ import annotations

import json
import threading
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from msrd_ros.contract.episode import FIRST_ACTING_STEP, Episode
from msrd_ros.core.files import write_atomically, write_text
from msrd_ros.learning.checkpoints import load_checkpoint, save_checkpoint
from msrd_ros.table_tennis.strokes.policies import StrokePolicies
from msrd_ros.table_tennis.strokes.training import POLICIES_FILE, RESULT_FILE, StrokeTraining

CHECKPOINT_FILE = "checkpoint.safetensors"
BOARD_FOLDER = "tensorboard"


@dataclass(frozen=True)
class RunConfig:
    """How often what is done.

    Attributes
    ----------
    out
        Folder for everything that is written.
    rehearse_every, rehearse_balls
        Sweeps between rehearsals, 0 for none, and balls per strategy in each.
    checkpoint_every
        Sweeps between checkpoints; 0 writes one at the end only.
    """

    out: Path
    rehearse_every: int = 10
    rehearse_balls: int = 200
    checkpoint_every: int = 25


class TrainingRun:
    """Drives a `StrokeTraining`; may run on a thread of its own.

    Parameters
    ----------
    training
        What is trained.
    episodes
        The demonstrations, for the strategy matrix.
    config
        How often what is done.
    on_policies
        Called with the policies after cloning and after every rehearsal.
    on_sweep
        Called after every sweep with its figures by name.

    Attributes
    ----------
    stop, checkpoint_wanted
        Set them from any thread: the run ends, or writes a checkpoint, after the present sweep.
    """

    def __init__(
        self,
        training: StrokeTraining,
        episodes: Sequence[Episode],
        config: RunConfig,
        on_policies: Callable[[StrokePolicies], None],
        on_sweep: Callable[[dict[str, float]], None],
    ) -> None:
        self._training, self._episodes, self._config = training, episodes, config
        self._on_policies, self._on_sweep = on_policies, on_sweep
        self.stop = threading.Event()
        self.checkpoint_wanted = threading.Event()
        self._rehearsals = np.random.default_rng((training.config.seed, 1))
        self._metrics: dict[str, float] = {}
        self._curve: list[dict[str, Any]] = []
        self._begun_s = time.monotonic()

    def resume(self) -> int:
        """Go on from the checkpoint in ``out``; returns the sweeps that it had done.

        Raises
        ------
        UserError
            If there is none, or it belongs to another run.
        """
        load_checkpoint(self._config.out / CHECKPOINT_FILE, self._training.trainer)
        result = self._config.out / RESULT_FILE
        if result.is_file():
            self._curve = json.loads(result.read_text())["curve"]
        return self._training.trainer.sweeps_done

    def run(self) -> None:
        """Train until all sweeps are done or `stop` is set; what was learned is on disk then."""
        from torch.utils.tensorboard import SummaryWriter

        training, trainer = self._training, self._training.trainer
        wanted = training.config.sweeps
        with SummaryWriter(str(self._config.out / BOARD_FOLDER)) as board:
            if trainer.sweeps_done == 0:
                trainer.clone()
                self._rehearse(board)
            self._on_policies(training.policies())
            with tqdm(
                total=wanted, initial=trainer.sweeps_done, unit="sweep", desc=training.config.method
            ) as bar:
                while trainer.sweeps_done < wanted and not self.stop.is_set():
                    self._metrics = trainer.sweep()
                    self._follow_up(board)
                    bar.update()
                    if self._curve:
                        bar.set_postfix_str(f"returned {100 * np.mean(self._curve[-1]['returned']):.0f} %")
            self._save()

    def _follow_up(self, board: Any) -> None:
        """What is due after a sweep."""
        config, sweep = self._config, self._training.trainer.sweeps_done
        for name, value in self._metrics.items():
            board.add_scalar(f"training/{name}", value, sweep)
        last = sweep == self._training.config.sweeps
        if config.rehearse_every and (sweep % config.rehearse_every == 0 or last):
            self._rehearse(board)
            self._on_policies(self._training.policies())
        self._on_sweep(self._figures(sweep))
        due = config.checkpoint_every and sweep % config.checkpoint_every == 0
        if self.checkpoint_wanted.is_set() or due:
            self.checkpoint_wanted.clear()
            self._save()

    def _figures(self, sweep: int) -> dict[str, float]:
        passed_s = time.monotonic() - self._begun_s
        wanted = self._training.config.sweeps
        figures = {"sweep": sweep, "of": wanted, "seconds_left": passed_s / sweep * (wanted - sweep)}
        if self._curve:
            rates = zip(self._training.labels, self._curve[-1]["returned"], strict=True)
            figures |= {f"returned_{label}": share for label, share in rates}
        return {**figures, **self._metrics}

    def _rehearse(self, board: Any) -> None:
        if not self._config.rehearse_every:
            return
        struck, returned = self._training.rehearse(self._config.rehearse_balls, self._rehearsals)
        sweep = self._training.trainer.sweeps_done
        seconds = time.monotonic() - self._begun_s
        self._curve.append(
            {"sweep": sweep, "seconds": seconds, "struck": struck.tolist(), "returned": returned.tolist()}
        )
        for label, share in zip(self._training.labels, returned, strict=True):
            board.add_scalar(f"returned/{label}", share, sweep)

    def _save(self) -> None:
        """Write policies, checkpoint and results, each whole or not at all."""
        training, out = self._training, self._config.out
        save_checkpoint(out / CHECKPOINT_FILE, training.trainer, self._metrics)
        write_atomically(out / POLICIES_FILE, training.policies().to_bytes())
        demonstrations = np.stack([e.observations[FIRST_ACTING_STEP:] for e in self._episodes])
        counts = Counter(str(episode.label) for episode in self._episodes)
        result = {
            "labels": [str(label) for label in training.labels],
            "config": asdict(training.config),
            "demonstrations": counts,
            "seconds": time.monotonic() - self._begun_s,
            "sweeps": training.trainer.sweeps_done,
            "curve": self._curve,
            "strategy_rewards": list(training.owners),
            "strategy_matrix": training.strategy_matrix(self._episodes).tolist(),
            "task_reward_of_demonstrations": float(training.rewards_of(demonstrations, 0)[0].mean()),
        }
        write_text(out / RESULT_FILE, json.dumps(result, indent=1) + "\n")

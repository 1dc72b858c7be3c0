"""A training run from cloning to the last iteration: curve, TensorBoard, checkpoints and results on disk."""

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
    evaluate_every, evaluation_balls
        Iterations between evaluations, 0 for none, and balls per strategy in each.
    checkpoint_every
        Iterations between checkpoints; 0 writes one at the end only.
    """

    out: Path
    evaluate_every: int = 10
    evaluation_balls: int = 200
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
        Called with the policies after cloning and after every evaluation.
    on_iteration
        Called after every iteration with its figures by name.

    Attributes
    ----------
    stop, checkpoint_wanted
        Set them from any thread: the run ends, or writes a checkpoint, after the present iteration.
    """

    def __init__(
        self,
        training: StrokeTraining,
        episodes: Sequence[Episode],
        config: RunConfig,
        on_policies: Callable[[StrokePolicies], None],
        on_iteration: Callable[[dict[str, float]], None],
    ) -> None:
        self._training, self._episodes, self._config = training, episodes, config
        self._on_policies, self._on_iteration = on_policies, on_iteration
        self.stop = threading.Event()
        self.checkpoint_wanted = threading.Event()
        self._evaluations = np.random.default_rng((training.config.seed, 1))
        self._metrics: dict[str, float] = {}
        self._curve: list[dict[str, Any]] = []
        self._begun_s = time.monotonic()

    def resume(self) -> int:
        """Go on from the checkpoint in ``out``; returns the iterations that it had done.

        Raises
        ------
        UserError
            If there is none, or it belongs to another run.
        """
        load_checkpoint(self._config.out / CHECKPOINT_FILE, self._training.trainer)
        result = self._config.out / RESULT_FILE
        if result.is_file():
            self._curve = json.loads(result.read_text())["curve"]
        return self._training.trainer.iterations_done

    def run(self) -> None:
        """Train until all iterations are done or `stop` is set; what was learned is on disk then."""
        from torch.utils.tensorboard import SummaryWriter

        training, trainer = self._training, self._training.trainer
        wanted = training.config.iterations
        with SummaryWriter(str(self._config.out / BOARD_FOLDER)) as board:
            if trainer.iterations_done == 0:
                trainer.clone()
                self._evaluate(board)
            self._on_policies(training.policies())
            with tqdm(
                total=wanted, initial=trainer.iterations_done, unit="iteration", desc=training.config.method
            ) as bar:
                while trainer.iterations_done < wanted and not self.stop.is_set():
                    self._metrics = trainer.iterate()
                    self._follow_up(board)
                    bar.update()
                    if self._curve:
                        bar.set_postfix_str(f"returned {100 * np.mean(self._curve[-1]['returned']):.0f} %")
            self._save()

    def _follow_up(self, board: Any) -> None:
        """What is due after an iteration."""
        config, iteration = self._config, self._training.trainer.iterations_done
        for name, value in self._metrics.items():
            board.add_scalar(f"training/{name}", value, iteration)
        last = iteration == self._training.config.iterations
        if config.evaluate_every and (iteration % config.evaluate_every == 0 or last):
            self._evaluate(board)
            self._on_policies(self._training.policies())
        self._on_iteration(self._figures(iteration))
        due = config.checkpoint_every and iteration % config.checkpoint_every == 0
        if self.checkpoint_wanted.is_set() or due:
            self.checkpoint_wanted.clear()
            self._save()

    def _figures(self, iteration: int) -> dict[str, float]:
        passed_s = time.monotonic() - self._begun_s
        wanted = self._training.config.iterations
        figures = {
            "iteration": iteration,
            "of": wanted,
            "seconds_left": passed_s / iteration * (wanted - iteration),
        }
        if self._curve:
            rates = zip(self._training.labels, self._curve[-1]["returned"], strict=True)
            figures |= {f"returned_{label}": share for label, share in rates}
        return {**figures, **self._metrics}

    def _evaluate(self, board: Any) -> None:
        if not self._config.evaluate_every:
            return
        struck, returned = self._training.evaluate(self._config.evaluation_balls, self._evaluations)
        iteration = self._training.trainer.iterations_done
        seconds = time.monotonic() - self._begun_s
        self._curve.append(
            {
                "iteration": iteration,
                "seconds": seconds,
                "struck": struck.tolist(),
                "returned": returned.tolist(),
            }
        )
        for label, share in zip(self._training.labels, returned, strict=True):
            board.add_scalar(f"returned/{label}", share, iteration)

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
            "iterations": training.trainer.iterations_done,
            "curve": self._curve,
            "strategy_rewards": list(training.reward_groups),
            "strategy_matrix": training.strategy_matrix(self._episodes).tolist(),
            "task_reward_of_demonstrations": float(training.rewards_of(demonstrations, 0)[0].mean()),
        }
        write_text(out / RESULT_FILE, json.dumps(result, indent=1) + "\n")

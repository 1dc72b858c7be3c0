"""Trainer node: learns task and strategy rewards and policies from bags, or from bags being played."""

from __future__ import annotations

import json
import threading
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from diagnostic_msgs.msg import DiagnosticArray
from numpy.typing import NDArray
from std_msgs.msg import UInt8MultiArray
from std_srvs.srv import Trigger
from tqdm import tqdm

from msrd_ros.bags.episodes import read_episodes
from msrd_ros.bags.library import BagLibrary
from msrd_ros.bags.reader import Bag
from msrd_ros.experiments.report import write_text
from msrd_ros.experiments.stroke_rollouts import BulletCollector, BulletPlayers
from msrd_ros.experiments.stroke_training import (
    METHODS,
    POLICIES_FILE,
    RESULT_FILE,
    StrokeTraining,
    StrokeTrainingConfig,
)
from msrd_ros.facts.episode import Episode
from msrd_ros.facts.errors import UserError
from msrd_ros.facts.labels import ALL_LABELS, StrategyLabel
from msrd_ros.facts.parameters import parameter
from msrd_ros.facts.resources import shipped_bags
from msrd_ros.learning.checkpoints import load_checkpoint, save_checkpoint, write_atomically
from msrd_ros.learning.rollouts import Collector
from msrd_ros.learning.stroke_policies import StrokePolicies
from msrd_ros.nodes.common import EVENT, LATCHED, Finished, StackNode, run, status, steady_timer
from msrd_ros.nodes.messages import bytes_to_message
from msrd_ros.nodes.played_bags import PlayedBags
from msrd_ros.nodes.topic_rollouts import TopicCollector
from msrd_ros.table_tennis.feeder import SPREADS
from msrd_ros.table_tennis.world import WorldConfig

CHECKPOINT_FILE = "checkpoint.safetensors"


@dataclass(frozen=True)
class TrainerConfig:
    """Parameters of the trainer."""

    source: str = parameter(
        "folder",
        "Where demonstrations come from: a folder of bags, or bags being played onto the topics",
        choices=("folder", "played"),
    )
    bags: str = parameter("", "Folder of bags; empty takes the small set that the package ships")
    labels: list[str] = parameter([], "Strategies to learn; empty takes all that are demonstrated")
    subjects: list[str] = parameter([], "Subjects to learn from; empty takes all")
    wanted: int = parameter(
        9, "played: demonstrations per label after which training starts by itself", low=1, high=10_000
    )
    idle_start_s: float = parameter(
        0.0,
        "played: start with what there is once nothing more has come for so long; 0: wait for all wanted",
        unit="s",
        low=0.0,
        high=3600.0,
    )
    out: str = parameter("runs/strokes", "Folder of policies, checkpoint, curves and TensorBoard events")
    resume: bool = parameter(False, "Go on from the checkpoint in `out`")
    method: str = parameter("msrd", "Learning method", choices=METHODS)
    sweeps: int = parameter(StrokeTrainingConfig.sweeps, "Sweeps over all strategies", low=0, high=100_000)
    episodes: int = parameter(
        StrokeTrainingConfig.episodes, "Rollouts per strategy and sweep", low=1, high=10_000
    )
    corrective_cloning: bool = parameter(
        StrokeTrainingConfig.corrective_cloning,
        "Start from cloning with injected joint offsets and labels that undo them, not from plain cloning",
    )
    seed: int = parameter(0, "Everything random follows from it", low=0)
    spread: str = parameter("standard", "Spread of the feeds trained on", choices=tuple(SPREADS))
    ready_noise_rad: float = parameter(
        StrokeTrainingConfig.ready_noise_rad,
        "Spread of the start posture in training",
        unit="rad",
        low=0.0,
        high=0.2,
    )
    camera_noise_m: float = parameter(
        StrokeTrainingConfig.camera_noise_m,
        "batched: noise of the ball's position in training",
        unit="m",
        low=0.0,
        high=0.1,
    )
    rollouts: str = parameter(
        "batched",
        "Where policies are played: batched simulator, Bullet in workers, or simulator and executor nodes",
        choices=("batched", "bullet", "topics"),
    )
    workers: int = parameter(2, "Threads of the batched simulator, or Bullet processes", low=1, high=256)
    torch_threads: int = parameter(2, "Threads of torch", low=1, high=256)
    rehearse_every: int = parameter(10, "Sweeps between rehearsals (for the curve); 0: none", low=0)
    rehearse_balls: int = parameter(200, "Balls per strategy in a rehearsal", low=1, high=10_000)
    checkpoint_every: int = parameter(25, "Sweeps between checkpoints; 0: only at the end", low=0)
    timeout_s: float = parameter(60.0, "topics: longest wait for one stroke", unit="s", low=1.0, high=3600.0)


class Trainer(StackNode):
    """Gathers demonstrations, then trains on a thread of its own while topics and services stay alive."""

    config: TrainerConfig

    def __init__(self) -> None:
        super().__init__("trainer", TrainerConfig)
        config = self.config
        self._out = _prepare_out(Path(config.out).expanduser())
        self._labels = [StrategyLabel.parse(text, "parameter labels of trainer") for text in config.labels]
        self._episodes: list[Episode] = []
        self._heard_s = time.monotonic()
        self._training: StrokeTraining | None = None
        self._players: BulletPlayers | None = None
        self._thread: threading.Thread | None = None
        self._stop = threading.Event()
        self._checkpoint_wanted = threading.Event()
        self._failure: BaseException | None = None
        self._metrics: dict[str, float] = {}
        self._curve: list[dict[str, Any]] = []
        self._policy = self.create_publisher(UInt8MultiArray, "policy", LATCHED)
        self._progress = self.create_publisher(DiagnosticArray, "training/progress", EVENT)
        self.create_service(Trigger, "~/start", self._on_start)
        self.create_service(Trigger, "~/stop", self._on_stop)
        self.create_service(Trigger, "~/checkpoint", self._on_checkpoint)
        torch.set_num_threads(config.torch_threads)
        self._played: PlayedBags | None = None
        if config.source == "played":
            self._played = PlayedBags(self, self._take, self._refuse)
            self.get_logger().info(f"ready: waiting for {config.wanted} demonstrations of each label")
        else:
            self._read_bags()
            self._begin()
        steady_timer(self, 0.1, self._look_after_training)

    def close(self) -> None:
        """End training after the present sweep, and keep what was learned."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join()
        if self._players is not None:
            self._players.close()

    def diagnose(self) -> tuple[str, dict[str, object]]:
        if self._training is None:
            return "gathering demonstrations", {str(k): n for k, n in self._counts().items()}
        return "training", {"sweep": self._training.trainer.sweeps_done, "of": self.config.sweeps}

    # -- demonstrations ------------------------------------------------------------------------

    def _read_bags(self) -> None:
        folder = Path(self.config.bags).expanduser() if self.config.bags else shipped_bags()
        library = BagLibrary.scan(folder)
        for line in library.refused:
            self.get_logger().warning(f"left out: {line}")
        chosen = library.select(self._labels, self.config.subjects)
        for info in tqdm(chosen, unit="bag", desc="read"):
            self._episodes += read_episodes(Bag(info.path))
        self.get_logger().info(f"{len(self._episodes)} demonstrations from {folder}")

    def _take(self, episode: Episode) -> None:
        if self._training is not None or (self._labels and episode.label not in self._labels):
            return
        self._episodes.append(episode)
        self._heard_s = time.monotonic()
        counts = self._counts()
        fewest = min(counts[label] for label in self._labels or ALL_LABELS)
        self.get_logger().info(
            f"demonstration {len(self._episodes)}: {episode.label}; {fewest} of {self.config.wanted} of each"
        )
        if fewest >= self.config.wanted:
            self._begin()

    def _counts(self) -> Counter[StrategyLabel]:
        return Counter(episode.label for episode in self._episodes)

    def _refuse(self, error: UserError) -> None:
        self.get_logger().error(str(error))

    # -- training ------------------------------------------------------------------------------

    def _begin(self) -> None:
        """Set up training and start its thread."""
        config = self.config
        if self._played is not None:
            self._played.close()
        settings = StrokeTrainingConfig(
            method=config.method,
            sweeps=config.sweeps,
            episodes=config.episodes,
            seed=config.seed,
            spread=config.spread,
            ready_noise_rad=config.ready_noise_rad,
            camera_noise_m=config.camera_noise_m,
            threads=config.workers,
            corrective_cloning=config.corrective_cloning,
        )
        self._training = StrokeTraining(
            self._episodes, mean_landing_points(self._episodes), settings, self._make_collector()
        )
        if config.resume:
            path = self._out / CHECKPOINT_FILE
            load_checkpoint(path, self._training.trainer)
            self._curve = json.loads((self._out / RESULT_FILE).read_text())["curve"]
            self.get_logger().info(f"goes on from {path}, sweep {self._training.trainer.sweeps_done}")
        self._thread = threading.Thread(target=self._train_safely, name="training")
        self._thread.start()

    def _make_collector(self) -> Collector | None:
        config = self.config
        if config.rollouts == "bullet":
            self._players = BulletPlayers(config.workers, WorldConfig(seed=config.seed))
            return BulletCollector(
                self._players, self._present_policies, config.spread, config.ready_noise_rad
            )
        if config.rollouts == "topics":
            return TopicCollector(
                self, self._present_policies, config.spread, config.ready_noise_rad, config.timeout_s
            )
        return None

    def _present_policies(self) -> StrokePolicies:
        assert self._training is not None
        return self._training.policies()

    def _train_safely(self) -> None:
        """Body of the thread: whatever goes wrong reaches the main thread."""
        try:
            self._train()
        except BaseException as error:  # handed on to the main thread, which raises it
            self._failure = error

    def _train(self) -> None:
        from torch.utils.tensorboard import SummaryWriter

        training, config = self._training, self.config
        assert training is not None
        begun_s = time.monotonic()
        rehearsals = np.random.default_rng((config.seed, 1))
        with SummaryWriter(str(self._out / "tensorboard")) as board:
            if training.trainer.sweeps_done == 0:
                training.trainer.clone()
                self._rehearse(training, rehearsals, begun_s, board)
            self._publish_policies(training)
            bar = tqdm(
                total=config.sweeps, initial=training.trainer.sweeps_done, unit="sweep", desc=config.method
            )
            with bar:
                while training.trainer.sweeps_done < config.sweeps and not self._stop.is_set():
                    self._metrics = training.trainer.sweep()
                    self._after_sweep(training, rehearsals, begun_s, board)
                    bar.update()
                    if self._curve:
                        bar.set_postfix_str(f"returned {100 * np.mean(self._curve[-1]['returned']):.0f} %")
            self._save(training, begun_s)

    def _after_sweep(
        self, training: StrokeTraining, rehearsals: np.random.Generator, begun_s: float, board: Any
    ) -> None:
        config, sweep = self.config, training.trainer.sweeps_done
        for name, value in self._metrics.items():
            board.add_scalar(f"training/{name}", value, sweep)
        self._publish_progress(sweep, begun_s)
        if config.rehearse_every and (sweep % config.rehearse_every == 0 or sweep == config.sweeps):
            self._rehearse(training, rehearsals, begun_s, board)
            self._publish_policies(training)
        wanted = self._checkpoint_wanted.is_set()
        if wanted or (config.checkpoint_every and sweep % config.checkpoint_every == 0):
            self._checkpoint_wanted.clear()
            self._save(training, begun_s)

    def _rehearse(
        self, training: StrokeTraining, rng: np.random.Generator, begun_s: float, board: Any
    ) -> None:
        struck, returned = training.rehearse(self.config.rehearse_balls, rng)
        sweep = training.trainer.sweeps_done
        self._curve.append(
            {
                "sweep": sweep,
                "seconds": time.monotonic() - begun_s,
                "struck": struck.tolist(),
                "returned": returned.tolist(),
            }
        )
        for label, share in zip(training.labels, returned, strict=True):
            board.add_scalar(f"returned/{label}", share, sweep)

    def _publish_policies(self, training: StrokeTraining) -> None:
        # Rollouts over topics publish what they play themselves.
        if self.config.rollouts != "topics":
            self._policy.publish(bytes_to_message(training.policies().to_bytes()))

    def _publish_progress(self, sweep: int, begun_s: float) -> None:
        passed = time.monotonic() - begun_s
        left = passed / max(sweep, 1) * (self.config.sweeps - sweep)
        rates = self._curve[-1] if self._curve else {"returned": [], "struck": []}
        values: dict[str, object] = {"sweep": sweep, "of": self.config.sweeps, "seconds_left": left}
        assert self._training is not None
        for label, share in zip(self._training.labels, rates["returned"], strict=False):
            values[f"returned_{label}"] = share
        message = DiagnosticArray(status=[status("trainer", "training", {**values, **self._metrics})])
        message.header.stamp = self.get_clock().now().to_msg()
        self._progress.publish(message)

    def _save(self, training: StrokeTraining, begun_s: float) -> None:
        """Write policies, checkpoint and results, each whole or not at all."""
        save_checkpoint(self._out / CHECKPOINT_FILE, training.trainer, self._metrics)
        write_atomically(self._out / POLICIES_FILE, training.policies().to_bytes())
        observations: NDArray[np.float64] = np.stack([e.observations[1:] for e in self._episodes])
        result = {
            "labels": [str(label) for label in training.labels],
            "config": asdict(training.config),
            "demonstrations": {str(k): n for k, n in self._counts().items()},
            "seconds": time.monotonic() - begun_s,
            "sweeps": training.trainer.sweeps_done,
            "curve": self._curve,
            "strategy_matrix": training.strategy_matrix(self._episodes).tolist(),
            "task_reward_of_demonstrations": float(training.rewards_of(observations, 0)[0].mean()),
        }
        write_text(self._out / RESULT_FILE, json.dumps(result, indent=1) + "\n")

    def _look_after_training(self) -> None:
        """Start when no more demonstrations come; raise what the thread ran into, or finish with it."""
        idle_s = self.config.idle_start_s
        if self._training is None and self._episodes and 0.0 < idle_s < time.monotonic() - self._heard_s:
            self._begin()
        if self._failure is not None:
            raise self._failure
        if self._thread is not None and not self._thread.is_alive():
            print(f"policies written to {self._out / POLICIES_FILE}", flush=True)
            raise Finished(0)

    # -- services ------------------------------------------------------------------------------

    def _on_start(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self._training is not None:
            response.success, response.message = False, "training is under way"
            return response
        if not self._episodes:
            response.success, response.message = False, "no demonstration has arrived yet; play some bags"
            return response
        self._begin()
        response.success, response.message = True, f"training on {len(self._episodes)} demonstrations"
        return response

    def _on_stop(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._stop.set()
        response.success, response.message = True, "training ends after the present sweep and is saved"
        return response

    def _on_checkpoint(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._checkpoint_wanted.set()
        response.success = self._thread is not None
        response.message = f"a checkpoint follows the present sweep, in {self._out}"
        return response


def mean_landing_points(episodes: Sequence[Episode]) -> dict[StrategyLabel, NDArray[np.float64]]:
    """Where returned balls landed on average, (2,) in m, by label; only where that is known."""
    points: dict[StrategyLabel, list[tuple[float, float]]] = {}
    for episode in episodes:
        if episode.outcome is not None and episode.outcome.returned:
            point = episode.outcome.landing_x_m, episode.outcome.landing_y_m
            points.setdefault(episode.label, []).append(point)
    return {label: np.mean(found, axis=0) for label, found in points.items()}


def _prepare_out(out: Path) -> Path:
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(
            f"parameter out of trainer: {out} cannot be written ({error.strerror}); give another"
        ) from None
    return out


def main(argv: list[str] | None = None) -> int:
    """Start the trainer."""
    return run("trainer", Trainer, argv, __doc__)

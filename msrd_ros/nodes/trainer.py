"""Trainer node: learns task and strategy rewards and policies from bags, or from bags being played."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.publisher import Publisher
from std_msgs.msg import UInt8MultiArray
from std_srvs.srv import Trigger

from msrd_ros.bags.reader import Bag
from msrd_ros.cluster.on_ray import ADDRESS_VARIABLE
from msrd_ros.cluster.places import LOCAL, RAY, Place
from msrd_ros.contract.episode import CONTROL_PERIOD_S, Episode
from msrd_ros.contract.labels import StrategyLabel, say_label
from msrd_ros.contract.topics import parse_topic_names
from msrd_ros.core.errors import UserError
from msrd_ros.core.files import write_atomically
from msrd_ros.core.parameters import parameter
from msrd_ros.core.resources import shipped_bags
from msrd_ros.learning.harness import CHECKPOINT_FILE, RESULT_FILE, Schedule
from msrd_ros.learning.learned import Learned
from msrd_ros.learning.rollouts import Collector
from msrd_ros.nodes.common import (
    EVENT,
    LATCHED,
    Finished,
    robot_parameter,
    run,
    status,
    steady_timer,
)
from msrd_ros.nodes.folder_of_bags import read_folder
from msrd_ros.nodes.managed import ManagedNode, autostart_parameter
from msrd_ros.nodes.messages import bytes_to_message
from msrd_ros.nodes.newcomer_service import NewcomerService
from msrd_ros.nodes.played_bags import PlayedBags
from msrd_ros.nodes.topic_rollouts import TopicCollector
from msrd_ros.nodes.training_thread import TrainingThread
from msrd_ros.recordings.episodes import read_episodes
from msrd_ros.robots.loading import load_robot
from msrd_ros.table_tennis.ball.feeder import SPREADS
from msrd_ros.table_tennis.simulation.rally_config import RallyConfig
from msrd_ros.table_tennis.simulation.world import WorldConfig
from msrd_ros.table_tennis.strategies.table import STRATEGIES_HELP, Strategies
from msrd_ros.table_tennis.strokes.aiming import AimingConfig, aim
from msrd_ros.table_tennis.strokes.discovery import (
    STRATEGIES_FILE,
    SortedStrokes,
    describe_recheck,
    sort_strokes,
)
from msrd_ros.table_tennis.strokes.frozen import REWARDS_FILE, Start, Taught, load_taught, transfer
from msrd_ros.table_tennis.strokes.newcomer_session import NewcomerSession
from msrd_ros.table_tennis.strokes.newcomers import StrokeNewcomers
from msrd_ros.table_tennis.strokes.policies import StrokePolicies
from msrd_ros.table_tennis.strokes.rollouts import BulletCollector, BulletPlayers
from msrd_ros.table_tennis.strokes.run import RunTask, training_run
from msrd_ros.table_tennis.strokes.training import (
    METHODS,
    POLICIES_FILE,
    REWARD_GROUPS,
    StrokeTraining,
    StrokeTrainingConfig,
    mean_landing_points,
)

DISCOVER = "discover"
"""As `labels`: strategies are found, and strokes need no label."""
_ANY = "any strategy"


LEARNED_OF = "source", "bags", "topics", "labels", "subjects", "method", "serve", "strategy_rewards"
"""Parameters that say what is learned of; rewards of another run leave nothing of it to say."""


@dataclass(frozen=True)
class TrainerConfig:
    """Parameters of the trainer."""

    source: str = parameter(
        "folder",
        "Where demonstrations come from: a folder of bags, or bags being played onto the topics",
        choices=("folder", "played"),
    )
    bags: str = parameter("", "Folder of bags; empty takes the small set that the package ships")
    topics: list[str] = parameter([], "What topics are called in the bags, as NAME:=NAME_IN_BAG")
    robot: str = robot_parameter()
    labels: list[str] = parameter(
        [],
        f"Strategies to learn; empty takes all that are demonstrated; {DISCOVER} finds them without labels",
    )
    strategies: str = parameter("", STRATEGIES_HELP)
    subjects: list[str] = parameter([], "Subjects to learn from; empty takes all")
    wanted: int = parameter(
        9,
        "played: demonstrations of each of `labels`, or of all listed strategies, that start training; with "
        f"{DISCOVER} of all together",
        low=1,
        high=10_000,
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
    overwrite: bool = parameter(False, "Begin anew in an `out` that holds a run, whose results are lost")
    method: str = parameter("msrd", "Learning method", choices=tuple(METHODS))
    rewards: str = parameter(
        "",
        f"The {REWARDS_FILE} of another run, also of another arm: its strokes are learned from its rewards, "
        "which do not change, and not from bags",
    )
    start: str = parameter(
        Start.RETARGETED.value,
        "rewards: where policies begin: cloned from the paddle's paths on the arm that was taught, by "
        "inverse kinematics, or from nothing",
        choices=tuple(map(str, Start)),
    )
    taught_on: str = parameter(
        "", "rewards: the arm that they were learned on, a name or a folder; empty: the shipped one they name"
    )
    iterations: int = parameter(
        StrokeTrainingConfig.iterations,
        "Iterations over all strategies",
        low=0,
        high=100_000,
        former="sweeps",
    )
    episodes: int = parameter(
        StrokeTrainingConfig.episodes, "Rollouts per strategy and iteration", low=1, high=10_000
    )
    corrective_cloning: bool = parameter(
        StrokeTrainingConfig.corrective_cloning,
        "Start from cloning with injected joint offsets and labels that undo them, which it costs to leave, "
        "not from plain cloning",
    )
    strategy_rewards: str = parameter(
        StrokeTrainingConfig.strategy_rewards,
        "Whose a strategy reward is: every label's own, or shared by both sides of a stroke",
        choices=tuple(REWARD_GROUPS),
    )
    seed: int = parameter(0, "Everything random follows from it", low=0)
    spread: str = parameter(
        StrokeTrainingConfig.spread, "Spread of the feeds trained on", choices=tuple(SPREADS)
    )
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
    camera_latency_s: float = parameter(
        StrokeTrainingConfig.camera_latency_s,
        "batched: longest delay of the ball's position in training, drawn for each rally",
        unit="s",
        low=0.0,
        high=CONTROL_PERIOD_S,
    )
    rollouts: str = parameter(
        "batched",
        "Where policies are played: batched simulator, Bullet in processes or on Ray, or simulator and "
        f"executor nodes; Ray is the cluster that {ADDRESS_VARIABLE} names, else one of this machine alone",
        choices=("batched", "bullet", "ray", "topics"),
    )
    workers: int = parameter(
        2,
        "Threads of the batched simulator, Bullet processes, or processors of a Ray of this machine alone",
        low=1,
        high=256,
    )
    torch_threads: int = parameter(
        1, "Threads of torch; more only make small networks wait for each other", low=1, high=256
    )
    evaluate_every: int = parameter(
        10, "Iterations between evaluations (for the curve); 0: none", low=0, former="rehearse_every"
    )
    evaluation_balls: int = parameter(
        200, "Balls per strategy in an evaluation", low=1, high=10_000, former="rehearse_balls"
    )
    checkpoint_every: int = parameter(25, "Iterations between checkpoints; 0: only at the end", low=0)
    targets: bool = parameter(
        False,
        "In the end teach the policies to land their balls where topic target says, from their own rollouts",
    )
    serve: bool = parameter(
        False,
        "Run on after training: recognise or learn every stroke that the recorder keeps, and publish the "
        "policies",
    )
    timeout_s: float = parameter(60.0, "topics: longest wait for one stroke", unit="s", low=1.0, high=3600.0)
    autostart: bool = autostart_parameter()

    def __post_init__(self) -> None:
        """Refuse what would have no effect."""
        if self.targets and self.serve:
            raise UserError("parameters targets and serve: newcomers take no target; set one of them alone")
        if self.rewards:
            usual = TrainerConfig()
            told = [name for name in LEARNED_OF if getattr(self, name) != getattr(usual, name)]
            if told:
                raise UserError(
                    f"parameters rewards and {', '.join(told)}: with rewards of another run nothing is "
                    "learned from bags; leave out one or the other"
                )
        elif self.start != Start.RETARGETED or self.taught_on:
            raise UserError("parameters start and taught_on are for rewards of another run; give rewards")


class Trainer(ManagedNode):
    """Gathers demonstrations, then trains on a thread of its own while topics and services stay alive.

    Inactive it gathers nothing, and training waits between two iterations. Configured again it goes on from
    the checkpoint of its own run, as there would be nothing to learn for another one.
    """

    config: TrainerConfig

    def __init__(self) -> None:
        self._began = False
        super().__init__("trainer", TrainerConfig)

    def configure(self) -> None:
        """Read bags, or listen to bags being played."""
        config = self.config
        self._robot = load_robot(config.robot)
        self._out = _prepare_out(
            Path(config.out).expanduser(), config.resume or config.overwrite or self._began
        )
        self._discovers = config.labels == [DISCOVER]
        self._labels = [] if self._discovers else _parse_labels(config.labels)
        self._strategies = Strategies.load(config.strategies)
        self._episodes: list[Episode] = []
        self._heard_s = time.monotonic()
        self._training: StrokeTraining | None = None
        self._collector: Collector | None = None
        self._run: TrainingThread | None = None
        self._failure_at_start: UserError | None = None
        self._found: SortedStrokes | None = None
        self._taught: Taught | None = None
        self._agreement = ""
        self._policy = self.create_publisher(UInt8MultiArray, "policy", LATCHED)
        self._progress = self.create_publisher(DiagnosticArray, "training/progress", EVENT)
        self.create_service(Trigger, "~/start", self._on_start)
        self.create_service(Trigger, "~/stop", self._on_stop)
        self.create_service(Trigger, "~/checkpoint", self._on_checkpoint)
        torch.set_num_threads(config.torch_threads)
        self._played: PlayedBags | None = None
        if config.rewards:
            self._taught = load_taught(Path(config.rewards).expanduser(), config.taught_on)
        elif config.source == "played":
            self._played = PlayedBags(self, self._robot, self._take, self._refuse, self._discovers)
            of_each = "" if self._discovers else " of each label"
            self.get_logger().info(f"ready: waiting for {config.wanted} demonstrations{of_each}")
        else:
            folder = Path(config.bags).expanduser() if config.bags else shipped_bags()
            names = parse_topic_names(config.topics, "parameter topics of trainer")
            self._episodes = read_folder(
                folder, self._labels, config.subjects, self._robot, names, self.get_logger(), self._discovers
            )
        self._newcomers = NewcomerService(self, self._send_policies) if config.serve else None
        steady_timer(self, 0.1, self._look_after_training)

    def activate(self) -> None:
        """Train on what lies in the folder, or go on."""
        if self._run is not None:
            self._run.go_on()
        elif self.config.source == "folder":
            self._begin()

    def deactivate(self) -> None:
        """Let training wait after the present iteration, with a checkpoint written."""
        if self._run is not None:
            self._run.pause()

    def waits_for(self) -> list[str]:
        """Demonstrations that are missing while they come over topics, or who plays the policies."""
        if self._newcomers is not None and self._newcomers.serves:
            return self._newcomers.waits_for()
        if self._training is not None:
            awaited = self._collector.awaited if isinstance(self._collector, TopicCollector) else ""
            return [awaited] if awaited else []
        counts = self._counts()
        short = [name for name in self._awaited() if counts[name] < self.config.wanted]
        return [f"demonstrations of {', '.join(short)}: play bags, or call ~/start to train on what there is"]

    def diagnose(self) -> tuple[str, dict[str, object]]:
        """How far gathering or training is."""
        if self._newcomers is not None and self._newcomers.serves:
            return self._newcomers.diagnose()
        if self._training is None:
            return "gathering demonstrations", dict(self._counts())
        return "training", {"iteration": self._training.trainer.iterations_done, "of": self.config.iterations}

    # -- demonstrations ------------------------------------------------------------------------

    def _take(self, episode: Episode) -> None:
        if not self.active or self._training is not None:
            return
        if self._labels and episode.label not in self._labels:
            return
        self._episodes.append(episode)
        self._heard_s = time.monotonic()
        counts = self._counts()
        fewest = min(counts[name] for name in self._awaited())
        self.get_logger().info(
            f"demonstration {len(self._episodes)}: {say_label(episode.label)}; {fewest} of "
            f"{self.config.wanted}{'' if self._discovers else ' of each'}"
        )
        if fewest >= self.config.wanted:
            self._begin()

    def _awaited(self) -> list[str]:
        """Of what there have to be enough demonstrations, by the names of `_counts`."""
        if self._discovers:
            return [_ANY]
        return [str(label) for label in self._labels or self._strategies.labels]

    def _counts(self) -> Counter[str]:
        if self._discovers:
            return Counter({_ANY: len(self._episodes)})
        return Counter(str(episode.strategy) for episode in self._episodes)

    def _refuse(self, error: UserError) -> None:
        self.get_logger().error(str(error))

    # -- training ------------------------------------------------------------------------------

    def _begin(self) -> None:
        """Set up training and start its thread."""
        config = self.config
        if self._played is not None:
            if self._played.lost:
                self.get_logger().warning(
                    f"{self._played.lost} messages of joint_states and ball/position went missing on their "
                    "way, and strokes with them; play more slowly, or train from the folder of bags"
                )
            self._played.close()
        if self._discovers:
            self._sort()
        settings = StrokeTrainingConfig(
            method=config.method,
            iterations=config.iterations,
            episodes=config.episodes,
            seed=config.seed,
            spread=config.spread,
            ready_noise_rad=config.ready_noise_rad,
            camera_noise_m=config.camera_noise_m,
            camera_latency_s=config.camera_latency_s,
            threads=config.workers,
            corrective_cloning=config.corrective_cloning,
            strategy_rewards=config.strategy_rewards,
        )
        self._collector = self._make_collector()
        training = self._make_training(settings)
        task = RunTask(
            training,
            config.evaluation_balls,
            self._episodes,
            self._out,
            self._publish_policies,
            self._publish_progress,
            self._recheck if self._discovers else None,
        )
        self._held.callback(task.close)
        harness = training_run(task, Schedule(config.evaluate_every, config.checkpoint_every, self._out))
        if config.resume or self._began:
            self.get_logger().info(f"goes on from iteration {harness.resume()} of {self._out}")
        self._began = True
        self._training = training
        self._run = TrainingThread(harness, self._learn_targets if config.targets else None)
        self._held.callback(self._run.close)

    def _make_training(self, settings: StrokeTrainingConfig) -> StrokeTraining:
        """A run on demonstrations, or on rewards of another run."""
        if self._taught is None:
            return StrokeTraining(
                self._episodes,
                mean_landing_points(self._episodes),
                settings,
                self._collector,
                self._strategies,
            )
        start = Start(self.config.start)
        run = transfer(self._taught, self._robot, settings, start, self._collector, self._strategies)
        for line in run.account:
            self.get_logger().info(line)
        self._episodes = list(run.episodes)
        return run.training

    def _learn_targets(self, look: Callable[[], None]) -> None:
        """Write and publish policies that take a target, in place of those that take none."""
        config = self.config
        settings = AimingConfig(
            seed=config.seed,
            spread=config.spread,
            ready_noise_rad=config.ready_noise_rad,
            camera_noise_m=config.camera_noise_m,
            threads=config.workers,
        )
        aimed = aim(self._present_policies(), settings, self.get_logger().info, look)
        write_atomically(self._out / POLICIES_FILE, aimed.to_bytes())
        self._publish_policies(aimed)

    def _sort(self) -> None:
        """Find the strategies of what was gathered; a run that goes on finds the same ones."""
        self.get_logger().info(f"finding the strategies of {len(self._episodes)} demonstrations")
        strokes = sort_strokes(self._episodes, self.config.seed)
        for line in strokes.account():
            self.get_logger().info(line)
        strokes.save(self._out)
        self.get_logger().info(f"written to {self._out / STRATEGIES_FILE}")
        self._episodes, self._found = strokes.episodes, strokes

    def _recheck(self, out: Path) -> dict[str, Any]:
        """What policies and rewards of a checkpoint say of the strategies that were found."""
        assert self._found is not None
        assert self._training is not None
        told = self._found.recheck(Learned.load(out / CHECKPOINT_FILE), self._training.demonstrations)
        self._agreement = describe_recheck(told)
        return told

    def _make_collector(self) -> Collector | None:
        config = self.config
        if config.rollouts in ("bullet", RAY):
            place = Place.parse(RAY if config.rollouts == RAY else LOCAL, "parameter rollouts of trainer")
            workers = self._held.enter_context(place.open(config.workers))
            players = BulletPlayers(workers, WorldConfig(RallyConfig(robot=self._robot), seed=config.seed))
            return BulletCollector(players, self._present_policies, config.spread, config.ready_noise_rad)
        if config.rollouts == "topics":
            return TopicCollector(
                self, self._present_policies, config.spread, config.ready_noise_rad, config.timeout_s
            )
        return None

    def _present_policies(self) -> StrokePolicies:
        assert self._training is not None
        return self._training.policies()

    def _publish_policies(self, policies: StrokePolicies) -> None:
        # Rollouts over topics publish what they play themselves.
        if self.config.rollouts != "topics":
            self._send_policies(policies)

    def _send_policies(self, policies: StrokePolicies) -> None:
        self._send(self._policy, bytes_to_message(policies.to_bytes()))

    def _publish_progress(self, figures: dict[str, float]) -> None:
        message = DiagnosticArray(status=[status("trainer", "training", figures)])
        message.header.stamp = self.get_clock().now().to_msg()
        self._send(self._progress, message)

    def _send(self, publisher: Publisher, message: Any) -> None:
        """Publish; after a signal nobody hears it any more, while what was learned has yet to be saved."""
        try:
            publisher.publish(message)
        except rclpy_implementation.RCLError:
            if self.context.ok():
                raise

    def _look_after_training(self) -> None:
        """Start when no more demonstrations come; raise what the thread ran into, or finish with it."""
        idle_s = self.config.idle_start_s
        if not self.active:
            self._heard_s = time.monotonic()
        elif self._training is None and self._episodes and 0.0 < idle_s < time.monotonic() - self._heard_s:
            self._begin()
        failure = self._failure_at_start or (self._run.failure if self._run is not None else None)
        if failure is not None:
            raise failure
        if self._newcomers is not None and self._newcomers.serves:
            if self._newcomers.failure is not None:
                raise self._newcomers.failure
            self._newcomers.report()
        elif self._run is not None and not self._run.is_alive:
            if self._agreement:
                self.get_logger().info(self._agreement)
            print(f"policies written to {self._out / POLICIES_FILE}", flush=True)
            if self._newcomers is None:
                raise Finished(0)
            self._serve(self._newcomers)

    def _serve(self, service: NewcomerService) -> None:
        """Go on with newcomers, from what was trained."""
        assert self._training is not None
        known = StrokeNewcomers.of_training(self._training, self._episodes)
        names = parse_topic_names(self.config.topics, "parameter topics of trainer")

        def read(bag: Path) -> list[Episode]:
            return read_episodes(Bag(bag, names), self._robot, demonstrations_only=True)

        session = NewcomerSession(known, self._out, read)
        self._send_policies(session.policies)
        service.begin(session)
        self._held.callback(service.close)
        self.get_logger().info(
            "training is over; every stroke that the recorder keeps is learned from now on"
        )

    # -- services ------------------------------------------------------------------------------

    def _on_start(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self.refuses(response):
            return response
        if self._training is not None:
            response.success, response.message = False, "training is under way"
            return response
        if not self._episodes:
            response.success, response.message = False, "no demonstration has arrived yet; play some bags"
            return response
        try:
            self._begin()
        except UserError as error:
            # Raised on the main thread once this answer is on its way.
            self._failure_at_start = error
            response.success, response.message = False, str(error)
            return response
        response.success, response.message = True, f"training on {len(self._episodes)} demonstrations"
        return response

    def _on_stop(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        run = self._run_under_way(response)
        if run is not None:
            run.harness.stop.set()
            response.message = "training ends after the present iteration and is saved"
        return response

    def _on_checkpoint(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        run = self._run_under_way(response)
        if run is not None:
            run.harness.checkpoint_wanted.set()
            response.message = f"a checkpoint follows the present iteration, in {self._out}"
        return response

    def _run_under_way(self, response: Trigger.Response) -> TrainingThread | None:
        """The run that a service is about; its response says why there is none."""
        response.success = self._run is not None and self._run.is_alive
        if not response.success:
            response.message = "training has not begun" if self._run is None else "training is over"
            return None
        return self._run


def _parse_labels(texts: Sequence[str]) -> list[StrategyLabel]:
    where = "parameter labels of trainer"
    if DISCOVER in texts:
        raise UserError(f"{where}: {DISCOVER} stands alone, as it finds all strategies; leave out the others")
    return [StrategyLabel.parse(text, where) for text in texts]


def _prepare_out(out: Path, may_hold_run: bool) -> Path:
    held = [name for name in (POLICIES_FILE, CHECKPOINT_FILE, RESULT_FILE) if (out / name).exists()]
    if held and not may_hold_run:
        raise UserError(
            f"parameter out of trainer: {out} holds a run already ({', '.join(held)}); give another folder, "
            f"resume:=true to go on with it, or overwrite:=true to lose it"
        )
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

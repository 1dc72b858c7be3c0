"""Evaluator node: feeds balls to the executor on seeds of its own; reports rates, and what strategies do."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry
from numpy.typing import NDArray
from std_msgs.msg import Header
from tqdm import tqdm
from trajectory_msgs.msg import JointTrajectory

from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.contract.outcome import Outcome
from msrd_ros.contract.translation import read_outcome, stamp_to_ns
from msrd_ros.core.errors import UserError
from msrd_ros.core.formats import write_report
from msrd_ros.core.parameters import parameter
from msrd_ros.nodes.adaptive import hear
from msrd_ros.nodes.common import (
    EVENT,
    LATCHED,
    Finished,
    StackNode,
    referee_hears,
    robot_parameter,
    run,
    steady_timer,
)
from msrd_ros.nodes.messages import feed_to_message, strategy_message
from msrd_ros.nodes.polled import PolledTopic
from msrd_ros.nodes.sources import FORGET_S
from msrd_ros.nodes.speakers import START_UP_S, Speakers
from msrd_ros.nodes.target_teller import TargetTeller
from msrd_ros.robots.loading import load_robot
from msrd_ros.table_tennis.ball.feeder import EVALUATION_STREAM, SPREADS, Feeder
from msrd_ros.table_tennis.strategies.table import (
    DEFAULT_SIDE,
    SIDE_HELP,
    STRATEGIES_HELP,
    Side,
    Strategies,
)
from msrd_ros.table_tennis.strokes.description import Description
from msrd_ros.table_tennis.strokes.policies import StrokeFacts, StrokePolicies
from msrd_ros.table_tennis.strokes.rates import LabelRates, format_table


@dataclass(frozen=True)
class EvaluatorConfig:
    """Parameters of the evaluator."""

    robot: str = robot_parameter()
    labels: list[str] = parameter(
        [], "Strategies to play; empty takes all of the checkpoint, or all that are listed without one"
    )
    strategies: str = parameter("", STRATEGIES_HELP)
    side: str = parameter(DEFAULT_SIDE.value, SIDE_HELP, choices=tuple(Side))
    balls: int = parameter(100, "Balls per strategy", low=1, high=100_000)
    seed: int = parameter(0, "Seed of the feeds", low=0)
    spread: str = parameter("standard", "Spread of the feeds", choices=tuple(SPREADS))
    checkpoint: str = parameter("", "Policy set whose demonstrations' landing points are aimed at")
    targets: bool = parameter(
        False,
        "Tell each ball's stroke another place in reach to land at; needs a checkpoint",
    )
    report: str = parameter("", "JSON file to write; empty: none")
    timeout_s: float = parameter(
        60.0, "How long to wait for simulator, executor and each outcome", unit="s", low=0.5, high=600.0
    )


COMMAND_PERIOD_S = 0.01
PATIENCE_S = 5.0
"""A stroke with all its ways takes less."""


class Evaluator(StackNode):
    """One ball after the other: strategy, feed, outcome."""

    config: EvaluatorConfig

    def __init__(self) -> None:
        super().__init__("evaluator", EvaluatorConfig)
        self._strategies = Strategies.load(self.config.strategies)
        self._facts = self._read_facts()
        labels = self._choose_labels()
        self._balls = [label for label in labels for _ in range(self.config.balls)]
        self._outcomes: dict[StrategyLabel, list[Outcome]] = {label: [] for label in labels}
        self._rng = np.random.default_rng((EVALUATION_STREAM, self.config.seed))
        self._index = 0
        self._connected = False
        self._waiting_for = "command"
        self._since_s = time.monotonic()
        self._begun_s = self._commanded_s = time.monotonic()
        self._strategy = self.create_publisher(Header, "strategy", LATCHED)
        self._feed = self.create_publisher(Odometry, "feed", EVENT)
        self._teller: TargetTeller | None = None
        if self.config.targets:
            self._teller = TargetTeller(self, labels, self._facts, self.config.seed)
        hear(self, DiagnosticArray, "rally/outcome", self._on_outcome, EVENT)
        # Only whose it is counts, and one a tick: to take each would slow down those who answer the ticks.
        self._command = PolledTopic(self, JointTrajectory, "joint_command")
        steady_timer(self, COMMAND_PERIOD_S, self._look_at_command)
        self._speakers = Speakers(self)
        self._doubtful_since_s: float | None = None
        self._outcome_ns = 0
        self._progress = tqdm(total=len(self._balls), unit="ball", desc="evaluate", smoothing=0.05)
        steady_timer(self, 0.5, self._watch)
        self._ask()

    def close(self) -> None:
        """Leave the terminal tidy."""
        self._progress.close()

    def diagnose(self) -> tuple[str, dict[str, object]]:
        """How many balls are fed and returned."""
        returned = sum(outcome.returned for outcomes in self._outcomes.values() for outcome in outcomes)
        return "playing", {"balls": self._index, "of": len(self._balls), "returned": returned}

    def waits_for(self) -> list[str]:
        """Whose answer is due for longer than an answer takes."""
        if time.monotonic() - self._since_s < PATIENCE_S:
            return []
        if self._waiting_for == "outcome":
            return ["rally/outcome of the ball that was fed: look after simulator and executor"]
        if not self.count_publishers("rally/outcome"):
            return ["rally/outcome: start a simulator"]
        return [f"a joint_command for {self._label}: start an executor with policies for it"]

    def _read_facts(self) -> Mapping[StrategyLabel, StrokeFacts]:
        """What the checkpoint tells of its strategies; nothing without one."""
        if not self.config.checkpoint:
            return {}
        return StrokePolicies.load(Path(self.config.checkpoint), load_robot(self.config.robot)).facts

    def _choose_labels(self) -> Sequence[StrategyLabel]:
        where = "parameter labels of evaluator"
        labels = [StrategyLabel.parse(text, where) for text in self.config.labels]
        for label in labels:
            if self._facts and label not in self._facts:
                known = ", ".join(self._facts)
                raise UserError(f"{where}: no policy for strategy {label}; the checkpoint has {known}")
        return labels or tuple(self._facts) or self._strategies.labels

    def _side(self, label: StrategyLabel) -> Side:
        if label in self._facts:
            return self._facts[label].side
        return self._strategies.of(label).side or Side(self.config.side)

    @property
    def _label(self) -> StrategyLabel:
        return self._balls[self._index]

    def _ask(self) -> None:
        self._strategy.publish(strategy_message(self._label, self.get_clock().now().to_msg()))
        if self._teller is not None:
            self._teller.tell(self._label)
        self._waiting_for, self._since_s = "command", time.monotonic()

    def _look_at_command(self) -> None:
        newest = self._command.take()
        if not newest:
            return
        self._commanded_s = time.monotonic()
        # The executor serves the strategy; the simulator launches once the arm rests in its ready pose.
        if self._waiting_for != "command" or newest[-1].header.frame_id != str(self._label):
            return
        if not self._connected:
            self._connected = referee_hears(self, self._feed)
            return
        if not self._measures_one():
            self._since_s = time.monotonic()  # the executor has answered; it is not what is waited for
            return
        if self._teller is not None and not self._teller.is_heard:
            return
        feed = Feeder().sample(self._side(self._label), SPREADS[self.config.spread], self._rng)
        self._feed.publish(feed_to_message(feed))
        self._waiting_for, self._since_s = "outcome", time.monotonic()

    def _on_outcome(self, message: DiagnosticArray) -> None:
        if self._waiting_for != "outcome":
            return
        try:
            label, outcome = read_outcome(message)
        except UserError as error:
            self.complain(error)
            return
        stamp_ns = stamp_to_ns(message.header.stamp)
        if stamp_ns < self._outcome_ns:
            raise UserError(
                "time went back: the simulator was started again, and nothing is reported of two worlds; "
                "start the evaluator anew"
            )
        self._outcome_ns = stamp_ns
        if label != self._label:
            return
        self._outcomes[self._label].append(outcome)
        self._index += 1
        self._progress.update()
        row = self._outcomes[label]
        self._progress.set_postfix_str(f"{label} {sum(o.returned for o in row)}/{len(row)} returned")
        if self._index == len(self._balls):
            self._finish()
        else:
            self._ask()

    def _measures_one(self) -> bool:
        """Whether one simulator alone tells what became of a ball; a killed one is waited out.

        Nothing is certain before others have had the time to be found.

        Raises
        ------
        UserError
            If two are alive; names them.
        """
        if len(self._speakers.publishers("rally/outcome")) < 2:
            self._doubtful_since_s = None
            return time.monotonic() - self._begun_s > START_UP_S
        several = self._speakers.side_by_side("rally/outcome")
        if several:
            raise UserError(
                f"{len(several)} nodes decide rallies on {self.resolve_topic_name('rally/outcome')} "
                f"({', '.join(several)}); nothing is measured of two worlds at once: end all but one"
            )
        now_s = time.monotonic()
        if self._doubtful_since_s is None:
            self._doubtful_since_s = now_s
        return now_s - self._doubtful_since_s > 2 * FORGET_S

    def _watch(self) -> None:
        if self._waiting_for == "report":
            self._finish()
        self._measures_one()
        if time.monotonic() - self._since_s < self.config.timeout_s:
            return
        if self._waiting_for == "outcome":
            raise UserError(
                f"no rally/outcome for ball {self._index} ({self._label}) in {self.config.timeout_s:g} s; "
                f"check that simulator and executor still run"
            )
        if not self.count_publishers("rally/outcome"):
            raise UserError(
                f"no simulator on domain {self._domain()}: nobody publishes rally/outcome; "
                f"start it, or set the same ROS_DOMAIN_ID"
            )
        if not self.count_publishers("joint_command"):
            raise UserError("no executor: nobody publishes joint_command; start one with a checkpoint")
        silent_s = time.monotonic() - self._commanded_s
        if silent_s > 0.5 * self.config.timeout_s:
            raise UserError(
                f"no joint_command in {silent_s:.0f} s; check that simulator and executor still run"
            )
        raise UserError(
            f"the executor does not take up strategy {self._label}; check its checkpoint and its log"
        )

    def _aimed_at(self, label: StrategyLabel) -> NDArray[np.float64] | None:
        """Where balls were to land: each its own place, or all the same."""
        if self._teller is not None and label in self._teller.targets:
            return np.array(self._teller.targets[label])
        return self._facts[label].landing_point if label in self._facts else None

    def _domain(self) -> int:
        return int(self.context.get_domain_id())

    def _finish(self) -> None:
        if not self._measures_one():
            self._waiting_for, self._since_s = "report", time.monotonic()
            return
        self._progress.close()
        if self._teller is not None:
            self._teller.take_back()
        rates = {
            str(label): LabelRates.of(label, outcomes, self._aimed_at(label), self._strategies)
            for label, outcomes in self._outcomes.items()
        }
        described = {
            str(label): Description.of(self._side(label), outcomes)
            for label, outcomes in self._outcomes.items()
        }
        print(format_table(rates))
        for label, description in described.items():
            print(f"{label}: {description}", flush=True)
        if self.config.report:
            report = {
                "seed": self.config.seed,
                "spread": self.config.spread,
                "seconds": time.monotonic() - self._begun_s,
                "labels": {
                    label: {**row.to_json(), "description": described[label].to_json()}
                    for label, row in rates.items()
                },
            }
            path = Path(self.config.report).expanduser()
            write_report(path, report)
            print(f"written to {path}", flush=True)
        raise Finished(0)


def main(argv: list[str] | None = None) -> int:
    """Start the evaluator."""
    return run("evaluator", Evaluator, argv, __doc__)

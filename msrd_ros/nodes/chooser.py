"""Chooser node: names an arm's next strategy in a rally from where the ball comes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from std_msgs.msg import Header

from msrd_ros.core.parameters import parameter
from msrd_ros.nodes.common import LATCHED, StackNode, robot_parameter, run
from msrd_ros.nodes.messages import strategy_message
from msrd_ros.nodes.tick_inputs import TickInput, TickInputs
from msrd_ros.robots.loading import load_robot
from msrd_ros.table_tennis.strokes.chooser import StrategyChooser
from msrd_ros.table_tennis.strokes.policies import StrokePolicies, rally_policies

CHOOSER_STREAM = 0xC400


@dataclass(frozen=True)
class ChooserConfig:
    """Parameters of the chooser."""

    checkpoint: str = parameter(
        "",
        "Policies whose strategies it names, as the executor plays them; empty: those that come with the arm",
    )
    robot: str = robot_parameter()
    seed: int = parameter(0, "Seed of the strategy with which the arm waits for the first ball", low=0)


class Chooser(StackNode):
    """Listens to one arm and its ball, and publishes on `strategy` whenever another one is wanted."""

    config: ChooserConfig

    def __init__(self) -> None:
        super().__init__("chooser", ChooserConfig)
        robot, given = load_robot(self.config.robot), self.config.checkpoint
        policies = StrokePolicies.load(Path(given), robot) if given else rally_policies(robot)
        rng = np.random.default_rng((CHOOSER_STREAM, self.config.seed))
        self._chooser = StrategyChooser(robot, policies.facts, rng)
        self._changes = 0
        self._strategy = self.create_publisher(Header, "strategy", LATCHED)
        self._inputs = TickInputs(self, robot, True, self._see, lambda: None, self.complain)
        self._publish()
        self.get_logger().info(f"ready: names one of {', '.join(policies.labels)}")

    def diagnose(self) -> tuple[str, dict[str, object]]:
        """What it names."""
        return f"names {self._chooser.chosen}", {"strategy": self._chooser.chosen, "changes": self._changes}

    def waits_for(self) -> list[str]:
        """What it does not hear."""
        return self._inputs.missing

    def _see(self, tick: TickInput) -> None:
        if self._chooser.see(tick.time_ns, tick.joint_position, tick.ball_position, tick.ball_stamp_ns):
            self._changes += 1
            self._publish()

    def _publish(self) -> None:
        self._strategy.publish(strategy_message(self._chooser.chosen, self.get_clock().now().to_msg()))


def main(argv: list[str] | None = None) -> int:
    """Start the chooser."""
    return run("chooser", Chooser, argv, __doc__)

"""How well strokes land where they are told, and whether they stay the strokes that they were.

Run from the repository: ``python benchmarks/targets.py POLICIES [--before POLICIES] [--rewards CHECKPOINT]``.

For every stroke, of a grid of 5 x 5 targets, x from .30 to 1.20 m beyond the net and y from -.55 to .55 m:
how many are in reach, and of all balls to those the shares that land within 20 and 30 cm, balls that are not
returned counting as outside. Then the same without a target, about the teacher's mean landing point. Feeds
are standard and on seeds that neither learning nor the reach draws from; in the batched simulator, whose arm
follows its commands exactly, or with ``--bullet`` in Bullet.

``--before`` plays policies as they were before they learned targets beside them, without a target.
``--rewards``: a stroke's label is that of the strategy reward which is highest along it, each reward measured
by its mean and deviation on the strokes of ``--before``. Shares of strokes that have their own label: of
those before, without a target, and with.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from msrd_ros.contract.episode import ACTING_STEPS
from msrd_ros.core.errors import UserError
from msrd_ros.learning.checkpoints import read_rewards
from msrd_ros.learning.rewards import RewardModel
from msrd_ros.learning.trajectories import Transitions
from msrd_ros.robots.default import DEFAULT_ROBOT
from msrd_ros.robots.loading import load_robot
from msrd_ros.table_tennis.ball.feeder import EVALUATION_STREAM, SPREADS, Feeder
from msrd_ros.table_tennis.simulation.batched import RallyVariation
from msrd_ros.table_tennis.simulation.rally_config import RallyConfig
from msrd_ros.table_tennis.simulation.world import World, WorldConfig
from msrd_ros.table_tennis.strategies.table import Strategies
from msrd_ros.table_tennis.strokes.aiming import ABOUT_M, NEAR_M
from msrd_ros.table_tennis.strokes.batched_play import play_batch
from msrd_ros.table_tennis.strokes.paddle_columns import PaddleColumns
from msrd_ros.table_tennis.strokes.policies import StrokeDraws, StrokePolicies, stroke_layout
from msrd_ros.table_tennis.strokes.rollouts import play_in_world

Array = NDArray[np.float64]

GRID = np.array([(x, y) for x in np.linspace(0.30, 1.20, 5) for y in np.linspace(-0.55, 0.55, 5)])
READY_NOISE_RAD = 0.03


class Balls(NamedTuple):
    """What became of balls.

    Attributes
    ----------
    landing
        Where they landed, (S, K, 2) in m; NaN where none came back.
    spin
        About y, (S, K) in rad/s.
    seen
        Observations, (S, K, T + 1, N + 6); empty where nobody kept them.
    """

    landing: Array
    spin: Array
    seen: NDArray[np.float32]

    @property
    def returned(self) -> NDArray[np.bool_]:
        """Which came back, (S, K)."""
        return np.isfinite(self.landing[..., 0])

    def near(self, targets: Array, distance_m: float) -> NDArray[np.bool_]:
        """Which landed so near to their targets (S, K, 2)."""
        apart = np.linalg.norm(self.landing - targets, axis=-1)
        near: NDArray[np.bool_] = np.nan_to_num(apart, nan=np.inf) <= distance_m
        return near


def play_batched(policies: StrokePolicies, targets: Array, seed: int) -> Balls:
    """Play in the batched simulator, targets (S, K, 2)."""
    rng = np.random.default_rng((EVALUATION_STREAM, seed))
    results, seen = play_batch(policies, targets, RallyVariation(ready_std_rad=READY_NOISE_RAD), rng)
    landing = np.where(results.returned[..., None], results.landing, np.nan)
    return Balls(landing, results.spin[..., 1], seen)


def play_in_bullet(policies: StrokePolicies, targets: Array, seed: int) -> Balls:
    """Play in Bullet, in this process."""
    world = World(WorldConfig(RallyConfig(robot=policies.robot), seed=seed))
    rng, feeder = np.random.default_rng((EVALUATION_STREAM, seed)), Feeder()
    landing, spin = np.full(targets.shape, np.nan), np.full(targets.shape[:2], np.nan)
    for row, (label, facts) in enumerate(policies.facts.items()):
        for column, target in enumerate(targets[row]):
            draws = StrokeDraws.of(seed, column, policies.robot.joint_count)
            policy = policies.play(label, draws, target if policies.takes_target else None)
            pose = facts.ready_pose + READY_NOISE_RAD * draws.ready
            feed = feeder.sample(facts.side, SPREADS["standard"], rng)
            _, outcome = play_in_world(world, label, policy, pose, feed, column)
            if outcome.returned:
                landing[row, column] = outcome.landing_x_m, outcome.landing_y_m
                spin[row, column] = outcome.spin_y_rad_s
    world.close()
    return Balls(landing, spin, np.empty(0, np.float32))


def strategy_rewards(model: RewardModel, seen: NDArray[np.float32]) -> Array:
    """Every S_i, averaged along strokes (S, K, T + 1, O): (S, S, K), the reward first."""
    strategies, count, states, _ = seen.shape
    means = np.empty((strategies, strategies, count))
    for row in range(strategies):
        stacked = torch.as_tensor(seen[row])[None].expand(strategies, -1, -1, -1)
        actions = torch.zeros(strategies, count, ACTING_STEPS, 1)
        with torch.no_grad():
            values = model(Transitions.of(stacked, actions)).strategy
        means[:, row] = values.reshape(strategies, count, states - 1).mean(dim=2).numpy()
    return means


def label_rates(rewards: Array, measure: Array) -> Array:
    """Shares of the strokes whose own reward is the highest, (S,), in units of `measure` (S, S, K)."""
    flat = measure.reshape(len(measure), -1)
    scaled = (rewards - flat.mean(axis=1)[:, None, None]) / flat.std(axis=1)[:, None, None]
    return np.array([(scaled[:, row].argmax(axis=0) == row).mean() for row in range(len(rewards))])


def main() -> int:
    """Play, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("policies", type=Path, help="policies that take a target")
    parser.add_argument("--robot", default=DEFAULT_ROBOT)
    parser.add_argument(
        "--balls", type=int, default=40, help="to each target; without a target ten times as many"
    )
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--bullet", action="store_true")
    parser.add_argument("--before", type=Path, help="the policies before they learned targets")
    parser.add_argument("--rewards", type=Path, help="checkpoint of the training; needs --before")
    options = parser.parse_args()
    if options.rewards and (options.bullet or not options.before):
        raise UserError("--rewards needs --before, and not --bullet")
    torch.set_num_threads(1)
    robot = load_robot(options.robot)
    policies = StrokePolicies.load(options.policies, robot)
    play = play_in_bullet if options.bullet else play_batched
    shape = len(policies.facts), 1, 1
    targets = np.tile(np.repeat(GRID, options.balls, axis=0), shape)
    home = np.array([facts.landing_point for facts in policies.facts.values()])
    home = np.repeat(home[:, None], 10 * options.balls, axis=1)
    told, untold = play(policies, targets, options.seed), play(policies, home, options.seed + 1)
    before = None
    if options.before:
        before = play(StrokePolicies.load(options.before, robot), home, options.seed + 1)
    own: list[Array] = []
    if options.rewards and before is not None:
        model = read_rewards(options.rewards)
        assert model is not None, "no rewards in the checkpoint"
        model = model.on(stroke_layout(robot).observation_names, PaddleColumns(robot))
        values = [strategy_rewards(model, balls.seen) for balls in (before, untold, told)]
        own = [label_rates(one, values[0]) for one in values]
    print(
        f"{'strategy':<18}{'reach':>6}{'20 cm':>8}{'30 cm':>8} | {'no target: 20 cm':>17}{'30 cm':>7}"
        f"{'returned':>9} | {'before: 20 cm':>14}{'returned':>9} | spin right | own reward"
    )
    strategies = Strategies.shipped()
    for row, (label, facts) in enumerate(policies.facts.items()):
        reach = facts.reach
        if reach is None:
            raise UserError(
                f"{options.policies}: takes no target; learn targets with `python -m msrd_ros aim`"
            )
        inside = np.array([reach.holds(point) for point in GRID])
        judged = np.repeat(inside, options.balls)
        back = told.returned[row] & judged
        spin = np.mean([bool(strategies.spin_is_right(label, one)) for one in told.spin[row, back]])
        shares = [told.near(targets, distance)[row, judged].mean() for distance in (NEAR_M, ABOUT_M)]
        without = [untold.near(home, distance)[row].mean() for distance in (NEAR_M, ABOUT_M)]
        line = f"{label:<18}{inside.sum():>6}{shares[0]:>8.1%}{shares[1]:>8.1%} | {without[0]:>17.1%}"
        line += f"{without[1]:>7.1%}{untold.returned[row].mean():>9.1%} | "
        if before is not None:
            line += f"{before.near(home, NEAR_M)[row].mean():>14.1%}{before.returned[row].mean():>9.1%}"
        print(line + f" | {spin:>10.1%} | " + ", ".join(f"{rates[row]:.1%}" for rates in own))
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except UserError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)

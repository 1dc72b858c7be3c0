"""The default recipe: what our studies found necessary, for any task with continuous actions."""

from __future__ import annotations

from msrd_ros.learning.cloning import CloningConfig
from msrd_ros.learning.config import (
    DiscriminatorConfig,
    MSRDConfig,
    PolicyConfig,
    PolicyReward,
    ReplayConfig,
    RewardConfig,
)
from msrd_ros.learning.trpo import TrustRegionConfig
from msrd_ros.learning.value import ValueConfig


def default_config(restarts: bool = True) -> MSRDConfig:
    """Settings for a new task; change single values with `dataclasses.replace`.

    Actions are in units of their range: standard deviations are shares of half of it.

    Parameters
    ----------
    restarts
        Whether some bad examples are played where an episode that ended starts again; environments of
        Gymnasium can.
    """
    return MSRDConfig(
        iterations=40,
        episodes=4,
        # Entropy by the objective itself: a policy that is sure of itself leaves the discriminator nothing.
        policy_reward=PolicyReward.LOGIT,
        # Where neither demonstrations nor rollouts go R0 would be whatever its network makes up: without this
        # and displaced negatives it is worth less than a distance to the demonstrations.
        reward=RewardConfig(hidden=(32, 32), nearness=1.0),
        discriminator=DiscriminatorConfig(
            batch=256,
            learning_rate=2e-3,
            # S_i is kept small so that R0 explains what it can: r goes with it (.84, .86, .87 at .05, .2,
            # .5), the order of what neither fails nor succeeds against it (.83, .83, .81;
            # benchmarks/recipe.py). R0 costs something as well, or it falls without end where generators
            # pile up and demonstrations never go.
            penalty_weight=0.2,
            task_penalty_weight=0.05,
            # Without cross-negatives nothing tells S_i what the other strategies look like. Of the task they
            # say nothing: where they reached R0 as well, R0 of the shipped landings correlated less with the
            # true return of noisy ones (two tuning seeds: .69 and .63 for .80 and .87), and without many bad
            # examples of all kinds still less (.46).
            cross_weight=1.0,
            cross_batch=256,
            cross_reaches_task=False,
            gradient_penalty=0.02,
            task_gradient_penalty=0.02,
            # An episode that has ended is judged by its place alone: both kinds of step meet at one level.
            centre_log_prob=True,
            log_prob_bounds=(-10.0, 10.0),
        ),
        # Generators that start near the demonstrators stay there: only bad examples, from nearly right to
        # hopeless, show what R0 is about, and once nobody fails any more R0 would forget them.
        replay=ReplayConfig(keep=512, replay_share=0.15, snapshot_share=0.6, displaced_share=0.4),
        policy=PolicyConfig(hidden=(64, 64), std=0.2, std_min=0.05, std_max=0.3),
        # Policies that run ahead of the rewards lose the contrast with the demonstrations.
        trust_region=TrustRegionConfig(kl=0.01, kl_end=0.2),
        value=ValueConfig(hidden=(64, 64), steps=20, sees_time=False, bootstrap=True),
        cloning=CloningConfig(
            steps=1500,
            batch=256,
            snapshots=(0, 40, 160, 320),
            noise_levels=(0.6, 1.0, 1.5, 2.0),
            # Pure chance soon ends its episode; only where it starts again is more seen of it than the end.
            restarts=(3.0, 3.0) if restarts else (),
            snapshot_episodes=2,
        ),
    )

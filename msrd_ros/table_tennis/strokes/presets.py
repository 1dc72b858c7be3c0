"""The strokes' recipe, plain and started from cloning with recovery labels."""

from __future__ import annotations

from dataclasses import replace

from msrd_ros.learning.cloning import CloningConfig
from msrd_ros.learning.config import (
    DiscriminatorConfig,
    FeatureConfig,
    MSRDConfig,
    PolicyConfig,
    PolicyReward,
    ReplayConfig,
    RewardConfig,
)
from msrd_ros.learning.trpo import TrustRegionConfig
from msrd_ros.learning.value import ValueConfig


def table_tennis(ball_names: tuple[str, ...], paddle_names: tuple[str, ...]) -> MSRDConfig:
    """Table tennis strokes: R0 sees the ball, S_i the ball and the paddle; the arm holds after the stroke.

    Measured on six labels with 12 demonstrations each; the policies start from plain behaviour cloning.

    Parameters
    ----------
    ball_names, paddle_names
        Columns of the ball and of the paddle; neither says anything of an arm.
    """
    return MSRDConfig(
        iterations=80,
        episodes=200,
        discount=0.995,
        gae_decay=0.97,
        policy_reward=PolicyReward.REWARD,
        reward=RewardConfig(
            task_features=FeatureConfig(names=ball_names),
            strategy_features=FeatureConfig(names=ball_names + paddle_names),
        ),
        discriminator=DiscriminatorConfig(
            # The rewards must learn faster than the policies, or both chase each other: with half the steps
            # and half the rate, strokes that had reached 100 % fell to 50 and came back 30 iterations later.
            steps=20,
            first_steps=200,
            batch=512,
            learning_rate=1e-3,
            # A strategy reward that sees the joints soon tells demonstrations from rollouts by trifles: at
            # .01 and without slope penalty it outweighed R0 sixfold and drew good strokes off the table.
            penalty_weight=0.1,
            gradient_penalty=0.005,
            # Six labels: two of the five others are strokes of the same side, which are the hard ones. At .3
            # and with a slope penalty of .02, push and slice of unseen subjects came out level.
            cross_weight=1.0,
            cross_batch=256,
            cross_demonstrations=1.0,
            centre_log_prob=True,
            log_prob_bounds=(-10.0, 10.0),
        ),
        # Half of the negatives are old: once nobody misses any more, R0 would forget what a miss is.
        replay=ReplayConfig(keep=2048, iterations=100, replay_share=0.25, snapshot_share=0.25),
        # At .03 training takes more than twice as long, for the same KL moves the mean half as far.
        policy=PolicyConfig(hidden=(64, 64), std=0.07, std_min=0.01, std_max=0.08),
        # More damping shortens the steps (at .1 to half the KL); late steps only wander, so they get short.
        # Ten conjugate gradient steps on a fifth of the samples leave the direction so far from the natural
        # gradient that training takes four times as many iterations.
        trust_region=TrustRegionConfig(
            kl=0.04, kl_end=0.1, damping=0.01, cg_iterations=25, fisher_fraction=0.3
        ),
        # With 20 steps most of the returns stay unexplained and the advantages are mostly noise, which is
        # what limits the pace here (twice the KL does not help): 200 steps halve the number of iterations.
        value=ValueConfig(hidden=(64, 64), steps=200, sees_time=True, bootstrap=False),
        # Longer plain cloning fits twelve demonstrations better and the worst stroke less well.
        cloning=CloningConfig(
            steps=500, batch=512, snapshots=(0, 20, 40, 80, 160, 320), snapshot_episodes=20
        ),
    )


def with_recovery_labels(
    config: MSRDConfig, joint_names: tuple[str, ...], action_names: tuple[str, ...]
) -> MSRDConfig:
    """The same run started from cloning with injected joint offsets and labels that undo them.

    Offsets of .03 rad, as far as start postures stray; undone at 6 speed fractions a radian. `action_names`
    go with `joint_names` one to one. The noise keeps longer cloning from fitting too closely.

    Clones that begin so well must not be left for little: without a price on that, half as many balls landed
    within .2 m of the teachers' mean after training as before, since all places where they let their balls
    land are worth the same to R0.
    """
    recovery_labels = tuple(
        (joint, action, 6.0) for joint, action in zip(joint_names, action_names, strict=True)
    )
    noise = tuple((joint, 0.03) for joint in joint_names)
    return replace(
        config,
        policy=replace(config.policy, reference_price=3.0),
        cloning=replace(config.cloning, steps=2000, state_noise=noise, recovery_labels=recovery_labels),
    )

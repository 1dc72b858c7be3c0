"""The lander as the methods see it: nothing is tuned to it, the recipe is the library's own for any task."""

from __future__ import annotations

from msrd_ros.learning.config import MSRDConfig
from msrd_ros.learning.examples.lunar_lander import ACTION_NAMES, OBSERVATION_NAMES, SCALES
from msrd_ros.learning.networks import Features
from msrd_ros.learning.recipe import default_config
from msrd_ros.studies.lunar_lander.environment import EPISODE_STEPS, make_collector
from msrd_ros.studies.shared.method import Budget
from msrd_ros.studies.shared.task import LearningTask


def default_budget() -> Budget:
    """What the default recipe plans: this study has none of its own."""
    config = default_config()
    return Budget(config.iterations, config.episodes, EPISODE_STEPS, config.cloning.steps)


def preset() -> MSRDConfig:
    """The default recipe, as `train` takes it."""
    return default_config()


LANDER = LearningTask(
    name="flair",
    observation_width=len(OBSERVATION_NAMES),
    action_width=len(ACTION_NAMES),
    features=Features(tuple(range(len(OBSERVATION_NAMES))), (0.0,) * len(OBSERVATION_NAMES), SCALES),
    preset=preset,
    make_collector=make_collector,
    horizon=EPISODE_STEPS,
    # Nothing ends here, so that nothing ever starts again: as `train` has it with this environment.
    make_autoreset=make_collector,
)

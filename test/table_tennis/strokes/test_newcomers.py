"""One more teacher of strokes: from a recording to policies that play."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from made_up_policies import made_up_policies
from msrd_ros.contract.episode import Episode
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.core.errors import UserError
from msrd_ros.core.resources import share_directory, shipped_bags
from msrd_ros.learning.newcomers.mixed_policy import MixedPolicy
from msrd_ros.learning.newcomers.recognition import Verdict
from msrd_ros.recordings.demonstrations import load_strokes
from msrd_ros.table_tennis.strokes.newcomers import StrokeNewcomers
from msrd_ros.table_tennis.strokes.policies import StrokePolicies
from msrd_ros.table_tennis.strokes.reach import Reach
from sawyer import ROBOT


@cache
def episodes() -> list[Episode]:
    return load_strokes(shipped_bags())


def shipped() -> StrokePolicies:
    return StrokePolicies.load(share_directory() / "config" / "robots" / "sawyer" / "policies.safetensors")


def of(label: str, subject: str) -> list[Episode]:
    return [episode for episode in episodes() if episode.label == label and episode.subject == subject]


def without(subject: str) -> StrokeNewcomers:
    """The shipped strategies, known by all subjects but one."""
    return StrokeNewcomers(shipped(), None, [each for each in episodes() if each.subject != subject])


def test_a_strangers_stroke_is_recognised_and_plays_under_its_name() -> None:
    newcomers = without("subject_03")
    takes = of("forehand-topspin", "subject_03")
    known = newcomers.meet_strokes(takes)
    assert (known.name, known.recognition.verdict) == ("forehand-topspin", Verdict.KNOWN)
    mine = StrategyLabel("my-topspin")
    met = newcomers.meet_strokes(takes, mine)
    assert met.name == mine
    policies = newcomers.stroke_policies
    assert policies.labels == (*shipped().labels, mine)
    facts = policies.require(mine)
    assert np.allclose(facts.ready_pose, np.mean([take.joint_position[0] for take in takes], axis=0))
    assert facts.side is policies.require(StrategyLabel("forehand-topspin")).side
    # As a file for the executor, with everybody else as before.
    again = StrokePolicies.from_bytes(policies.to_bytes(), "here", ROBOT)
    observation = takes[0].observations[20]
    for label in shipped().labels:
        before, after = (each.policies.policy(label).act(observation) for each in (shipped(), again))
        assert np.array_equal(before, after)
    alone = MixedPolicy([(1.0, again.policies.policy(mine))])
    played = newcomers._ground.collect(alone, 40, np.random.default_rng(1))
    beyond_net = (played.observations[0, :, 60:, 7] > 0.2).any(axis=1)
    assert beyond_net.mean() > 0.8


class Liking(StrokeNewcomers):
    """Newcomers whose R0 likes an arm that stays near a posture."""

    def _task_reward(self, observations: np.ndarray) -> np.ndarray:
        return np.asarray(-np.abs(observations[:, 1:, :7]).max(axis=(1, 2)))


def test_of_a_departure_only_as_much_is_learned_as_the_task_allows() -> None:
    newcomers = without("subject_03")
    base = MixedPolicy([(1.0, newcomers.policies.policy("forehand-push"))])
    departure = np.zeros((63, 7))
    departure[:, 0] = np.linspace(0.0, 1.0, 63)
    side = newcomers.stroke_policies.require(StrategyLabel("forehand-push")).side
    # Without rewards nobody can say what is a slip.
    assert newcomers._share(base, departure, side) == 1.0
    newcomers.__class__ = Liking
    plain = newcomers._task_reward(
        newcomers._ground.play_departing(base, 0.0 * departure, 20, newcomers._rng)
    )
    newcomers._good = {side: float(plain.min()) - 10.0}
    assert newcomers._share(base, departure, side) == 1.0
    newcomers._good = {side: float(plain.max()) + 10.0}
    newcomers.episodes_played = 0
    assert newcomers._share(base, departure, side) == 0.25
    assert newcomers.episodes_played == 80


def test_what_cannot_be_met_is_refused() -> None:
    newcomers = without("subject_03")
    two = [of("forehand-push", "subject_03")[0], of("backhand-push", "subject_03")[0]]
    with pytest.raises(UserError, match="2 sides are shown"):
        newcomers.meet_strokes(two)
    with pytest.raises(UserError, match=r"the policies are of .*; give those that they were learned from"):
        StrokeNewcomers(shipped(), None, of("forehand-push", "subject_01"))
    with pytest.raises(UserError, match="newcomers take no target, and these policies do"):
        StrokeNewcomers(made_up_policies(reach=Reach.grid([0.4, 0.8], [-0.2, 0.2])), None, episodes())
    forehand = [each for each in episodes() if str(each.label).startswith("forehand")]
    policies = shipped()
    for label in policies.labels:
        if label.startswith("backhand"):
            facts = {name: facts for name, facts in policies.facts.items() if name != label}
            policies = replace(policies, policies=policies.policies.without(label), facts=facts)
    with pytest.raises(UserError, match="no known strategy plays backhand"):
        StrokeNewcomers(policies, None, forehand).meet_strokes(two[1:])


def test_only_strokes_of_one_side_are_mixed() -> None:
    newcomers = without("subject_03")
    assert newcomers.may_mix("forehand-push", "forehand-slice")
    assert not newcomers.may_mix("forehand-push", "backhand-push")

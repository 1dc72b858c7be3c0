"""Teaching by hand, recorded: what is heard live, read from disk and played again gives the same arrays."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from nav_msgs.msg import Odometry

from msrd_ros.bags.reader import Bag
from msrd_ros.contract.episode import HORIZON, Episode
from msrd_ros.contract.outcome import RETURNED
from msrd_ros.core.errors import UserError
from msrd_ros.nodes.common import EVENT
from msrd_ros.nodes.played_bags import PlayedBags
from msrd_ros.recordings.episodes import read_episodes
from msrd_ros.recordings.library import BagLibrary
from msrd_ros.recordings.table import rows
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS, Stroke
from sawyer import ROBOT, SPEED_LIMIT_RAD_S
from stack import Stack

pytestmark = pytest.mark.processes


class Listener:
    """What a trainer takes from the topics."""

    def __init__(self, stack: Stack) -> None:
        self.episodes: list[Episode] = []
        self.refused: list[UserError] = []
        self.inputs = PlayedBags(stack.node, ROBOT, self.episodes.append, self.refused.append)


def test_live_disk_and_played_strokes_are_the_same_arrays(stack: Stack, tmp_path: Path) -> None:
    live = Listener(stack)
    simulator = stack.start_simulator(seed=5, show=False)
    recorder = stack.start("recorder", directory=tmp_path)
    demonstrator = stack.start("demonstrator", subjects=1, recordings=1, seed=1)
    stack.wait_until(lambda: not demonstrator.running, "end of the study", 150.0, simulator)
    assert demonstrator.wait() == 0, demonstrator.output
    demonstrator.wait_for_line("recorded 6 of 6 strokes")
    assert stack.diagnosed("simulator")["limits_exceeded"] == "0"
    bags = BagLibrary.scan(tmp_path, strict=True).select()
    assert sorted(str(bag.label) for bag in bags) == sorted(map(str, ALL_LABELS))
    assert recorder.stop() == simulator.stop() == 0

    from_disk = [episode for bag in bags for episode in read_episodes(Bag(bag.path))]
    for episode in from_disk:
        assert episode.observations.shape == (HORIZON + 1, 13)
        assert np.all(np.abs(episode.joint_velocity) <= 1.01 * SPEED_LIMIT_RAD_S)
        assert episode.outcome is not None
        assert episode.outcome.returned

    live.inputs.close()
    played = Listener(stack)
    player = stack.start("player", bags=f"[{tmp_path}]", rate=0.0)
    stack.wait_until(lambda: not player.running, "end of the player", 60.0)
    assert player.wait() == 0, player.output
    stack.wait_until(lambda: len(played.episodes) + len(played.refused) >= len(from_disk), "played episodes")
    assert played.refused == []
    assert played.inputs.lost == 0
    # The live listener also heard strokes that were returned but discarded, not being what was asked for.
    for heard in (live.episodes, played.episodes):
        for episode in from_disk:
            (same,) = (
                other
                for other in heard
                if other.label == episode.label and np.array_equal(other.observations, episode.observations)
            )
            np.testing.assert_array_equal(same.actions, episode.actions)


def test_strokes_whose_strategy_nobody_says_are_recorded_and_told_by_what_they_do(
    stack: Stack, tmp_path: Path
) -> None:
    simulator = stack.start_simulator(seed=5, show=False)
    recorder = stack.start("recorder", directory=tmp_path, unlabelled=True)
    remap = ("--ros-args", "-r", "strategy:=unsaid")
    study = {"subjects": 1, "recordings": 1, "seed": 1}
    demonstrator = stack.launcher.start("demonstrator", *remap, parameters=study)
    stack.wait_until(lambda: not demonstrator.running, "end of the study", 150.0, simulator)
    assert demonstrator.wait() == 0, demonstrator.output
    assert recorder.stop() == simulator.stop() == 0
    found = rows(tmp_path)
    assert {(row.label, row.verdict, row.outcome) for row in found} == {("unlabelled", "accepted", RETURNED)}
    words = {Stroke.SLICE: "backspin", Stroke.PUSH: "little spin", Stroke.TOPSPIN: "topspin"}
    assert Counter(row.does.split(" (")[0] for row in found) == Counter(
        f"{label.side}, {words[label.stroke]}" for label in ALL_LABELS
    )


def test_a_demonstrator_that_is_started_again_calls_off_the_ball_it_had_left(stack: Stack) -> None:
    stack.start_simulator(seed=5, show=False)
    study = {"subjects": 1, "recordings": 1, "recorder": "''"}
    feeds: list[Odometry] = []
    stack.node.create_subscription(Odometry, "feed", feeds.append, EVENT)
    first = stack.start("demonstrator", **study)
    stack.wait_until(lambda: feeds, "feed", 150.0, first)
    stack.wait_until(lambda: stack.diagnosed("simulator")["balls"] != "0", "ball", 60.0, first)
    first.kill()
    again = stack.start("demonstrator", **study)
    stack.wait_until(lambda: len(feeds) > 1, "the next feed", 150.0, again)
    assert again.stop() == 0

"""Who stands out: against the others of a label, never against oneself."""

from __future__ import annotations

from itertools import permutations

import numpy as np

from edited_bags import messages_of
from msrd_ros.bags.strokes import Stroke, whole_stroke
from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.contract.topics import BagMessage
from msrd_ros.core.resources import shipped_bags
from msrd_ros.recordings.episodes import read_bags
from msrd_ros.recordings.library import BagLibrary
from msrd_ros.recordings.outliers import OutlierLimits, deviations, distances, missed_samples, path_of
from synthetic_strokes import stroke_messages

LIMITS = OutlierLimits()


def stroke_of(messages: list[BagMessage]) -> Stroke:
    return whole_stroke(messages, StrategyLabel("forehand-push"), lambda data: True)


def test_a_deviation_is_the_robust_score_against_the_others() -> None:
    values = np.array([9.0, 10.0, 11.0, 12.0, 13.0, 40.0])
    scores = deviations(values, range(6), OutlierLimits(least_spread=0.0))
    assert np.isclose(scores[5], (40.0 - 11.0) / 1.4826)
    assert np.isclose(scores[0], (9.0 - 12.0) / 1.4826)


def test_two_outliers_do_not_hide_each_other() -> None:
    values = np.array([9.0, 10.0, 11.0, 10.5, 9.5, 10.0, 10.2, 40.0, 41.0])
    assert list(np.flatnonzero(deviations(values, range(9), LIMITS) > LIMITS.deviation)) == [7, 8]


def test_with_too_few_others_nothing_is_said() -> None:
    values = np.array([1.0, 1.0, 1.0, 99.0])
    assert np.isnan(deviations(values, range(4), LIMITS)).all()


def test_who_is_not_among_them_is_compared_and_changes_nobody() -> None:
    values = np.array([9.0, 10.0, 11.0, 10.0, 9.5, 1e9])
    with_it = deviations(values, range(5), LIMITS)
    np.testing.assert_array_equal(with_it[:5], deviations(values[:5], range(5), LIMITS))
    assert with_it[5] > LIMITS.deviation


def test_strokes_alike_to_the_last_digit_are_no_outliers() -> None:
    values = np.array([1.0, 1.0, 1.0, 1.0, 1.0, 1.001])
    assert not (deviations(values, range(6), LIMITS) > 1.0).any()
    assert np.isnan(deviations(np.zeros(6), range(6), LIMITS)).all()


def test_the_distance_is_from_the_median_path_of_the_others() -> None:
    paths = [np.full((5, 2), value) for value in (0.0, 1.0, 2.0, 10.0)]
    expected = np.sqrt(2.0) * np.array([2.0, 1.0, 1.0, 9.0])
    np.testing.assert_allclose(distances(paths, range(4)), expected)
    assert np.isnan(distances(paths[:1], range(1))).all()


def test_samples_that_are_missing_in_flight_are_counted() -> None:
    messages = stroke_messages(joint_hz=250.0, ball_hz=200.0)
    assert missed_samples(stroke_of(messages)) == {
        "joint_states": (0, 488),
        "ball/position": (0, 391),
    }
    joints = [message for message in messages if message.topic == "joint_states"]
    lost = {id(message) for message in [*joints[200:205], joints[300]]}
    counts = missed_samples(stroke_of([message for message in messages if id(message) not in lost]))
    assert counts["joint_states"] == (6, 488)
    early = {id(message) for message in joints[5:40]}
    counts = missed_samples(stroke_of([message for message in messages if id(message) not in early]))
    assert counts["joint_states"] == (0, 488), "what was missed before the launch does not count"


def test_the_shipped_bags_miss_nothing() -> None:
    messages = [message._replace(topic=message.topic.lstrip("/")) for message in messages_of()]
    assert {missing for missing, _ in missed_samples(stroke_of(messages)).values()} == {0}


def test_a_stroke_under_another_label_is_mostly_found_and_one_under_its_own_mostly_not() -> None:
    """The figures of docs/curating_bags.md."""
    paths: dict[str, list[np.ndarray]] = {}
    for reading in read_bags(BagLibrary.scan(shipped_bags()).bags):
        for episode in reading.episodes:
            paths.setdefault(episode.strategy, []).append(path_of(episode))
    marked = 0
    for own in paths.values():
        scores = deviations(distances(own, range(len(own))), range(len(own)), LIMITS)
        marked += int((scores > LIMITS.deviation).sum())
    assert marked == 1
    found = {True: 0, False: 0}
    for label, other in permutations(paths, 2):
        for path in paths[label]:
            together = [*paths[other], path]
            among = range(len(together))
            score = deviations(distances(together, among), among, LIMITS)[-1]
            found[label.split("-")[0] == other.split("-")[0]] += int(score > LIMITS.deviation)
    assert found == {False: 162, True: 79}, "of 162 under the other side's, of 108 under their own's"

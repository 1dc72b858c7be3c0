"""What a strategy does with the ball, as a person reads it and as a program does."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from msrd_ros.contract.episode import Episode
from msrd_ros.contract.outcome import MissReason, Outcome
from msrd_ros.table_tennis.strategies.table import Side, Strategies
from msrd_ros.table_tennis.strokes.description import Description, landing_word, met_side, spin_word


def back(x: float, y: float, spin: float, about_z: float = 0.0, speed: float = 4.0) -> Outcome:
    return Outcome(
        1,
        struck=True,
        miss_reason=None,
        landing_x_m=x,
        landing_y_m=y,
        spin_x_rad_s=0.0,
        spin_y_rad_s=spin,
        spin_z_rad_s=about_z,
        velocity_x_m_s=0.6 * speed,
        velocity_y_m_s=0.0,
        velocity_z_m_s=0.8 * speed,
    )


CUT = [back(1.0, 0.3, -100.0, speed=3.9), back(1.2, 0.5, -110.0, speed=4.1)]
MISSED = Outcome(2, struck=True, miss_reason=MissReason.NET, spin_y_rad_s=300.0)


def test_words_and_numbers_are_of_the_balls_that_came_back() -> None:
    described = Description.of(Side.FOREHAND, [*CUT, MISSED])
    assert str(described) == (
        "forehand, backspin (-105 ± 5 rad/s), 4.0 ± 0.1 m/s, lands 1.10 ± 0.10 m beyond the net, "
        "left (+0.40 ± 0.10 m)"
    )
    read = json.loads(json.dumps(described.to_json(), allow_nan=False))
    assert (read["text"], read["side"], read["spin"], read["lands"]) == (
        str(described),
        "forehand",
        "backspin",
        "left",
    )
    assert read["spin_rad_s"] == {"mean": [0.0, -105.0, 0.0], "sd": [0.0, 5.0, 0.0]}
    assert read["landing_m"]["mean"] == pytest.approx([1.1, 0.4])
    assert read["speed_m_s"]["sd"] == pytest.approx(0.1)


def test_one_ball_has_no_spread_and_strong_sidespin_is_told() -> None:
    assert str(Description.of(Side.BACKHAND, [back(0.5, -0.4, -0.3, about_z=80.0)])) == (
        "backhand, little spin (+0 rad/s), sidespin (+80 rad/s), 4.0 m/s, lands 0.50 m beyond the net, "
        "right (-0.40 m)"
    )


@pytest.mark.parametrize("balls", [[], [MISSED]])
def test_without_a_ball_that_came_back_nothing_is_made_up(balls: list[Outcome]) -> None:
    described = Description.of(Side.FOREHAND, balls)
    assert str(described) == f"forehand, none of {len(balls)} balls came back"
    read = described.to_json()
    assert [read[key] for key in ("spin", "lands", "spin_rad_s", "speed_m_s", "landing_m")] == [None] * 5


def test_what_a_referee_does_not_say_is_left_out() -> None:
    silent = Outcome(3, struck=True, miss_reason=None, spin_x_rad_s=0.0, spin_y_rad_s=90.0, spin_z_rad_s=0.0)
    assert str(Description.of(Side.FOREHAND, [silent])) == "forehand, topspin (+90 rad/s)"
    assert (
        Description.of(Side.FOREHAND, [silent, *CUT]).landing_m
        == Description.of(Side.FOREHAND, CUT).landing_m
    )


def test_the_word_for_a_spin_is_the_stroke_that_the_package_lists() -> None:
    words = {"slice": "backspin", "push": "little spin", "topspin": "topspin"}
    for strategy in Strategies.shipped().listed.values():
        assert strategy.spin is not None
        for edge in strategy.spin:
            if math.isfinite(edge):
                assert spin_word(edge) == words[strategy.stroke]


def test_the_table_is_left_middle_and_right_in_thirds() -> None:
    assert [landing_word(y) for y in (0.76, 0.26, 0.25, 0.0, -0.25, -0.26)] == [
        "left", "left", "middle", "middle", "middle", "right",
    ]  # fmt: skip


def test_the_side_is_where_the_ball_was_nearest_to_the_robot() -> None:
    def stroke(y: float) -> Episode:
        ball = np.array([[1.0, -y, 1.0], [-1.5, y, 1.0], [1.0, -y, 1.0]])
        return Episode(None, np.zeros((3, 7)), np.zeros((3, 7)), ball, np.zeros((3, 3)))

    assert met_side([stroke(-0.3), stroke(0.1)]) is Side.FOREHAND
    assert met_side([stroke(0.3)]) is Side.BACKHAND

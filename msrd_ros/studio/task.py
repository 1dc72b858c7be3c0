"""A stroke that is to be led for a page, and whose turn it is to move the arm."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from typing import NamedTuple

from msrd_ros.contract.labels import StrategyLabel
from msrd_ros.nodes.led_stroke import Led, LedStroke
from msrd_ros.table_tennis.ball.feeder import Feed

FULL_SPEED = 1.0
"""Simulated seconds a second."""


class Task(NamedTuple):
    """A stroke to be led.

    Attributes
    ----------
    label
        What it is called.
    stroke
        What the hand does.
    feed
        Its ball.
    at_once
        Whether the ball is launched as soon as the hand has the paddle; else when `Leading.launch` says.
    note
        What its bag says of it.
    rate
        Simulated seconds a second while the hand has the paddle.
    """

    label: StrategyLabel
    stroke: LedStroke
    feed: Feed
    at_once: bool
    note: str
    rate: float


class Turn(Enum):
    """Whose turn it is to move the arm."""

    FREE = "nobody leads"
    TAKING = "the arm comes to rest"
    LEADING = "led by hand"
    RETURNING = "the arm is given back"


Done = Callable[[Task, Led], Task | None]
"""Takes how a stroke went; the next one, or None."""

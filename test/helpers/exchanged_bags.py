"""A folder of bags to make data sets of: good ones, one that is refused, a lone file and a long recording."""

from __future__ import annotations

import shutil
from pathlib import Path

from edited_bags import messages_of, write_edited, write_mcap
from libraries import copy_of
from msrd_ros.bags.metadata import METADATA_FILE
from msrd_ros.bags.writer import write_bag
from msrd_ros.recordings.exchange.stroke_set import StrokeSet
from synthetic_strokes import START_NS, at_root, stroke_messages, topics_of

GOOD = ("subject_01/backhand-slice_001", "subject_01/forehand-push_001")
REFUSED, DAMAGED, LONE, LONG = "odd/frozen", "odd/damaged", "odd/lone.mcap", "odd/long"
Exported = dict[str, tuple[Path, StrokeSet]]
"""By kind: a data set's folder, and what it was said to hold."""
STROKES = 5
"""Accepted ones: a stroke each of `GOOD` and `LONE`, two of `LONG`."""


def mixed_folder(target: Path) -> Path:
    """Write the folder."""
    copy_of("subject_01", *(name.partition("/")[2] for name in GOOD), target=target)
    write_edited(target / REFUSED, joint_states=_frozen)
    (target / DAMAGED).mkdir()
    (target / DAMAGED / METADATA_FILE).write_text("cut off", encoding="utf-8")
    write_mcap(target / LONE, messages_of())
    messages = stroke_messages("my-lob") + stroke_messages("my-lob", START_NS + 5 * 10**9, ball_id=2)
    write_bag(target / LONG, topics_of(messages, ""), at_root(messages), {})
    return target


def without_bags(data_set: Path, target: Path) -> Path:
    """A copy of a data set with nothing beside it."""
    shutil.copytree(data_set, target, ignore=shutil.ignore_patterns("msrd_ros"))
    return target


def _frozen(message: object, number: int) -> object:
    message.position[3] = 1.25  # type: ignore[attr-defined]
    return message

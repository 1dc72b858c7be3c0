"""Bags for all messages: what is written is read, byte for byte, in its order and with its times."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from mcap_doctor import examine
from msrd_ros.bags.reader import Bag
from msrd_ros.bags.schemas import serialise
from msrd_ros.bags.writer import keep_stroke
from msrd_ros.contract.labels import ALL_LABELS, StrategyLabel
from msrd_ros.contract.topics import BagMessage
from synthetic_strokes import at_root, ball_position, header, make, topics_of

JOINT_STATE = "sensor_msgs/msg/JointState"
TIMES_NS = st.integers(0, 2**60)
VALUES = st.lists(st.floats(width=64), max_size=9).map(lambda values: np.array(values, dtype=np.float64))
NAMES = st.lists(st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"])), max_size=9)


@st.composite
def messages(draw: st.DrawFn, label: StrategyLabel) -> list[BagMessage]:
    """A ball and joint states of any length, values and names, logged in the order of their times."""
    found = [BagMessage("ball/position", ball_position(0, 0.0), 0, draw(TIMES_NS))]
    for log_time_ns in sorted(draw(st.lists(TIMES_NS, min_size=1, max_size=6))):
        content = make(
            JOINT_STATE,
            header(draw(TIMES_NS), str(label)),
            draw(NAMES),
            draw(VALUES),
            draw(VALUES),
            draw(VALUES),
        )
        data = bytes(serialise(content, JOINT_STATE))
        found.append(
            BagMessage("joint_states", data, log_time_ns, draw(TIMES_NS), draw(st.integers(0, 2**32 - 1)))
        )
    return found


@settings(max_examples=50)
@given(
    data=st.data(),
    label=st.sampled_from(ALL_LABELS),
    subject=st.from_regex(r"[a-z0-9]{1,20}", fullmatch=True),
)
def test_what_is_written_is_read(data: st.DataObject, label: StrategyLabel, subject: str) -> None:
    written = data.draw(messages(label))
    with TemporaryDirectory() as folder:
        path = keep_stroke(Path(folder), subject, label, topics_of(written), at_root(written), {})
        assert path.parent == Path(folder) / subject
        assert [problem for file in path.glob("*.mcap") for problem in examine(file)] == []
        read = Bag(path).raw()
    assert read == at_root(written)

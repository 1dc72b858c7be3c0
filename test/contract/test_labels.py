"""Names of strategies: which texts are any."""

from __future__ import annotations

import pickle

import pytest

from msrd_ros.contract.labels import FRAME_NAMES, UNLABELLED, StrategyLabel, read_label, say_label
from msrd_ros.core.errors import UserError


@pytest.mark.parametrize("text", ["forehand-push", "my-smash", "2", "a" * 64, "lob-2"])
def test_a_well_formed_name_is_a_label(text: str) -> None:
    label = StrategyLabel.parse(text)
    assert label == text
    assert StrategyLabel.parse_optional(text) == label
    assert isinstance(pickle.loads(pickle.dumps(label)), StrategyLabel)


@pytest.mark.parametrize(
    "text",
    ["", "My-smash", "my_smash", "base_link", "a/b", "..", "a b", "a\n", "ä", "a" * 65, *sorted(FRAME_NAMES)],
)
def test_anything_else_is_refused_by_name(text: str) -> None:
    with pytest.raises(UserError, match=r"topic strategy: .* no strategy label"):
        StrategyLabel.parse(text, "topic strategy")
    with pytest.raises(UserError, match="no strategy label"):
        StrategyLabel(text)
    assert StrategyLabel.parse_optional(text) is None


def test_the_word_for_no_label_is_none_itself() -> None:
    assert say_label(None) == UNLABELLED
    assert [read_label(text) for text in ("", UNLABELLED)] == [None, None]
    assert isinstance(read_label("my-smash"), StrategyLabel)
    assert say_label(read_label("my-smash")) == "my-smash"
    assert StrategyLabel.parse_optional(UNLABELLED) is None
    with pytest.raises(UserError, match="topic strategy: 'unlabelled' is said of strokes without a label"):
        StrategyLabel.parse(UNLABELLED, "topic strategy")
    with pytest.raises(UserError, match="no strategy label"):
        read_label("My Smash")

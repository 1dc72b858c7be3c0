"""The label codec for all texts: a label says what was read, and anything else is refused."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from msrd_ros.contract.labels import ALL_LABELS, StrategyLabel
from msrd_ros.core.errors import UserError

KNOWN = st.sampled_from(ALL_LABELS)


@given(KNOWN)
def test_what_is_written_is_read(label: StrategyLabel) -> None:
    assert StrategyLabel.parse(str(label)) == label
    assert StrategyLabel.parse_optional(str(label)) == label


@given(st.one_of(st.text(), KNOWN.map(lambda label: f"{label}\n"), KNOWN.map(lambda label: f"../{label}")))
def test_any_text_is_a_label_as_it_stands_or_refused_in_one_line(text: str) -> None:
    found = StrategyLabel.parse_optional(text)
    if found is not None:
        assert str(found) == text
        return
    with pytest.raises(UserError) as refused:
        StrategyLabel.parse(text, "topic strategy")
    assert str(refused.value).startswith("topic strategy: ")
    assert len(str(refused.value).splitlines()) == 1

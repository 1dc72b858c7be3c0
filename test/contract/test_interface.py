"""The table of topics says what the nodes' code creates."""

from __future__ import annotations

import ast
from collections.abc import Iterator

import pytest

from msrd_ros.contract.interface import MEANINGS, TOPICS
from processes import CHECKOUT, PACKAGE

KEPT = {"STATE": (1000, False), "EVENT": (100, False), "COMMAND": (1, False), "LATCHED": (1, True)}
HEARD_OR_ASKED_FOR_AGAIN = {"answer", "LOCKSTEP"}
"""Names of qualities of subscriptions to which reliability says nothing in lockstep."""


def created() -> Iterator[tuple[str, str, str, str]]:
    """Where, type, topic and quality of service of every publisher and subscription with a literal name."""
    for path in sorted((CHECKOUT / PACKAGE).rglob("*.py")):
        for call in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(call, ast.Call) or not isinstance(call.func, ast.Attribute):
                continue
            if call.func.attr not in ("create_publisher", "create_subscription"):
                continue
            # What passes a name on has none of its own.
            if len(call.args) > 1 and isinstance(call.args[1], ast.Constant):
                where = f"{path.relative_to(CHECKOUT)}:{call.lineno}"
                yield where, ast.unparse(call.args[0]), str(call.args[1].value), ast.unparse(call.args[-1])


@pytest.mark.parametrize(("where", "kind", "topic", "quality"), list(created()), ids=str)
def test_topic_is_in_the_table_as_it_is_created(where: str, kind: str, topic: str, quality: str) -> None:
    facts = TOPICS[topic]
    # The simulator imports `Clock` as `ClockMessage`.
    assert facts.type_name.rpartition("/")[2] == {"ClockMessage": "Clock"}.get(kind, kind), where
    if quality in HEARD_OR_ASKED_FOR_AGAIN:
        return
    assert (facts.depth, facts.latched) == KEPT.get(quality, (10, False)), where


def test_every_topic_has_a_meaning() -> None:
    assert set(MEANINGS) == set(TOPICS)

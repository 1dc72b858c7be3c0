"""A match over topics: two arms, two executors and two choosers as processes play a rally."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectory

from msrd_ros.contract.translation import read_outcome, stamp_to_ns
from msrd_ros.nodes.common import EVENT, LATCHED, STATE
from msrd_ros.nodes.match import MATCH_STATUS
from msrd_ros.table_tennis.ball.ends import End
from stack import START_TIMEOUT_S, Stack, one_line

pytestmark = pytest.mark.processes

RALLY_TIMEOUT_S = 120.0
MOST_HITS = 4


def test_two_arms_play_a_short_rally(stack: Stack, tmp_path: Path) -> None:
    heard: dict[str, list[Any]] = {}

    def hear(kind: Any, topic: str, profile: Any) -> None:
        stack.node.create_subscription(kind, topic, heard.setdefault(topic, []).append, profile)

    for end in End:
        hear(JointState, f"{end}/joint_states", STATE)
        hear(JointTrajectory, f"{end}/joint_command", STATE)
        hear(DiagnosticArray, f"{end}/rally/outcome", EVENT)
        hear(Header, f"{end}/strategy", LATCHED)
    hear(DiagnosticArray, "match/outcome", EVENT)
    report = tmp_path / "rallies.json"
    process = stack.launcher.start(
        "up", "rally", "rallies:=2", f"most_hits:={MOST_HITS}", f"report:={report}"
    )
    stack.wait_until(lambda: heard["match/outcome"], "rally", START_TIMEOUT_S + RALLY_TIMEOUT_S, process)
    # The second rally gives the first one's messages time to come; the node's last ones may go down with it.
    stack.wait_until(report.exists, "report", RALLY_TIMEOUT_S)
    assert process.wait(60.0) == 0, process.output

    told = heard["match/outcome"][0].status[0]
    values = {pair.key: pair.value for pair in told.values}
    assert told.name == MATCH_STATUS
    hits = int(values["hits"])
    assert 1 <= hits <= MOST_HITS
    content = json.loads(report.read_text())
    assert (content["hits"][0], content["ends"][0]) == (hits, told.message)
    assert len(content["hits"]) == 2

    strokes = [
        (stamp_to_ns(message.header.stamp), end, read_outcome(message)[1])
        for end in End
        for message in heard[f"{end}/rally/outcome"]
    ]
    strokes = sorted(strokes, key=lambda stroke: stroke[0])[: hits + (hits < MOST_HITS)]
    assert [outcome.returned for _, _, outcome in strokes] == [True] * hits + [False] * (hits < MOST_HITS)
    ends = [end for _, end, _ in strokes]
    assert all(first is second.other for first, second in pairwise(ends)), "they take turns"
    assert values["end"] == strokes[-1][1]
    for end in End:
        assert heard[f"{end}/strategy"]
        assert len(heard[f"{end}/joint_states"]) > 50
        assert len(heard[f"{end}/joint_command"]) > 10
    stack.wait_until(lambda: stack.diagnostics.get("match"), "diagnostics of the match")
    assert stack.diagnostics["match"]["limits_exceeded"] == "0"


def test_a_report_without_rallies_is_refused(stack: Stack) -> None:
    process = stack.start("match", report="rates.json")
    assert "say rallies:=NUMBER, too" in one_line(process, "match")


def test_a_match_says_whom_it_waits_for(stack: Stack) -> None:
    process = stack.start("match")
    stack.wait_until(
        lambda: "namespace far" in stack.diagnostics.get("match", {}).get("waits_for", ""),
        "what it waits for",
        START_TIMEOUT_S,
        process,
    )
    response = stack.trigger("match/serve")
    assert not response.success
    assert "start a chooser" in response.message
    assert process.stop() == 0

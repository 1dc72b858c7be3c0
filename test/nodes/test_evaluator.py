"""The evaluator as a process: it feeds, counts and reports, and says who is missing."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from made_up_policies import made_up_policies
from msrd_ros.table_tennis.strategies.paper import ALL_LABELS
from stack import Stack, one_line

pytestmark = pytest.mark.processes

LABELS = ALL_LABELS[:2]
LIST = f"[{', '.join(map(str, LABELS))}]"
PATIENCE_S = 8.0
"""Long enough to discover whoever is there on a starved machine; waited for in full where nobody is."""


def test_balls_are_fed_counted_and_reported_and_who_is_missing_is_named(stack: Stack, tmp_path: Path) -> None:
    simulator = stack.start_simulator(seed=2)

    # Before there is an executor, that is what is said.
    alone = stack.start("evaluator", labels=LIST, balls=1, timeout_s=PATIENCE_S)
    line = one_line(alone, "evaluator")
    assert "no executor: nobody publishes joint_command; start one with a checkpoint" in line

    checkpoint = tmp_path / "policies.safetensors"
    checkpoint.write_bytes(made_up_policies(LABELS[:1]).to_bytes())
    executor = stack.start("executor", checkpoint=checkpoint)
    executor.wait_for_line("ready: lockstep")
    lacking = stack.start("evaluator", labels=f"[{LABELS[1]}]", balls=1, timeout_s=PATIENCE_S)
    line = one_line(lacking, "evaluator")
    assert f"the executor does not take up strategy {LABELS[1]}; check its checkpoint and its log" in line
    executor.wait_for_line(f"no policy for strategy {LABELS[1]}; the checkpoint has {LABELS[0]}")
    assert executor.stop() == 0

    checkpoint.write_bytes(made_up_policies(LABELS).to_bytes())
    executor = stack.start("executor", checkpoint=checkpoint)
    report = tmp_path / "report.json"
    unknown = stack.start("evaluator", labels="[my-lob]", balls=1, checkpoint=checkpoint)
    assert f"no policy for strategy my-lob; the checkpoint has {LABELS[0]}" in one_line(unknown, "evaluator")
    parameters = {"balls": 2, "seed": 3, "checkpoint": checkpoint, "report": report}
    evaluator = stack.start("evaluator", **parameters)
    assert evaluator.wait(90.0) == 0, evaluator.output
    evaluator.wait_for_line(f"written to {report}")
    read = json.loads(report.read_text())
    assert list(read["labels"]) == [str(label) for label in LABELS]
    for label in LABELS:
        row = read["labels"][str(label)]
        assert row["fed"] == 2
        assert row["returned"] + sum(row["miss_reasons"].values()) == 2
        assert row["struck"] >= row["returned"]
        evaluator.wait_for_line(rf"^{label} +2 ")
        described = row["description"]
        assert described["side"] == str(label.side)
        assert described["text"].startswith(f"{label.side}, ")
        evaluator.wait_for_line(f"^{label}: {re.escape(described['text'])}$")
        assert (described["landing_m"] is None) == (row["returned"] == 0)
    assert stack.diagnosed("simulator")["balls"] == "4"
    assert stack.diagnosed("simulator")["limits_exceeded"] == "0"

    # A simulator that goes away in the middle is missed.
    evaluator = stack.start("evaluator", labels=LIST, balls=1000, timeout_s=PATIENCE_S)
    stack.wait_until(lambda: int(stack.diagnosed("simulator")["balls"]) > 4, "more balls")
    simulator.kill()
    line = one_line(evaluator, "evaluator")
    assert "check that simulator and executor still run" in line or "no simulator on domain" in line

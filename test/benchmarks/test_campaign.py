"""The campaign of faults: its record, its table, and a small part of it against the real stack."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml

from faults.files import mutate_bytes, mutate_yaml
from faults.trials import Finding, NotTriedError, Setting, Trial, run_trials, write_table
from processes import CHECKOUT

DAMAGED_FILES = ["bags", "policies", "checkpoints", "robots", "strategies"]
NODES_IN_TROUBLE = ["killed", "stopped", "file-size", "parameter-files", "rubbish"]
"""Together about two minutes of it."""


def test_a_campaign_goes_on_where_it_stopped(tmp_path: Path) -> None:
    runs: list[str] = []

    def broken(setting: Setting) -> Finding:
        runs.append("broken")
        finding = Finding(tried=setting.count(200))
        finding.break_promise("it moved")
        return finding

    def impossible(_: Setting) -> Finding:
        runs.append("impossible")
        raise NotTriedError("no such device")

    trials = (Trial("a", "shake", "stand", broken), Trial("b", "burn", "stand", impossible))
    run_trials(trials[:1], tmp_path, 0.1, 0, lambda _: None)
    with (tmp_path / "campaign.jsonl").open("a") as file:
        file.write('{"name": "b", "sha')
    (tmp_path / "campaign.jsonl").write_text((tmp_path / "campaign.jsonl").read_text() + "\n")
    entries = run_trials(trials, tmp_path, 0.1, 0, lambda _: None)
    assert runs == ["broken", "impossible"]
    write_table(trials, entries, tmp_path / "table.md")
    table = (tmp_path / "table.md").read_text()
    assert "| shake | stand | BROKEN 1 times, 20 tried |" in table
    assert "| burn | stand | not tried here: no such device |" in table
    assert "* a: it moved" in table
    run_trials(trials, tmp_path, 1.0, 0, lambda _: None)
    assert runs[2:] == ["broken", "impossible"], "another share is another campaign"


def test_mutations_change_what_they_get() -> None:
    rng = np.random.default_rng(0)
    data = bytes(range(256)) * 8
    assert sum(mutate_bytes(data, rng) != data for _ in range(100)) > 90
    document = yaml.safe_dump({"a": [1, 2, {"b": "c"}], "d": 3.0}).encode()
    assert sum(mutate_yaml(document, rng) != document for _ in range(100)) > 80


@pytest.mark.timeout(600)
@pytest.mark.parametrize(
    "part",
    [
        pytest.param(DAMAGED_FILES, marks=pytest.mark.slow, id="files"),
        pytest.param(NODES_IN_TROUBLE, marks=pytest.mark.processes, id="nodes"),
    ],
)
def test_a_small_part_of_the_campaign_holds(part: list[str], tmp_path: Path) -> None:
    campaign = CHECKOUT / "benchmarks" / "campaign.py"
    done = subprocess.run(
        [sys.executable, campaign, "--share", "0.01", "--only", *part, "--out", tmp_path],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    entries = [json.loads(line) for line in (tmp_path / "campaign.jsonl").read_text().splitlines()]
    assert [entry["name"] for entry in entries] == part
    assert all(entry["not_tried"] or entry["finding"]["tried"] > 0 for entry in entries)

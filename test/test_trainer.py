"""The trainer as a process: from a folder of bags, resumed exactly, its services, the policies it sends."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from processes import RunningProcess
from stack import Stack

from msrd_ros.facts.labels import ALL_LABELS
from msrd_ros.learning.stroke_policies import StrokePolicies

pytestmark = pytest.mark.processes

LABELS = ALL_LABELS[:2]
SWEEPS = 8
TINY: dict[str, Any] = {
    "labels": f"[{', '.join(map(str, LABELS))}]",
    "subjects": "[subject_01]",
    "episodes": 8,
    "rehearse_every": 1,
    "rehearse_balls": 4,
    "workers": 1,
    "torch_threads": 1,
}


def finish(trainer: RunningProcess, out: Path) -> StrokePolicies:
    """Wait for the end of training; what it wrote."""
    assert trainer.wait(200.0) == 0, trainer.output
    trainer.wait_for_line(f"policies written to {out / 'policies.safetensors'}")
    return StrokePolicies.load(out / "policies.safetensors")


def test_services_checkpoint_and_stop(stack: Stack, tmp_path: Path) -> None:
    quick = {**TINY, "rehearse_every": 0}
    trainer = stack.start("trainer", **quick, out=tmp_path, sweeps=100_000, checkpoint_every=0)
    assert stack.trigger("trainer/checkpoint").success
    again = stack.trigger("trainer/start")
    assert not again.success
    assert again.message == "training is under way"
    path = tmp_path / "checkpoint.safetensors"
    stack.wait_until(path.exists, "checkpoint", 120.0, trainer)
    assert trainer.running
    assert stack.trigger("trainer/stop").success
    policies = finish(trainer, tmp_path)
    assert policies.labels == LABELS
    assert 0 < json.loads((tmp_path / "training.json").read_text())["sweeps"] < 100_000


def test_without_demonstrations_there_is_nothing_to_start(stack: Stack, tmp_path: Path) -> None:
    trainer = stack.start("trainer", source="played", out=tmp_path)
    refused = stack.trigger("trainer/start")
    assert not refused.success
    assert refused.message == "no demonstration has arrived yet; play some bags"
    assert not stack.trigger("trainer/checkpoint").success
    assert trainer.stop() == 0

"""The quick version of a study as a user runs it, and what all studies on virtual tasks write."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

from msrd_ros.studies.reproduce import main
from msrd_ros.studies.shared.methods import METHODS


def play(study: str, folder: Path) -> float:
    """Run it into `folder`; processor seconds."""
    started = time.process_time()
    assert main([study, "--quick", "--out", str(folder)]) == 0
    return time.process_time() - started


def written_by_virtual_study(study: str, folder: Path, pictures: int) -> dict[str, Any]:
    """Methods of ``metrics.json``, after what must hold of it and of the report whatever the task."""
    metrics = json.loads((folder / "metrics.json").read_text())
    assert metrics["study"] == study
    assert metrics["seeds"] == [0]
    methods: dict[str, Any] = metrics["methods"]
    assert set(methods) == set(METHODS)
    steps = [methods[name]["env_steps"][0] for name in ("msrd", "airl", "airl_each")]
    assert len(set(steps)) == 1
    assert methods["airl"]["strategy_r"] == [None]
    assert methods["classifier"]["task_r"] == [None]
    report = (folder / "report.html").read_text()
    assert report.count("data:image/png;base64") == pictures
    assert 'src="http' not in report
    return methods

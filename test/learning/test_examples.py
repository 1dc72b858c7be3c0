"""The shipped demonstrations, and the quickstart on them."""

from __future__ import annotations

import ast
import re
import shutil
import subprocess
import sys
from pathlib import Path

import gymnasium
import numpy as np
import pytest

import msrd_ros.learning as msrd
from msrd_ros.core.errors import UserError
from processes import CHECKOUT

QUICKSTART = CHECKOUT / "docs" / "examples" / "quickstart.py"
DATA = CHECKOUT / "msrd_ros" / "learning" / "examples" / "lunar_lander.npz"
MOST_LINES, MOST_COLUMNS, MOST_BYTES = 15, 100, 300_000
LANDED = 200.0
"""Gymnasium calls a LunarLander of this return solved."""


def test_two_ways_to_land() -> None:
    data = msrd.example_demonstrations("lunar_lander")
    assert data.layout.labels == ("left", "right")
    assert data.acting is not None
    assert data.acting.shape == (2, 10)
    last = data.observations[:, :, -1]
    assert (last[..., 6:].max(axis=-1) == 1.0).all()
    assert np.abs(last[..., :4]).max() < 0.25
    swing = np.array([data.observations[0, :, :, 0].min(axis=1), data.observations[1, :, :, 0].max(axis=1)])
    assert (np.abs(swing) > 0.2).all()
    assert (np.sign(swing) == [[-1.0], [1.0]]).all()
    assert DATA.stat().st_size <= MOST_BYTES
    with pytest.raises(UserError, match="no example 'mars'; there are lunar_lander"):
        msrd.example_demonstrations("mars")


def test_their_columns_are_the_environments() -> None:
    data = msrd.example_demonstrations("lunar_lander")
    environment = gymnasium.make("LunarLanderContinuous-v3")
    begun = np.stack([environment.reset(seed=seed)[0] for seed in range(20)])
    assert np.abs(data.observations[:, :, 0].mean(axis=(0, 1)) - begun.mean(axis=0)).max() < 0.5
    assert np.abs(data.actions).max() <= 1.0


def test_the_quickstart_is_short() -> None:
    source = QUICKSTART.read_text(encoding="utf-8")
    tree = ast.parse(source)
    assert ast.get_docstring(tree)
    lines = [line for line in source.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    assert len(lines) <= MOST_LINES
    assert max(map(len, lines)) <= MOST_COLUMNS
    statements = [node for node in ast.walk(tree) if isinstance(node, ast.stmt)]
    assert len({node.lineno for node in statements}) == len(statements)


@pytest.mark.timeout(600)
@pytest.mark.slow
def test_the_quickstart_lands(tmp_path: Path) -> None:
    script = shutil.copy(QUICKSTART, tmp_path)
    result = subprocess.run(
        [sys.executable, script], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    print(result.stdout)
    returns = [float(found) for found in re.findall(r"own return is (-?\d+)", result.stdout)]
    assert len(returns) == 2
    assert min(returns) > LANDED
    landed, crashed = map(float, re.findall(r"crashed: \[\s*(\S+)\s+(\S+?)\s*\]", result.stdout)[0])
    assert landed > crashed
    sides = re.findall(r"(left|right): strategy reward .*: \[\s*(\S+)\s+(\S+?)\s*\]", result.stdout)
    assert [name for name, *_ in sides] == ["left", "right"]
    for name, left, right in sides:
        assert (float(left) > float(right)) == (name == "left")
    learned = msrd.Learned.load(tmp_path / "landers.safetensors")
    assert learned.labels == ("left", "right")

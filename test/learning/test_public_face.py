"""``import msrd_ros.learning as msrd``: light, without side effects, and all that it declares is there."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

import msrd_ros.learning as msrd
from msrd_ros.core.errors import UserError

PROBE = """
import json, os, sys
before = dict(os.environ)
import msrd_ros.learning as msrd
light, unchanged = sorted(sys.modules), dict(os.environ) == before
for name in msrd.__all__:
    getattr(msrd, name)
msrd.example_demonstrations("lunar_lander")
print(json.dumps([light, sorted(sys.modules), unchanged]))
"""


def test_importing_brings_neither_ros_nor_bullet_nor_numba(tmp_path: Path) -> None:
    environment = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    environment |= {"HOME": str(tmp_path), "XDG_CACHE_HOME": str(tmp_path / "cache")}
    result = subprocess.run(
        [sys.executable, "-c", PROBE],
        env=environment,
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    light, everything, unchanged = json.loads(result.stdout)
    foreign = {"rclpy", "pybullet", "numba", "rosbags", "mcap", "matplotlib", "minari", "pyarrow"}
    assert not foreign & {name.partition(".")[0] for name in everything}
    assert "torch" not in light
    assert unchanged
    assert not list(tmp_path.rglob("*"))


def test_everything_declared_is_there_and_documented() -> None:
    for name in msrd.__all__:
        assert getattr(msrd, name).__doc__ or name == "METHODS"
    assert sorted(msrd.__all__) == sorted(set(msrd.__all__))
    assert set(msrd.__all__) <= set(dir(msrd))
    assert msrd.UserError is UserError


def test_anything_else_is_not() -> None:
    with pytest.raises(AttributeError, match="has no attribute 'trian'"):
        _ = msrd.trian

"""Building the package as users do."""

from __future__ import annotations

import sys
from pathlib import Path


def colcon(workspace: Path) -> list[str]:
    """The colcon command of this environment, keeping its log in the workspace."""
    return [sys.executable, "-m", "colcon", "--log-base", str(workspace / "log")]

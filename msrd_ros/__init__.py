"""Multi-Strategy Reward Distillation (MSRD) for ROS 2: teach by hand, record, learn, play."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

from msrd_ros.facts.scratch import cache_directory

__version__ = "0.1.0"


def _choose_numba_cache() -> None:
    """Keep compiled functions apart by the state of our sources.

    Numba asks only whether the file of the outermost function has changed; a change in a function that is
    inlined into it would go unnoticed, after an upgrade as well as after an edit.
    """
    if "NUMBA_CACHE_DIR" in os.environ:
        return
    state = hashlib.sha256(__version__.encode())
    package = Path(__file__).parent
    for path in sorted([*package.glob("table_tennis/*.py"), package / "facts" / "motion_limits.py"]):
        facts = path.stat()
        state.update(f"{path.name} {facts.st_size} {facts.st_mtime_ns}".encode())
    cache = cache_directory(os.environ) / "msrd_ros" / "numba"
    os.environ["NUMBA_CACHE_DIR"] = str(cache / state.hexdigest()[:16])


_choose_numba_cache()

"""Multi-Strategy Reward Distillation (MSRD) for ROS 2: teach by hand, record, learn, play."""

from __future__ import annotations

import contextlib
import hashlib
import os
import shutil
import time
from pathlib import Path

from msrd_ros.facts.scratch import cache_directory

__version__ = "0.1.0"

_KEPT_S = 30 * 86_400.0


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
    chosen = cache / state.hexdigest()[:16]
    os.environ["NUMBA_CACHE_DIR"] = str(chosen)
    if chosen.is_dir():
        with contextlib.suppress(OSError):
            os.utime(chosen)
    elif cache.is_dir():
        _remove_unused(cache)


def _remove_unused(cache: Path) -> None:
    """Remove compiled functions of sources that nobody has imported for a month."""
    for folder in cache.iterdir():
        with contextlib.suppress(OSError):
            if time.time() - folder.stat().st_mtime > _KEPT_S:
                shutil.rmtree(folder)


_choose_numba_cache()

"""Where compiled functions are kept between runs: apart by the state of the sources."""

from __future__ import annotations

import contextlib
import hashlib
import os
import shutil
import time
from collections.abc import MutableMapping
from pathlib import Path

from msrd_ros.core.scratch import cache_directory

COMPILED = ("core", "robots", "table_tennis")
"""Rooms with compiled functions."""

_UNUSED_AFTER_S = 30 * 86_400.0


def choose_compiled_cache(environment: MutableMapping[str, str]) -> None:
    """Set NUMBA_CACHE_DIR, unless the user has, to a folder for just this state of our sources.

    Numba asks only whether the file of the outermost function has changed; a change in a function that is
    inlined into it would go unnoticed, after an upgrade as well as after an edit. Has to be called before
    numba is imported. Folders of sources that nobody has used for a month are removed.
    """
    if "NUMBA_CACHE_DIR" in environment:
        return
    package = Path(__file__).parents[1]
    state = hashlib.sha256()
    for room in COMPILED:
        for path in sorted((package / room).rglob("*.py")):
            status = path.stat()
            state.update(f"{path.relative_to(package)} {status.st_size} {status.st_mtime_ns}".encode())
    caches = cache_directory(environment) / "msrd_ros" / "numba"
    chosen = caches / state.hexdigest()[:16]
    environment["NUMBA_CACHE_DIR"] = str(chosen)
    if chosen.is_dir():
        with contextlib.suppress(OSError):
            os.utime(chosen)
    elif caches.is_dir():
        _remove_unused(caches)


def _remove_unused(caches: Path) -> None:
    for folder in caches.iterdir():
        with contextlib.suppress(OSError):
            if time.time() - folder.stat().st_mtime > _UNUSED_AFTER_S:
                shutil.rmtree(folder)

"""Compiled functions: kept apart by sources, and not for ever."""

from __future__ import annotations

import os
import time
from pathlib import Path

from msrd_ros.core.compiled_cache import choose_compiled_cache


def test_compiled_code_of_other_sources_is_kept_for_a_month(tmp_path: Path) -> None:
    caches = tmp_path / "msrd_ros" / "numba"
    for name, age_days in (("old", 40), ("recent", 3)):
        (caches / name).mkdir(parents=True)
        (caches / name / "code.nbc").write_bytes(b"")
        then = time.time() - 86_400 * age_days
        os.utime(caches / name, (then, then))
    environment = {"XDG_CACHE_HOME": str(tmp_path)}
    choose_compiled_cache(environment)
    assert Path(environment["NUMBA_CACHE_DIR"]).parent == caches
    assert [path.name for path in caches.iterdir()] == ["recent"]


def test_what_the_user_has_set_stays(tmp_path: Path) -> None:
    environment = {"XDG_CACHE_HOME": str(tmp_path), "NUMBA_CACHE_DIR": "/elsewhere"}
    choose_compiled_cache(environment)
    assert environment["NUMBA_CACHE_DIR"] == "/elsewhere"

"""What is compiled for one arm is never loaded for another."""

from __future__ import annotations

import re
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
from numba.core.caching import IndexDataCacheFile

from msrd_ros.core import compiled
from processes import CHECKOUT, PACKAGE

_NUMBA = re.compile(r"^\s*(?:from|import) numba\b", re.M)


def test_processes_that_save_at_once_keep_each_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    read: Any = IndexDataCacheFile._load_index

    def read_slowly(cache: IndexDataCacheFile) -> Any:
        index = read(cache)
        time.sleep(0.05)  # the others read the same index meanwhile, if they may
        return index

    monkeypatch.setattr(IndexDataCacheFile, "_load_index", read_slowly)
    keys = range(4)

    def save(key: int) -> None:
        cache: Any = IndexDataCacheFile(str(tmp_path), "function", "stamp")
        cache.save(key, f"compiled for {key}")

    with ThreadPoolExecutor(len(keys)) as pool:
        list(pool.map(save, keys))
    cache: Any = IndexDataCacheFile(str(tmp_path), "function", "stamp")
    assert [cache.load(key) for key in keys] == [f"compiled for {key}" for key in keys]


def test_all_that_is_compiled_is_saved_so() -> None:
    past = [path for path in sorted((CHECKOUT / PACKAGE).rglob("*.py")) if _NUMBA.search(path.read_text())]
    assert past == [Path(compiled.__file__)]

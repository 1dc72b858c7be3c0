"""Numba's decorators, with a cache that several processes may fill at once.

Numba numbers the data files of a function's signatures and does not lock: of two processes that compile the
same function for two arms, each may take number one, and an arm is then led by code that was compiled for the
other's layout. Whatever is compiled here is saved by one process at a time.
"""

from __future__ import annotations

import fcntl
import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit, vectorize
from numba.core.caching import IndexDataCacheFile
from numpy.typing import NDArray

__all__ = ["copy_onto", "njit", "vectorize"]

_LOCK_FILE = ".lock"


def _one_at_a_time(save: Callable[..., None]) -> Callable[..., None]:
    """A save that holds the lock of its folder; the system lets go of it however the process ends."""

    @functools.wraps(save)
    def locked(cache: IndexDataCacheFile, key: Any, data: Any) -> None:
        with Path(cache._cache_path, _LOCK_FILE).open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            save(cache, key, data)

    return locked


IndexDataCacheFile.save = _one_at_a_time(IndexDataCacheFile.save)  # type: ignore[method-assign]


@njit(cache=True, nogil=True)
def copy_onto(target: NDArray[np.float64], source: NDArray[np.float64]) -> None:
    """``target[:] = source`` for arrays of shape (N,), in compiled code.

    For the assignment itself Numba compiles the text of the error that it might raise: two seconds for each
    pair of types.
    """
    for index in range(len(target)):
        target[index] = source[index]

"""Units of work for the tests of those who share them out; quick to load, and on the path of workers."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

from msrd_ros.core.errors import UserError


def square(shared: int, number: int) -> int:
    return shared * number * number


def process(shared: None, number: int) -> tuple[int, int]:
    """Most threads of any library, and the process."""
    import numpy as np
    from threadpoolctl import threadpool_info

    np.ones((2, 2)) @ np.ones((2, 2))
    time.sleep(0.2)
    return max(library["num_threads"] for library in threadpool_info()), os.getpid()


def fail_at_two(shared: type[Exception], number: int) -> int:
    if number == 2:
        raise shared("two is too much")
    return number


def append(shared: list[int], number: int) -> list[int]:
    """Changes what it is given, which no other unit may see."""
    shared.append(number)
    return shared


def unpicklable(shared: None, number: int) -> object:
    return lambda: number


def die_at_two(shared: str, number: int, times: int) -> int:
    """The unit of number 2 ends its process the first so many times; `shared` is a folder for its marks."""
    marks = Path(shared)
    if number == 2 and len(list(marks.iterdir())) < times:
        (marks / str(time.monotonic_ns())).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def matrix(shared: None, number: int) -> bytes:
    """Large enough for BLAS to share out, if it had threads to do so."""
    import numpy as np

    values = np.random.default_rng(number).normal(size=(600, 600))
    return bytes((values @ values).tobytes())


def refuse(shared: None, number: int) -> None:
    raise UserError(f"{number}.yaml: is not there; give another")


def sleep(shared: float, number: int) -> None:
    time.sleep(shared)

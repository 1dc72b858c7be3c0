"""Times of messages: builtin_interfaces/Time and nanoseconds."""

from __future__ import annotations

from typing import Any

NANOSECONDS = 1_000_000_000


def stamp_to_ns(stamp: Any) -> int:
    """Time of a builtin_interfaces/Time in nanoseconds."""
    return int(stamp.sec) * NANOSECONDS + int(stamp.nanosec)


def ns_to_stamp(time_ns: int, stamp: Any) -> None:
    """Write a time in nanoseconds into a builtin_interfaces/Time."""
    stamp.sec, stamp.nanosec = divmod(int(time_ns), NANOSECONDS)

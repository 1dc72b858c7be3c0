"""How many processors a process may use."""

from __future__ import annotations

import os


def usable_processors() -> int:
    """As many as OMP_NUM_THREADS says, which workers have at 1; else all that the system grants."""
    said = os.environ.get("OMP_NUM_THREADS", "").partition(",")[0].strip()
    if said.isdecimal() and int(said):
        return int(said)
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1

"""A process that ends with the one that started it, however that one ends."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
from collections.abc import MutableMapping

STARTED_BY = "MSRD_ROS_STARTED_BY"
"""Environment variable with the process that a started one shall not outlive."""

_PR_SET_PDEATHSIG = 1


def end_with_parent(environment: MutableMapping[str, str]) -> None:
    """Let the kernel send SIGTERM to this process when the one that started it has ended (Linux).

    Of use against SIGKILL alone: whoever can still act stops what it has started itself. The variable is
    taken out, as it is not meant for what this process starts.
    """
    parent = environment.pop(STARTED_BY, "")
    if not parent or sys.platform != "linux":
        return
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() != int(parent):
        # It had ended before the kernel was asked.
        os.kill(os.getpid(), signal.SIGTERM)

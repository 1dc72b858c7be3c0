"""Ctrl-C and SIGTERM of a node: heard from its first import to its last clean-up step, and told once."""

from __future__ import annotations

import contextlib
import signal
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

from rclpy.utilities import ok

SHUTDOWN_S = 0.5
"""How long rclpy's own thread may take to shut down after a signal."""


class Interrupts:
    """Have Ctrl-C interrupt Python while a node is being made; from then on rclpy ends the node.

    A KeyboardInterrupt between any two steps of rclpy leaves half-made objects behind, which then complain.
    One raised in a callback that C calls, as LLVM does while functions are compiled, or in a finaliser, is
    printed by Python and forgotten; here it is remembered, and `leave_to_rclpy` raises it again.
    """

    def __init__(self) -> None:
        self._asked = False
        self._spins = False
        self._told: Callable[[Any], object] = sys.unraisablehook
        sys.unraisablehook = self._tell
        signal.signal(signal.SIGINT, self._interrupt)

    def leave_to_rclpy(self) -> None:
        """From here on rclpy answers Ctrl-C.

        Raises
        ------
        KeyboardInterrupt
            Ctrl-C came before, and Python forgot it.
        """
        self._spins = True
        if self._asked:
            raise KeyboardInterrupt

    def _interrupt(self, *_: object) -> None:
        self._asked = True
        if not self._spins:
            raise KeyboardInterrupt

    def _tell(self, unraisable: Any) -> None:
        if unraisable.exc_type is not KeyboardInterrupt:
            self._told(unraisable)


def ignore_signals() -> None:
    """Let no second Ctrl-C cut the clean-up short, and no first one that Python tells of only now."""
    for number in (signal.SIGINT, signal.SIGTERM):
        with contextlib.suppress(KeyboardInterrupt):
            signal.signal(number, signal.SIG_IGN)
        signal.signal(number, signal.SIG_IGN)


def is_shut_down() -> bool:
    """Whether a signal has shut rclpy down; it does so on a thread of its own, which may need a moment."""
    deadline_s = time.monotonic() + SHUTDOWN_S
    moment = threading.Event()
    while ok() and time.monotonic() < deadline_s:
        moment.wait(0.01)  # not time.sleep, which fails under libfaketime
    return not ok()

"""A Ctrl-C while a node is being made ends it, also where Python by itself would forget it."""

from __future__ import annotations

import subprocess
import sys

PROGRAM = """
import ctypes, signal
from msrd_ros.nodes.interrupts import Interrupts

interrupts = Interrupts()
try:
    {made}
    print("made")
    interrupts.leave_to_rclpy()
    signal.raise_signal(signal.SIGINT)
    print("spins")
except KeyboardInterrupt:
    print("interrupted")
"""
INTERRUPT = "signal.raise_signal(signal.SIGINT)"
FORGOTTEN = "ctypes.CFUNCTYPE(None)(lambda: signal.raise_signal(signal.SIGINT))()"
OTHER = "ctypes.CFUNCTYPE(None)(lambda: 1 / 0)()"


def said(made: str) -> tuple[list[str], str]:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM.format(made=made)], capture_output=True, text=True, check=True
    )
    return done.stdout.split(), done.stderr


def test_an_interrupt_ends_what_is_being_made() -> None:
    assert said(INTERRUPT) == (["interrupted"], "")


def test_an_interrupt_in_a_callback_of_c_is_raised_before_the_node_spins() -> None:
    assert said(FORGOTTEN) == (["made", "interrupted"], "")


def test_an_interrupt_of_a_node_that_spins_is_left_to_rclpy() -> None:
    assert said("pass") == (["made", "spins"], "")


def test_other_errors_in_callbacks_are_still_told() -> None:
    words, told = said(OTHER)
    assert words == ["made", "spins"]
    assert "ZeroDivisionError" in told

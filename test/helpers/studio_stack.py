"""A stack with a studio: simulator, executor with the policies that come with the arm, and the page."""

from __future__ import annotations

import socket

from msrd_ros.core.resources import share_directory
from msrd_ros.studio.guard import LOOPBACK
from processes import RunningProcess
from stack import START_TIMEOUT_S, Stack

FRAMES_HZ = 5.0
POLICIES = share_directory() / "config" / "robots" / "sawyer" / "policies.safetensors"


def free_port() -> int:
    """A port that nobody has now."""
    with socket.socket() as one:
        one.bind((LOOPBACK, 0))
        return int(one.getsockname()[1])


def start_studio(stack: Stack, **parameters: object) -> str:
    """Start all three on a stack's domain; the page's address, once it is served."""
    stack.start_simulator(seed=3, rate=0.5)
    stack.start("executor", checkpoint=str(POLICIES))
    return wait_for_page(stack, start_page(stack, **parameters))


def start_page(stack: Stack, **parameters: object) -> RunningProcess:
    """A studio alone; with few pictures a second, as a browser without a graphics processor draws slowly."""
    return stack.start("studio", port=free_port(), frames_hz=FRAMES_HZ, **parameters)


def wait_for_page(stack: Stack, studio: RunningProcess) -> str:
    """The address that a studio prints."""

    def printed() -> str:
        words = [line.split()[-1] for line in studio.output.splitlines() if line.startswith("studio: open")]
        return words[0] if words else ""

    return str(stack.wait_until(printed, "page", START_TIMEOUT_S, studio))

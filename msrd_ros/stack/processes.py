"""Nodes as processes: started, watched and stopped for recipes that need several of them."""

from __future__ import annotations

import contextlib
import os
import random
import signal
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self

from msrd_ros.core.errors import UserError

STOP_TIMEOUT_S = 30.0


def own_domain() -> dict[str, str]:
    """Environment of nodes that shall meet each other and nobody else; a ROS_DOMAIN_ID that is set stays."""
    environment = dict(os.environ)
    environment.setdefault("ROS_DOMAIN_ID", str(random.SystemRandom().randrange(1, 102)))
    environment.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    environment.setdefault("HOME", str(Path.cwd()))
    return environment


def ros_arguments(parameters: Mapping[str, Any]) -> list[str]:
    """Parameters as they stand on a command line."""
    words = ["--ros-args"]
    for name, value in parameters.items():
        if isinstance(value, list | tuple):
            text = "[" + ", ".join(map(str, value)) + "]"
        else:
            text = str(value).lower() if isinstance(value, bool) else str(value)
        words += ["-p", f"{name}:={text}"]
    return words


class NodeProcess:
    """One executable of this package as a process of its own.

    Parameters
    ----------
    name
        Of the executable.
    parameters
        Its ROS parameters.
    environment
        Of the process.
    log
        File for what it prints; None lets it write to the terminal.
    """

    def __init__(
        self, name: str, parameters: Mapping[str, Any], environment: Mapping[str, str], log: Path | None
    ) -> None:
        self.name = name
        self._log = log
        command = [sys.executable, "-m", "msrd_ros", name, *ros_arguments(parameters)]
        if log is None:
            self._process = subprocess.Popen(command, env=dict(environment))
        else:
            log.parent.mkdir(parents=True, exist_ok=True)
            with log.open("ab") as file:
                self._process = subprocess.Popen(
                    command, env=dict(environment), stdout=file, stderr=subprocess.STDOUT
                )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def wait(self, others: tuple[NodeProcess, ...] = ()) -> None:
        """Wait until it has done its work.

        Raises
        ------
        UserError
            If it or one of `others` fails; names it and its log.
        """
        while True:
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(0.2)
            if self.has_ended():
                return
            for other in others:
                other.require_alive()

    def has_ended(self) -> bool:
        """Whether it has done its work.

        Raises
        ------
        UserError
            If it has failed; names it and its log.
        """
        code = self._process.poll()
        if code:
            raise UserError(f"{self.name} failed with exit status {code}{self._where()}")
        return code == 0

    def require_alive(self) -> None:
        """Complain if it has ended.

        Raises
        ------
        UserError
            Names it and its log.
        """
        code = self._process.poll()
        if code is not None:
            raise UserError(f"{self.name} ended early with exit status {code}{self._where()}")

    def stop(self) -> None:
        """Ask it to end, and insist if it does not."""
        if self._process.poll() is not None:
            return
        self._process.send_signal(signal.SIGINT)
        try:
            self._process.wait(STOP_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _where(self) -> str:
        if self._log is None:
            return ""
        lines = self._log.read_text(errors="replace").strip().splitlines()
        return f"; {self._log} ends with: {lines[-1] if lines else 'nothing'}"

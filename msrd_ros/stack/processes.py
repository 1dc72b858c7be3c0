"""Nodes as processes: started, watched and stopped for recipes that need several of them."""

from __future__ import annotations

import contextlib
import json
import os
import random
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Self

from msrd_ros.core.discovery import stay_on_this_machine
from msrd_ros.core.errors import UserError
from msrd_ros.core.parent import STARTED_BY
from msrd_ros.stack.console import Console

STOP_TIMEOUT_S = 30.0
INSIST_TIMEOUT_S = 5.0
_LAST_WORDS_S = 1.0
"""How long to wait for what a process printed before its end."""


class NodeLostError(UserError):
    """A node has ended that was still needed."""


def own_domain() -> dict[str, str]:
    """Environment of nodes that shall meet each other and nobody else; a ROS_DOMAIN_ID that is set stays."""
    environment = dict(os.environ)
    environment.setdefault("ROS_DOMAIN_ID", str(random.SystemRandom().randrange(1, 102)))
    stay_on_this_machine(environment)
    environment.setdefault("HOME", str(Path.cwd()))
    return environment


def ros_arguments(parameters: Mapping[str, Any], options: Sequence[str] = ()) -> list[str]:
    """ROS options and parameters as they stand on a command line; quoted, so that text stays text."""
    words = ["--ros-args", *options]
    for name, value in parameters.items():
        words += ["-p", f"{name}:={json.dumps(value, default=str, ensure_ascii=False)}"]
    return words


class NodeProcess:
    """One executable of this package as a process of its own, which ends with this process.

    It is in a process group of its own: Ctrl-C reaches this process only, which then stops one after another.

    Parameters
    ----------
    name
        Of the executable.
    parameters
        Its ROS parameters.
    environment
        Of the process.
    output
        File for what it prints, or who prints it line by line; None lets it write to the terminal.
    options
        Further ROS arguments, before the parameters.
    """

    def __init__(
        self,
        name: str,
        parameters: Mapping[str, Any],
        environment: Mapping[str, str],
        output: Path | Console | None,
        options: Sequence[str] = (),
    ) -> None:
        self.name = name
        self._output = output
        self._reader: threading.Thread | None = None
        self._started_s = time.monotonic()
        executable = name.rpartition("/")[2]
        command = [sys.executable, "-m", "msrd_ros", executable, *ros_arguments(parameters, options)]
        variables = {**environment, STARTED_BY: str(os.getpid())}
        with contextlib.ExitStack() as stack:
            target: Any = None
            if isinstance(output, Console):
                output.forget(name)
                target = subprocess.PIPE
            elif output is not None:
                output.parent.mkdir(parents=True, exist_ok=True)
                target = stack.enter_context(output.open("ab"))
            self._process = subprocess.Popen(
                command,
                env=variables,
                stdin=subprocess.DEVNULL,
                stdout=target,
                stderr=None if target is None else subprocess.STDOUT,
                process_group=0,
            )
        if isinstance(output, Console):
            assert self._process.stdout is not None
            self._reader = output.follow(name, self._process.stdout)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    @property
    def ran_s(self) -> float:
        """How long ago it was started."""
        return time.monotonic() - self._started_s

    @property
    def exit_status(self) -> int | None:
        """Its exit status, a signal's number below zero; None while it runs."""
        return self._process.poll()

    def wait(self, others: tuple[NodeProcess, ...] = ()) -> None:
        """Wait until it has done its work.

        Raises
        ------
        NodeLostError
            If it or one of `others` fails; names it, how it ended and what it said last.
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
        NodeLostError
            If it has failed; names it, how it ended and what it said last.
        """
        code = self.exit_status
        if code:
            raise NodeLostError(self.describe_end())
        return code == 0

    def require_alive(self) -> None:
        """Complain if it has ended.

        Raises
        ------
        NodeLostError
            Names it, how it ended and what it said last.
        """
        if self.exit_status is not None:
            raise NodeLostError(self.describe_end())

    def describe_end(self) -> str:
        """How it has ended, and what it said last."""
        code = self._process.poll() or 0
        if code < 0:
            end = f"was ended by signal {-code} ({signal.Signals(-code).name})"
        else:
            end = f"ended with exit status {code}" if code else "ended early, with exit status 0"
        return f"{self.name} {end}; {self._last_words()}"

    def ask_to_end(self) -> None:
        """Ask it to end, and wait for nothing."""
        self._process.send_signal(signal.SIGINT)

    def stop(self) -> None:
        """Ask it to end, and insist if it does not."""
        for number, patience_s in ((signal.SIGINT, STOP_TIMEOUT_S), (signal.SIGTERM, INSIST_TIMEOUT_S)):
            if self._process.poll() is not None:
                break
            self._process.send_signal(number)
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(patience_s)
        if self._process.poll() is None:
            if isinstance(self._output, Console):
                self._output.say("up", f"{self.name} does not end when it is asked to; it is killed")
            os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()
        self._hear_out()

    def _hear_out(self) -> None:
        if self._reader is not None:
            self._reader.join(_LAST_WORDS_S)

    def _last_words(self) -> str:
        self._hear_out()
        if isinstance(self._output, Console):
            return self._output.last_words(self.name)
        if self._output is None:
            return "see its lines above"
        lines = self._output.read_text(errors="replace").strip().splitlines()
        return f"{self._output} ends with: {lines[-1] if lines else 'nothing'}"

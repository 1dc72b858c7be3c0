"""Executables as processes of their own, found the way `ros2 run` finds them."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from unittest import mock

from ament_index_python.packages import get_package_prefix

CHECKOUT = Path(__file__).resolve().parents[2]
PACKAGE = "msrd_ros"
START_TIMEOUT_S = 60.0
STOP_TIMEOUT_S = 30.0


@dataclass(frozen=True)
class Installation:
    """One way in which the package is there: the checkout, a pip environment or a colcon overlay.

    Parameters
    ----------
    name
        For messages.
    variables
        Environment variables of its processes, on top of this process's own.
    checkout
        True where there is no ament index and `python -m msrd_ros` stands in for `ros2 run`.
    """

    name: str
    variables: Mapping[str, str] = field(default_factory=dict)
    checkout: bool = False

    def environment(self) -> dict[str, str]:
        """Environment of a process that runs in this installation."""
        return {**os.environ, **self.variables}

    def prefix(self) -> Path:
        """Where the ament index says that the package is."""
        with mock.patch.dict(os.environ, self.environment(), clear=True):
            return Path(get_package_prefix(PACKAGE))

    def share(self) -> Path:
        """Directory of the package's own files."""
        return CHECKOUT if self.checkout else self.prefix() / "share" / PACKAGE

    def executable(self, name: str) -> Path:
        """Find an executable as `ros2 run` does: the ament index, then ``lib/<package>`` of that prefix."""
        directory = self.prefix() / "lib" / PACKAGE
        found = [path for path in directory.rglob(name) if path.is_file() and os.access(path, os.X_OK)]
        assert len(found) == 1, f"{self.name}: {len(found)} executables {name} in {directory}"
        return found[0]

    def command(self, name: str) -> list[str]:
        """Command line that starts an executable."""
        if self.checkout:
            return [sys.executable, "-m", PACKAGE, name]
        return [str(self.executable(name))]


class RunningProcess:
    """A started executable; its output is read as it comes.

    Parameters
    ----------
    name
        For messages.
    command, environment, directory
        What to start, and where.
    """

    def __init__(
        self, name: str, command: Sequence[str], environment: Mapping[str, str], directory: Path
    ) -> None:
        self.name = name
        self._lines: list[str] = []
        self._ended = False
        self._changed = threading.Condition()
        self._process = subprocess.Popen(
            command,
            env=dict(environment),
            cwd=directory,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    @property
    def output(self) -> str:
        """Everything printed so far, both streams."""
        with self._changed:
            return "".join(self._lines)

    @property
    def pid(self) -> int:
        """Of the process."""
        return self._process.pid

    @property
    def running(self) -> bool:
        """Whether the process has not ended yet."""
        return self._process.poll() is None

    def wait_for_line(self, pattern: str, timeout_s: float = START_TIMEOUT_S) -> re.Match[str]:
        """Wait until the output has a match for a regular expression; fail if the process ends before."""
        deadline = time.monotonic() + timeout_s
        with self._changed:
            while True:
                match = re.search(pattern, "".join(self._lines), re.MULTILINE)
                if match:
                    return match
                left = deadline - time.monotonic()
                assert not self._ended, f"ended without {pattern!r}\n{self._report()}"
                assert left > 0, f"no {pattern!r} in {timeout_s} s\n{self._report()}"
                self._changed.wait(left)

    def wait(self, timeout_s: float = STOP_TIMEOUT_S) -> int:
        """Wait for the end of the process; its exit status."""
        try:
            code = self._process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            raise AssertionError(f"still running after {timeout_s} s\n{self._report()}") from None
        self._reader.join(timeout_s)
        return code

    def cpu_seconds(self) -> float:
        """Processor time that the process has used so far (Linux)."""
        fields = Path("/proc", str(self._process.pid), "stat").read_text().rsplit(")", 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def send_signal(self, signal_number: int) -> None:
        """Send a signal and go on."""
        self._process.send_signal(signal_number)

    def stop(self, signal_number: int = signal.SIGINT, timeout_s: float = STOP_TIMEOUT_S) -> int:
        """Ask the process to stop; its exit status."""
        self._process.send_signal(signal_number)
        return self.wait(timeout_s)

    def kill(self) -> None:
        """End the process at once, if it still runs."""
        if self.running:
            self._process.kill()
        self._process.wait()
        self._reader.join()

    def require_running(self) -> None:
        """Fail with the output if the process has ended."""
        assert self.running, f"ended with {self._process.returncode}\n{self._report()}"

    def _report(self) -> str:
        return f"--- {self.name} printed:\n{''.join(self._lines[-40:])}"

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            with self._changed:
                self._lines.append(line)
                self._changed.notify_all()
        with self._changed:
            self._ended = True
            self._changed.notify_all()


class Launcher:
    """Starts executables on one ROS domain and ends them all at the end of a test.

    Parameters
    ----------
    installation
        Where executables are found.
    domain_id
        ROS domain of the processes.
    directory
        Their working directory.
    """

    def __init__(self, installation: Installation, domain_id: int, directory: Path) -> None:
        self.installation = installation
        self._variables = {**installation.environment(), "ROS_DOMAIN_ID": str(domain_id)}
        self._directory = CHECKOUT if installation.checkout else directory
        self._started: list[RunningProcess] = []

    def set(self, variable: str, value: str) -> None:
        """Set an environment variable of the processes to come."""
        self._variables[variable] = value

    def unset(self, variable: str) -> None:
        """Take an environment variable from the processes to come."""
        self._variables.pop(variable, None)

    def start(
        self, name: str, *arguments: str, parameters: Mapping[str, object] | None = None
    ) -> RunningProcess:
        """Start an executable.

        Parameters
        ----------
        name
            For example ``simulator``.
        arguments
            Its command line.
        parameters
            ROS parameters, appended as ``--ros-args -p name:=value``.
        """
        command = [*self.installation.command(name), *arguments]
        if parameters:
            command.append("--ros-args")
            for key, value in parameters.items():
                command += ["-p", f"{key}:={_parameter_text(value)}"]
        process = RunningProcess(name, command, self._variables, self._directory)
        self._started.append(process)
        return process

    def close(self) -> None:
        """End whatever still runs."""
        for process in reversed(self._started):
            process.kill()


def _parameter_text(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)

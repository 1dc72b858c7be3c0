"""Workers of this machine: this process itself, or some that it starts."""

from __future__ import annotations

import multiprocessing
import signal
from collections import deque
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess

from msrd_ros.cluster.unit import Call, become_worker
from msrd_ros.cluster.workers import Death, Workers

_PATIENCE_S = 5.0


class ThisProcess(Workers):
    """One unit after the other, here."""

    def __init__(self) -> None:
        self._done: deque[tuple[int, bytes]] = deque()

    def close(self) -> None:
        """Nothing to end."""

    def slots(self) -> int:
        """One."""
        return 1

    def share(self, data: bytes) -> bytes:
        """The data."""
        return data

    def begin(self, ticket: int, call: Call, shared: bytes) -> None:
        """Make the call."""
        self._done.append((ticket, call.perform(shared)))

    def next_done(self) -> tuple[int, bytes | Death]:
        """What was just done."""
        return self._done.popleft()


@dataclass
class _Worker:
    """A process that is there, and what it does.

    Attributes
    ----------
    holds
        Data for many units that it was sent; None: none yet.
    ticket
        Of the unit under way; None: it is free.
    """

    process: SpawnProcess
    connection: Connection
    holds: bytes | None = None
    ticket: int | None = None

    def end(self) -> None:
        """At once, whatever it does."""
        self.connection.close()
        self.process.kill()
        self.process.join(_PATIENCE_S)


class Processes(Workers):
    """Processes of this machine, started when they are first needed.

    Each takes one unit at a time, so that it is known whose unit is lost with it.

    Parameters
    ----------
    count
        How many; results do not depend on it.
    """

    def __init__(self, count: int) -> None:
        self._count = count
        self._workers: list[_Worker] = []

    def close(self) -> None:
        """End all, also those at work."""
        while self._workers:
            self._workers.pop().end()

    def slots(self) -> int:
        """As many as processes."""
        return self._count

    def share(self, data: bytes) -> bytes:
        """The data; each process gets it with the first unit that needs it."""
        return data

    def begin(self, ticket: int, call: Call, shared: bytes) -> None:
        """Send it to a process that is free."""
        worker = next((worker for worker in self._workers if worker.ticket is None), None)
        if worker is None:
            worker = _start()
            self._workers.append(worker)
        worker.ticket = ticket
        # One that has died is noticed in `next_done`, as its end of the pipe is closed.
        with suppress(BrokenPipeError, ConnectionResetError):
            worker.connection.send((call, None if worker.holds is shared else shared))
            worker.holds = shared

    def next_done(self) -> tuple[int, bytes | Death]:
        """Wait for the processes' answers, and for their ends."""
        busy = {worker.connection: worker for worker in self._workers if worker.ticket is not None}
        ready = wait(list(busy))[0]
        assert isinstance(ready, Connection)
        worker = busy[ready]
        ticket, worker.ticket = worker.ticket, None
        assert ticket is not None
        try:
            return ticket, ready.recv_bytes()
        except (EOFError, ConnectionResetError):
            self._workers.remove(worker)
            worker.process.join(_PATIENCE_S)
            code = worker.process.exitcode
            worker.end()
            return ticket, Death(f"its process ended {_how(code)}")


def _start() -> _Worker:
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe()
    process = context.Process(target=_serve, args=(there,), daemon=True)
    process.start()
    # The other end is the process's alone, so that its end ends the connection.
    there.close()
    return _Worker(process, here)


def _serve(connection: Connection) -> None:
    """Answer calls until whoever started this process is gone."""
    # Ctrl-C at a terminal goes to all processes; what becomes of units is decided by who shared them out.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    become_worker()
    shared = b""
    with suppress(EOFError, BrokenPipeError, ConnectionResetError):
        while True:
            call, data = connection.recv()
            shared = shared if data is None else data
            connection.send_bytes(call.perform(shared))


def _how(code: int | None) -> str:
    if code is not None and code < 0:
        return f"by {signal.Signals(-code).name}"
    return f"with status {code}"

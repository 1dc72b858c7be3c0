"""Workers on Ray, this machine's own or a cluster's; nobody else imports it, and this only on demand."""

from __future__ import annotations

import os
import re
import socket
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any

from msrd_ros.cluster.unit import Call, become_worker
from msrd_ros.cluster.workers import Death, Workers
from msrd_ros.core.errors import UserError

ADDRESS_VARIABLE = "RAY_ADDRESS"
OBJECT_STORE_BYTES = 256 * 2**20
"""Of a Ray of our own: what goes through it are policies and results, a few MB each."""
_COUNTING_PERIOD_S = 1.0
_CONNECT_S = 10.0
_LOOPBACK = re.compile(r"(?:ray://)?(?:127\.|localhost:)")


class RayWorkers(Workers):
    """Processes that Ray starts, one for each processor that it has.

    Parameters
    ----------
    address
        Of a cluster, as Ray says it (``HOST:PORT``, ``auto`` or ``ray://HOST:PORT``); None starts a Ray on
        this machine that ends with this object.
    processors
        Of a Ray of our own.

    Raises
    ------
    UserError
        If Ray is not installed, or nobody answers there.
    """

    def __init__(self, address: str | None, processors: int) -> None:
        self._where = address or "this machine"
        with _environment(stays_here=address is None or bool(_LOOPBACK.match(address))):
            try:
                import ray
            except ModuleNotFoundError as error:
                raise UserError(
                    f"Ray was asked for, and {error.name} is not installed; `pip install 'msrd_ros[ray]'`"
                ) from None
            self._ray = ray
            if address is not None:
                self._require_listener(address)
            # On the main thread `init` would take away whoever handles SIGTERM there. The kernel ends the
            # processes of a local Ray with the thread that started them, so this one stays.
            self._thread = ThreadPoolExecutor(1, thread_name_prefix="ray")
            own = {
                "num_cpus": processors,
                "include_dashboard": False,
                "object_store_memory": OBJECT_STORE_BYTES,
            }
            quiet: dict[str, Any] = {"log_to_driver": False, "logging_level": "error"}
            arguments = own | quiet if address is None else quiet
            try:
                self._thread.submit(ray.init, address or "local", **arguments).result()
            except (OSError, RuntimeError, ValueError, ray.exceptions.RayError) as error:
                self._thread.shutdown()
                raise self._nobody(error) from None
        self._perform = ray.remote(num_cpus=1, max_retries=0)(_perform)
        self._running: dict[Any, int] = {}
        self._counted_s, self._count = -_COUNTING_PERIOD_S, 0

    def _require_listener(self, address: str) -> None:
        """Where nobody listens, Ray would go on trying for minutes."""
        place = re.fullmatch(r"(?:ray://)?(.+):(\d{1,5})", address)
        if place is None:
            return
        try:
            socket.create_connection((place[1], int(place[2])), _CONNECT_S).close()
        except (OSError, OverflowError) as error:
            raise self._nobody(error) from None

    def _nobody(self, error: Exception) -> UserError:
        reason = next(iter(str(error).strip().splitlines()), type(error).__name__)
        return UserError(f"no Ray at {self._where}: {reason}; start it there, or give another address")

    def close(self) -> None:
        """Leave the cluster, with what is under way there, or end the Ray of our own."""
        self._thread.submit(self._ray.shutdown).result()
        self._thread.shutdown()

    def slots(self) -> int:
        """Processors of all machines that are there now: some may come, and some may be lost."""
        if time.monotonic() - self._counted_s >= _COUNTING_PERIOD_S:
            self._count = int(self._ray.cluster_resources().get("CPU", 0))
            self._counted_s = time.monotonic()
        return self._count

    def share(self, data: bytes) -> Any:
        """An object of Ray, which each machine fetches once."""
        return self._ray.put(data)

    def begin(self, ticket: int, call: Call, shared: Any) -> None:
        """Hand the call to Ray."""
        self._running[self._perform.remote(call, shared)] = ticket

    def next_done(self) -> tuple[int, bytes | Death]:
        """Wait for an answer, or for the news that a process or a machine is lost."""
        errors = self._ray.exceptions
        try:
            (done, *_), _ = self._ray.wait(list(self._running), num_returns=1)
            ticket = self._running.pop(done)
            answer: bytes = self._ray.get(done)
        except (
            errors.LocalRayletDiedError,
            errors.NodeDiedError,
            errors.ObjectLostError,
            errors.OutOfMemoryError,
            errors.WorkerCrashedError,
        ) as error:
            return ticket, Death(f"its process or machine was lost ({type(error).__name__})")
        except ConnectionError as error:
            raise UserError(
                f"the connection to Ray at {self._where} is lost ({error}); what was done is kept, and the "
                "same command goes on from there"
            ) from None
        return ticket, answer


@contextmanager
def _environment(stays_here: bool) -> Iterator[None]:
    """What Ray reads as it is imported and started, and the processes that it starts inherit."""
    # Nothing of what Ray is used for goes to its makers.
    wanted = {"RAY_USAGE_STATS_ENABLED": "0"}
    if stays_here:
        # What keeps Ray to the loopback interface, on Linux as well; else it takes 127.0.0.1 for the other
        # address of the machine, where a Ray that was started on loopback does not answer.
        wanted["RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER"] = "0"
    before = {name: os.environ.get(name) for name in wanted}
    os.environ.update(wanted)
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name)
            if value is not None:
                os.environ[name] = value


def _perform(call: Call, shared: bytes) -> bytes:
    """In a process of Ray's."""
    become_worker()
    return call.perform(shared)

"""The one way in which work is shared out, whoever does it: units go out, results come in as they are done.

A unit is a function of the package with arguments that pickle. It depends on nothing else, so that results
are the same, bit for bit, on one worker or on many, in whatever order they finish. A unit that fails by
itself does not stop the others; one whose worker dies is tried again.
"""

from __future__ import annotations

import pickle
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Self

from msrd_ros.cluster.unit import Call, Failure, Unit
from msrd_ros.core.errors import UserError

ATTEMPTS = 3
"""How often a unit is begun whose worker dies each time."""
_SHOWN = 3
"""Failures whose tracebacks an error shows; more of them are mostly the same."""


def silent(line: str) -> None:
    """Tell nobody."""


class UnitsError(Exception):
    """Some units have no result; the message has their names and tracebacks. All others were handed on."""


@dataclass(frozen=True)
class Death:
    """A worker ended, or its machine was lost, before its unit was done.

    Attributes
    ----------
    how
        In words that go on after "its unit: ".
    """

    how: str


class Workers(ABC):
    """Whoever does units of work. Use as a context, or `close`.

    What is below `run` is for those who make a new kind of workers.
    """

    def run(
        self,
        function: Callable[..., Any],
        units: Iterable[Unit],
        keep: Callable[[Unit, Any], None],
        shared: Any = None,
        told: Callable[[str], None] = silent,
    ) -> None:
        """Do units, as many at a time as there are workers.

        On KeyboardInterrupt no more units are begun; those under way are still finished and kept, unless
        there is another one.

        Parameters
        ----------
        function
            Of a module, called with `shared` and a unit's arguments.
        units
            In the order in which they are begun.
        keep
            Called here with each unit and its result, in the order in which they finish.
        shared
            What all units need; goes to a worker or machine once.
        told
            Told how many are done, and which failed.

        Raises
        ------
        UnitsError
            After all others are done, if units failed.
        UserError
            The same, if all that failed was the user's to mend.
        """
        _Round(self, function, list(units), keep, told).run(self.share(pickle.dumps(shared)))

    def map(
        self, function: Callable[..., Any], arguments: Sequence[tuple[Any, ...]], shared: Any = None
    ) -> list[Any]:
        """Results of units that have no names, in the order of their arguments; see `run`."""
        results: list[Any] = [None] * len(arguments)

        def keep(unit: Unit, result: Any) -> None:
            results[int(unit.name)] = result

        self.run(function, [Unit(str(i), given) for i, given in enumerate(arguments)], keep, shared)
        return results

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @abstractmethod
    def close(self) -> None:
        """End all workers, also those at work."""

    @abstractmethod
    def slots(self) -> int:
        """How many units may be under way now."""

    @abstractmethod
    def share(self, data: bytes) -> Any:
        """What `begin` takes for data that many units need."""

    @abstractmethod
    def begin(self, ticket: int, call: Call, shared: Any) -> None:
        """Let a worker that is free make the call; `next_done` gives the ticket back."""

    @abstractmethod
    def next_done(self) -> tuple[int, bytes | Death]:
        """Wait until one of the calls is done: its ticket, and the answer or why there is none."""


class _Round:
    """One `Workers.run`."""

    def __init__(
        self,
        workers: Workers,
        function: Callable[..., Any],
        units: list[Unit],
        keep: Callable[[Unit, Any], None],
        told: Callable[[str], None],
    ) -> None:
        self._workers, self._function, self._units = workers, function, units
        self._keep, self._told = keep, told
        self._waiting = deque(range(len(units)))
        self._running: set[int] = set()
        self._attempts = [0] * len(units)
        self._failures: dict[int, Failure] = {}
        self._done = 0
        self._began_s = time.monotonic()

    def run(self, shared: Any) -> None:
        try:
            while self._waiting or self._running:
                # One at least: Ray itself waits for machines that are still to come.
                while self._waiting and len(self._running) < max(self._workers.slots(), 1):
                    self._begin(self._waiting.popleft(), shared)
                self._settle(*self._workers.next_done())
        except KeyboardInterrupt:
            self._waiting.clear()
            if self._running:
                self._told(f"{len(self._running)} under way are finished first; interrupt again to lose them")
            while self._running:
                self._settle(*self._workers.next_done())
            raise
        if self._failures:
            raise self._error()

    def _begin(self, ticket: int, shared: Any) -> None:
        self._attempts[ticket] += 1
        self._workers.begin(ticket, Call(self._function, self._units[ticket].arguments), shared)
        self._running.add(ticket)

    def _settle(self, ticket: int, answer: bytes | Death) -> None:
        self._running.remove(ticket)
        unit = self._units[ticket]
        if isinstance(answer, Death):
            if self._attempts[ticket] < ATTEMPTS:
                self._told(f"{unit.name}: {answer.how}; tried again ({self._attempts[ticket]} of {ATTEMPTS})")
                self._waiting.appendleft(ticket)
                return
            result: Any = Failure(f"{answer.how}; so it was {ATTEMPTS} times")
        else:
            result = pickle.loads(answer)
        if isinstance(result, Failure):
            self._failures[ticket] = result
            self._told(f"{unit.name} failed: {result.text.strip().splitlines()[-1]}")
            return
        self._keep(unit, result)
        self._done += 1
        self._told(f"{self._done} of {len(self._units)} done{self._left()}: {unit.name}")

    def _left(self) -> str:
        """About how long the rest takes, once something can be said of it."""
        rest = len(self._units) - self._done - len(self._failures)
        if not rest:
            return ""
        seconds = (time.monotonic() - self._began_s) / self._done * rest
        return f", about {seconds / 60:.0f} min left" if seconds >= 60 else f", about {seconds:.0f} s left"

    def _error(self) -> Exception:
        failures = {self._units[ticket].name: failure for ticket, failure in sorted(self._failures.items())}
        if all(failure.is_users for failure in failures.values()):
            return UserError(next(iter(failures.values())).text)
        shown = [f"-- {name} --\n{failure.text}" for name, failure in list(failures.items())[:_SHOWN]]
        more = f"\n... and {', '.join(list(failures)[_SHOWN:])}" if len(failures) > _SHOWN else ""
        return UnitsError(
            f"{len(failures)} of {len(self._units)} failed: {', '.join(failures)}\n" + "\n".join(shown) + more
        )

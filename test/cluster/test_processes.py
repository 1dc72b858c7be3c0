"""Units shared out on this machine: the same results wherever they are done, and what fails stays alone."""

from __future__ import annotations

import os
import pickle
import signal
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import units
from msrd_ros.cluster import unit as unit_module
from msrd_ros.cluster.places import Place
from msrd_ros.cluster.processes import Processes, ThisProcess
from msrd_ros.cluster.unit import Unit
from msrd_ros.cluster.workers import ATTEMPTS, UnitsError, Workers
from msrd_ros.core.errors import UserError


def numbered(count: int, *more: Any) -> list[Unit]:
    return [Unit(f"unit {number}", (number, *more)) for number in range(count)]


def run(workers: Workers, function: Callable[..., Any], count: int, shared: Any, *more: Any) -> Kept:
    kept = Kept()
    try:
        workers.run(function, numbered(count, *more), kept.keep, shared, kept.told.append)
    except (UnitsError, UserError) as error:
        kept.error = error
    return kept


class Kept:
    """What came of some units."""

    def __init__(self) -> None:
        self.results: dict[str, Any] = {}
        self.told: list[str] = []
        self.error: Exception | None = None

    def keep(self, unit: Unit, result: Any) -> None:
        self.results[unit.name] = result


@pytest.mark.parametrize("count", [0, 1, 3])
def test_results_come_in_the_order_of_their_arguments(count: int) -> None:
    with Place().open(count) as workers:
        assert workers.map(units.square, [(number,) for number in range(7)], 2) == [
            2 * number * number for number in range(7)
        ]
        assert workers.map(units.square, [], 2) == []


@pytest.mark.parametrize("count", [0, 2])
def test_a_unit_that_fails_is_told_with_its_traceback_and_takes_none_along(count: int) -> None:
    with Place().open(count) as workers:
        kept = run(workers, units.fail_at_two, 5, ValueError)
    assert kept.results == {f"unit {number}": number for number in (0, 1, 3, 4)}
    assert isinstance(kept.error, UnitsError)
    assert "1 of 5 failed: unit 2" in str(kept.error)
    assert 'raise shared("two is too much")' in str(kept.error)
    assert "unit 2 failed: ValueError: two is too much" in kept.told
    assert any(line.startswith("4 of 5 done") for line in kept.told)


def test_what_the_user_can_mend_stays_one_line() -> None:
    kept = run(ThisProcess(), units.refuse, 2, None)
    assert isinstance(kept.error, UserError)
    assert str(kept.error) == "0.yaml: is not there; give another"


def test_a_result_that_does_not_pickle_is_a_failure() -> None:
    kept = run(ThisProcess(), units.unpicklable, 1, None)
    assert "pickle" in str(kept.error)


def test_units_do_not_see_what_others_changed() -> None:
    with Processes(1) as workers:
        assert workers.map(units.append, [(1,), (2,)], [0]) == [[0, 1], [0, 2]]


def test_a_unit_whose_process_dies_is_tried_again(tmp_path: Path) -> None:
    with Processes(2) as workers:
        kept = run(workers, units.die_at_two, 5, str(tmp_path), ATTEMPTS - 1)
    assert kept.error is None
    assert kept.results == {f"unit {number}": number for number in range(5)}
    again = [line for line in kept.told if "tried again" in line]
    assert again == [
        f"unit 2: its process ended by SIGKILL; tried again ({attempt} of {ATTEMPTS})"
        for attempt in range(1, ATTEMPTS)
    ]


def test_a_unit_that_always_dies_is_given_up_and_takes_none_along(tmp_path: Path) -> None:
    with Processes(2) as workers:
        kept = run(workers, units.die_at_two, 5, str(tmp_path), ATTEMPTS)
        assert sorted(kept.results) == [f"unit {number}" for number in (0, 1, 3, 4)]
        assert "SIGKILL; so it was 3 times" in str(kept.error)
        # The others go on working.
        assert workers.map(units.square, [(3,)], 1) == [9]


def test_one_thread_each_and_no_more_processes_than_asked_for() -> None:
    with Processes(2) as workers:
        found = workers.map(units.process, [(number,) for number in range(6)])
    assert {count for count, _ in found} == {1}
    assert len({process for _, process in found}) == 2
    for _, process in found:
        with pytest.raises(ProcessLookupError):
            os.kill(process, 0)


def test_same_bits_in_this_process_and_in_others() -> None:
    arguments = [(number,) for number in range(3)]
    expected = ThisProcess().map(units.matrix, arguments)
    for count in (1, 2):
        with Processes(count) as workers:
            assert workers.map(units.matrix, arguments) == expected


def test_other_code_at_the_worker_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(unit_module, "fingerprint", lambda: (("Python", "2.7"),))
    call = unit_module.Call(units.square, (1,))
    monkeypatch.setattr(unit_module, "fingerprint", lambda: (("Python", "3.0"),))
    answer = pickle.loads(call.perform(pickle.dumps(1)))
    assert answer.is_users
    assert "has Python 3.0, and here it is 2.7: install the same" in answer.text


def test_interrupted_what_is_under_way_is_kept_and_nothing_else_begun() -> None:
    """As by Ctrl-C at a terminal, which goes to the workers as well."""
    kept = Kept()

    def keep(unit: Unit, result: Any) -> None:
        kept.keep(unit, result)
        if len(kept.results) == 1:
            os.kill(result[1], signal.SIGINT)
            raise KeyboardInterrupt

    with Processes(2) as workers, pytest.raises(KeyboardInterrupt):
        workers.run(units.process, numbered(9), keep, None, kept.told.append)
    assert 2 <= len(kept.results) <= 3
    assert any("finished first" in line for line in kept.told)


def test_closing_ends_those_at_work() -> None:
    workers = Processes(1)
    workers.map(units.square, [(1,)], 1)
    kept, noticed = Kept(), threading.Event()

    def interrupt() -> None:
        # Python drops an interrupt that comes while it collects garbage; a person would press again, too.
        while not noticed.wait(0.5):
            os.kill(os.getpid(), signal.SIGINT)

    def told(line: str) -> None:
        if "finished first" in line:
            noticed.set()
            raise KeyboardInterrupt

    threading.Thread(target=interrupt, daemon=True).start()
    begun_s = time.monotonic()
    with workers, pytest.raises(KeyboardInterrupt):
        workers.run(units.sleep, numbered(1), kept.keep, 30.0, told)
    assert time.monotonic() - begun_s < 20.0
    assert kept.results == {}

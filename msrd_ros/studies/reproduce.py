"""``reproduce``: run the paper's studies again, from nothing to figures and tables.

``python -m msrd_ros reproduce inverted_pendulum [--seeds N] [--quick] [--out DIR] [--on ray]``,
``reproduce all``, ``reproduce ball --data DIR [--fit] [--out DIR]``.
"""

from __future__ import annotations

import argparse
import os
import signal
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from msrd_ros.cluster.places import LOCAL, WORKERS, Place
from msrd_ros.cluster.workers import UnitsError, Workers
from msrd_ros.core import formats
from msrd_ros.core.errors import UserError

Finished = tuple[dict[str, Any], Callable[[dict[str, Any]], Path]]
"""A study's numbers, and what writes its report from them."""

STUDIES = ("inverted_pendulum", "hopper", "table_tennis", "flair", "rewards")
ON_RECORDINGS = "ball"
"""The study of recordings that its user has: no part of ``all``."""


def main(argv: list[str] | None = None) -> int:
    """Run the command; 0 if every study finished, 1 if runs failed, 2 for an error of the user's."""
    # Whoever is told to end lets the runs that are under way finish and be kept, as after Ctrl-C.
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        return run(sys.argv[1:] if argv is None else argv)
    except UserError as error:
        print(f"reproduce: {error}", file=sys.stderr)
        return 2
    except UnitsError as error:
        print(
            f"reproduce: {error}\nreproduce: all other runs are kept; the same command tries these again",
            file=sys.stderr,
        )
        return 1
    except KeyboardInterrupt:
        print("reproduce: interrupted; the same command goes on from here", file=sys.stderr)
        return 130
    finally:
        signal.signal(signal.SIGTERM, before)


def run(argv: list[str]) -> int:
    """`main`, with errors raised."""
    options = _parse(argv)
    names = STUDIES if options.study == "all" else (options.study,)
    for name in names:
        if name not in (*STUDIES, ON_RECORDINGS):
            known = ", ".join((*STUDIES, ON_RECORDINGS, "all"))
            raise UserError(f"unknown study {name!r}; use one of {known}")
    if options.data is not None and not {"flair", ON_RECORDINGS} & set(names):
        raise UserError(f"--data {options.data}: only flair and ball take data; leave it out")
    if options.fit and ON_RECORDINGS not in names:
        raise UserError("--fit: only ball fits a law to recordings; leave it out")
    given = [f"--{name}" for name in ("quick", "seeds", "on", "workers") if getattr(options, name)]
    if ON_RECORDINGS in names and given:
        raise UserError(f"ball takes a minute and draws nothing; leave out {', '.join(given)}")
    folders = {}
    for name in names:
        folders[name] = Path(options.out or "out")
        if len(names) > 1 or options.out is None:
            folders[name] /= name
        _check_writable(folders[name])
    with _open_workers(options) as workers:
        _reproduce_all(folders, workers, options)
    return 0


def _open_workers(options: argparse.Namespace) -> Workers:
    place = Place.parse(options.on or LOCAL, "--on")
    if place.address is not None and options.workers is not None:
        raise UserError(
            f"--workers {options.workers}: the Ray at {place.address} has as many as it has; leave it out"
        )
    in_this_process = options.quick and options.workers is None and not place.uses_ray
    return place.open(0 if in_this_process else options.workers or WORKERS)


def _reproduce_all(folders: dict[str, Path], workers: Workers, options: argparse.Namespace) -> None:
    """One study after the other; one of which runs have failed does not take the later ones along."""
    failed = []
    for name, folder in folders.items():
        try:
            _reproduce(name, folder, workers, options)
        except UnitsError as error:
            failed.append(f"{name}: {error}")
    if failed:
        raise UnitsError("\n".join(failed))


class _Parser(argparse.ArgumentParser):
    """Says what is wrong in one line, as all of the package does."""

    def error(self, message: str) -> None:  # type: ignore[override]
        raise UserError(f"{message}; see `reproduce --help`")


def _parse(argv: list[str]) -> argparse.Namespace:
    parser = _Parser(prog="reproduce", description="Run the paper's studies again.")
    parser.add_argument("study", help=f"one of {', '.join((*STUDIES, ON_RECORDINGS, 'all'))}")
    parser.add_argument(
        "--seeds", type=int, default=None, help="repetitions of the main table; default: the study's"
    )
    parser.add_argument("--quick", action="store_true", help="a small version, in about a minute")
    parser.add_argument(
        "--out",
        default=None,
        help="where report.html and metrics.json go; default: out/ and the study's name",
    )
    parser.add_argument(
        "--data",
        type=Path,
        default=None,
        help="flair: demonstrations as npz, default: FLAIR's, which ship; ball: a folder of recordings",
    )
    parser.add_argument(
        "--on",
        default=None,
        help="where runs are made: local (processes; the default), ray or ray://HOST:PORT",
    )
    parser.add_argument(
        "--workers",
        type=int,
        default=None,
        help=f"processes, or processors of a Ray of our own; default: {WORKERS}, with --quick this one alone",
    )
    parser.add_argument("--fit", action="store_true", help="ball: fit its law, judge players held apart")
    options = parser.parse_args(argv)
    if options.seeds is not None and not 1 <= options.seeds <= 100:
        raise UserError(f"--seeds {options.seeds}: give a number from 1 to 100")
    if options.workers is not None and not 1 <= options.workers <= 1000:
        raise UserError(f"--workers {options.workers}: give a number from 1 to 1000")
    return options


def _check_writable(folder: Path) -> None:
    """Find out before the hours of computing, not after."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / ".writable"
        probe.write_text("")
        probe.unlink()
    except OSError as error:
        raise UserError(f"--out {folder}: cannot write there ({error.strerror}); choose another") from None


def _reproduce(name: str, folder: Path, workers: Workers, options: argparse.Namespace) -> None:
    """One study; imports what it needs only now, so that a missing extra is a clear error."""
    try:
        import torch

        studies: dict[str, Callable[[Path, int | None, bool], Finished]] = {
            "inverted_pendulum": partial(_inverted_pendulum, workers),
            "hopper": partial(_hopper, workers),
            "table_tennis": partial(_table_tennis, workers),
            "flair": partial(_flair, workers, options.data),
            "rewards": partial(_rewards, workers),
            ON_RECORDINGS: partial(_ball, options.data, options.fit),
        }
        torch.set_num_threads(1)  # small tensors: a second thread costs more than it brings
        started = time.monotonic()
        metrics, write_page = studies[name](folder, options.seeds, options.quick)
    except ModuleNotFoundError as error:
        missing = f"{name} needs {error.name}, which is not installed"
        raise UserError(f"{missing}; install it with `pip install 'msrd_ros[studies]'`") from None
    metrics["total_seconds"] = time.monotonic() - started
    report = write_page(metrics)
    formats.write_report(folder / "metrics.json", metrics)
    print(f"\n{report}\n{folder / 'metrics.json'}")


def _asked(seeds: int | None) -> dict[str, Any]:
    """What of a study's plan was asked for."""
    return {} if seeds is None else {"seeds": seeds}


def _inverted_pendulum(workers: Workers, folder: Path, seeds: int | None, quick: bool) -> Finished:
    from msrd_ros.studies.inverted_pendulum.report import write_report
    from msrd_ros.studies.inverted_pendulum.study import StudyPlan, run_study

    plan = replace(StudyPlan.quick() if quick else StudyPlan(), **_asked(seeds))
    metrics = run_study(plan, folder / "runs", workers, _ticker())
    return metrics, lambda found: write_report(found, plan, folder)


def _hopper(workers: Workers, folder: Path, seeds: int | None, quick: bool) -> Finished:
    from msrd_ros.studies.hopper.report import write_report
    from msrd_ros.studies.hopper.study import StudyPlan, run_study

    plan = replace(StudyPlan.quick() if quick else StudyPlan(), **_asked(seeds))
    metrics = run_study(plan, folder / "runs", workers, _ticker())
    return metrics, lambda found: write_report(found, plan, folder)


def _table_tennis(workers: Workers, folder: Path, seeds: int | None, quick: bool) -> Finished:
    from msrd_ros.studies.table_tennis.report import write_report
    from msrd_ros.studies.table_tennis.study import StudyPlan, run_study

    plan = replace(StudyPlan.quick() if quick else StudyPlan(), **_asked(seeds))
    return run_study(plan, folder, workers, _ticker()), lambda found: write_report(found, folder)


def _flair(workers: Workers, data: Path | None, folder: Path, seeds: int | None, quick: bool) -> Finished:
    from msrd_ros.studies.lunar_lander.report import write_report
    from msrd_ros.studies.lunar_lander.study import StudyPlan, run_study

    plan = replace(StudyPlan.quick() if quick else StudyPlan(), **_asked(seeds))
    metrics = run_study(plan, folder / "runs", workers, _ticker(), data)
    return metrics, lambda found: write_report(found, plan, folder)


def _rewards(workers: Workers, folder: Path, seeds: int | None, quick: bool) -> Finished:
    from msrd_ros.studies.rewards.report import write_report
    from msrd_ros.studies.rewards.study import StudyPlan, run_study

    plan = replace(StudyPlan.quick() if quick else StudyPlan(), **_asked(seeds))
    metrics = run_study(plan, folder / "runs", workers, _ticker())
    return metrics, lambda found: write_report(found, plan, folder)


def _ball(data: Path | None, fit: bool, folder: Path, seeds: int | None, quick: bool) -> Finished:
    from msrd_ros.studies.ball.report import write_report
    from msrd_ros.studies.ball.study import run_study

    return run_study(data, fit, _ticker()), lambda found: write_report(found, folder)


def _ticker() -> Callable[[str], None]:
    """One line that is overwritten on a terminal, and one line a step elsewhere."""
    started = time.monotonic()
    on_terminal = sys.stdout.isatty() and os.environ.get("TERM") != "dumb"

    def tick(text: str) -> None:
        line = f"[{time.monotonic() - started:6.0f} s] {text}"
        print(f"\r{line:<100}"[:101], end="", flush=True) if on_terminal else print(line, flush=True)

    return tick


if __name__ == "__main__":
    sys.exit(main())

"""What a campaign is made of: trials, what they found, and the record by which it goes on later."""

from __future__ import annotations

import json
import time
import zlib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

MOST_TOLD = 10
"""Broken promises that a finding keeps in words; it counts all."""


class NotTriedError(Exception):
    """Says why a fault cannot be made on this machine; the table then says so too."""


@dataclass(frozen=True)
class Setting:
    """Where and how thoroughly a trial runs.

    Attributes
    ----------
    folder
        Empty, for the trial's own files.
    share
        Of the whole campaign's counts: 1 for all, less for a small part of it.
    seed
        Of all randomness.
    """

    folder: Path
    share: float
    seed: int

    def count(self, whole: int, least: int = 1) -> int:
        """How many of `whole` things are tried here."""
        return max(round(whole * self.share), least)

    def rng(self, name: str) -> np.random.Generator:
        """Randomness of one trial: the same in every campaign of this seed, whatever else is run."""
        return np.random.default_rng([self.seed, zlib.crc32(name.encode())])


@dataclass
class Finding:
    """What became of a trial.

    Attributes
    ----------
    tried
        How many faults were made.
    broken
        How many promises were broken; `told` has the first of them in words.
    figures
        What was measured, for the table.
    """

    tried: int = 0
    broken: int = 0
    told: list[str] = field(default_factory=list)
    figures: dict[str, float | int | str] = field(default_factory=dict)

    def break_promise(self, what: str) -> None:
        """Note one broken promise."""
        self.broken += 1
        if len(self.told) < MOST_TOLD:
            self.told.append(what)

    def require(self, holds: bool, what: str) -> None:
        """Note a broken promise unless it holds."""
        if not holds:
            self.break_promise(what)


@dataclass(frozen=True)
class Trial:
    """One kind of fault.

    Attributes
    ----------
    name
        Tells it from the others.
    fault, promise
        What is done and what must hold, for the table.
    run
        Makes the faults; may raise `NotTriedError`.
    """

    name: str
    fault: str
    promise: str
    run: Callable[[Setting], Finding]


@dataclass(frozen=True)
class Entry:
    """A line of the campaign's record."""

    name: str
    share: float
    seed: int
    seconds: float
    finding: Finding | None
    not_tried: str = ""


def read_record(path: Path, share: float, seed: int) -> dict[str, Entry]:
    """Entries of an earlier run with the same share and seed, by name; a torn last line is passed over."""
    entries: dict[str, Entry] = {}
    lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
    for line in lines:
        try:
            values = json.loads(line)
        except json.JSONDecodeError:
            continue
        finding = Finding(**values.pop("finding")) if values.get("finding") else values.pop("finding", None)
        entry = Entry(finding=finding, **values)
        if (entry.share, entry.seed) == (share, seed):
            entries[entry.name] = entry
    return entries


def run_trials(
    trials: Sequence[Trial], out: Path, share: float, seed: int, tell: Callable[[str], None] = print
) -> list[Entry]:
    """Run those trials that the record in `out` does not hold yet; all entries, in the trials' order."""
    out.mkdir(parents=True, exist_ok=True)
    record = out / "campaign.jsonl"
    entries = read_record(record, share, seed)
    for trial in trials:
        if trial.name in entries:
            tell(f"{trial.name}: done before")
            continue
        tell(f"{trial.name}: {trial.fault}")
        entries[trial.name] = entry = _run(trial, out / trial.name, share, seed)
        with record.open("a", encoding="utf-8") as file:
            file.write(json.dumps(asdict(entry)) + "\n")
        tell(f"  {_verdict(entry)}, {entry.seconds:.0f} s")
        for line in entry.finding.told if entry.finding else ():
            tell(f"    {line}")
    return [entries[trial.name] for trial in trials]


def _run(trial: Trial, folder: Path, share: float, seed: int) -> Entry:
    folder.mkdir(parents=True, exist_ok=True)
    begin_s = time.monotonic()
    try:
        finding: Finding | None = trial.run(Setting(folder, share, seed))
        reason = ""
    except NotTriedError as error:
        finding, reason = None, str(error)
    return Entry(trial.name, share, seed, round(time.monotonic() - begin_s, 1), finding, reason)


def _verdict(entry: Entry) -> str:
    if entry.finding is None:
        return f"not tried here: {entry.not_tried}"
    figures = "".join(f", {key} {value}" for key, value in entry.finding.figures.items())
    held = "held" if not entry.finding.broken else f"BROKEN {entry.finding.broken} times"
    return f"{held}, {entry.finding.tried} tried{figures}"


def write_table(trials: Iterable[Trial], entries: Iterable[Entry], path: Path) -> None:
    """The campaign as a Markdown table, with what was broken below it."""
    lines = ["| fault | what must hold | result | s |", "|---|---|---|---|"]
    told: list[str] = []
    for trial, entry in zip(trials, entries, strict=True):
        lines.append(f"| {trial.fault} | {trial.promise} | {_verdict(entry)} | {entry.seconds:.0f} |")
        told += [f"* {trial.name}: {line}" for line in (entry.finding.told if entry.finding else ())]
    path.write_text("\n".join([*lines, "", *told, ""]), encoding="utf-8")

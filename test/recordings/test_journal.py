"""Whoever is killed while editing, and whoever edits beside: no bag is lost, no line is torn."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import pytest

from edited_bags import LABEL
from libraries import contents, copy_of
from msrd_ros.bags.finding import find_bags
from msrd_ros.bags.reader import Bag
from msrd_ros.core.errors import UserError
from msrd_ros.core.files import exchange
from msrd_ros.recordings import journal
from msrd_ros.recordings.curation import Curation
from msrd_ros.recordings.table import StrokeTable

BAG = f"subject_01/{LABEL}_001"
KILLED = 9

Verb = Callable[[Curation], Any]


def relabel(curation: Curation) -> None:
    curation.relabel(curation.folder / BAG, "my-smash")


def trim(curation: Curation) -> None:
    curation.trim(curation.folder / BAG, 0.1, 2.2)


def discard(curation: Curation) -> None:
    curation.discard(curation.folder / BAG)


def restore(curation: Curation) -> None:
    curation.restore(curation.folder / BAG)


def run_and_kill(folder: Path, verb: Verb, step: int) -> bool:
    """Run an edit in a process that dies at a step; whether it came so far.

    Steps are all calls that put something on the disk; each counts twice, before and after.
    """
    process = os.fork()
    if process:
        status = os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
        assert status in (0, KILLED), "the edit itself failed"
        return status == KILLED
    left = step

    def deadly(call: Callable[..., Any]) -> Callable[..., Any]:
        def step_by_step(*arguments: Any, **options: Any) -> Any:
            nonlocal left
            if left == 0:
                os._exit(KILLED)
            result = call(*arguments, **options)
            if left == 1:
                os._exit(KILLED)
            left -= 2
            return result

        return step_by_step

    try:
        os.rename, os.fsync = deadly(os.rename), deadly(os.fsync)
        setattr(journal, "exchange", deadly(exchange))  # noqa: B010
        verb(Curation(folder))
        os._exit(0)
    finally:
        os._exit(1)


def readable(folder: Path) -> list[tuple[Path, int]]:
    """The bags of the library, each read to its end, with the number of its messages."""
    return [(path, len(Bag(path).raw())) for path in find_bags(folder)]


@pytest.mark.parametrize(
    ("before", "verb"),
    [
        ((), relabel),
        ((), trim),
        ((), discard),
        ((relabel,), restore),
        ((trim,), restore),
        ((discard,), restore),
    ],
)
def test_a_kill_at_any_step_leaves_the_old_bag_or_the_new_one(
    tmp_path: Path, before: tuple[Verb, ...], verb: Verb
) -> None:
    template = copy_of("subject_01", f"{LABEL}_001", target=tmp_path / "template")
    for earlier in before:
        earlier(Curation(template))

    def prepared(name: str) -> Path:
        return Path(shutil.copytree(template, tmp_path / name))

    whole = prepared("whole")
    old = contents(whole)
    sizes = {size for _, size in readable(whole)}
    verb(Curation(whole))
    new = set(contents(whole))
    sizes |= {size for _, size in readable(whole)}
    ends = set()
    step = 0
    while run_and_kill(folder := prepared(f"killed_{step}"), verb, step):
        now = readable(folder)
        gone = verb is discard or before == (discard,)
        assert (gone and not now) or {size for _, size in now} <= sizes, "every bag there is whole"
        assert now or gone, "there is always one"
        curation = Curation(folder)
        curation.mend()
        after = contents(folder)
        assert after == old or set(after) == new
        ends.add(after == old)
        assert all(edit.state in ("done", "undone") for edit in curation.edits())
        assert curation.mend() == [], "mended once and for all"
        if after == old:
            verb(curation)
        assert set(contents(folder)) == new
        step += 1
    assert step > 8
    assert ends == {True, False}


def test_the_next_look_at_a_folder_mends_it_and_says_so(tmp_path: Path) -> None:
    notes = set()
    step = 0
    while run_and_kill(
        folder := copy_of("subject_01", f"{LABEL}_001", target=tmp_path / f"{step}"), discard, step
    ):
        table = StrokeTable(folder)
        rows = table.rows(discarded=True)
        assert len(rows) == 1, "a bag is always there: in its place, or aside"
        notes |= {note.partition(" was ")[2] for note in table.notes}
        step += 1
    assert notes == {
        "cut off and had moved nothing; repeat it if it is still wanted",
        "cut off and is done now",
    }


def test_a_torn_line_is_passed_over_and_stays(tmp_path: Path) -> None:
    folder = copy_of("subject_01", f"{LABEL}_001", target=tmp_path)
    Curation(folder).flag(folder / BAG, "late")
    file = folder / ".discarded" / "journal.jsonl"
    with file.open("ab") as stream:
        stream.write(b'{"id": "edit-2", "verb": "disc')
    curation = Curation(folder)
    curation.flag(folder / BAG, "look again")
    assert curation.flags() == {BAG: ("late", "look again")}
    assert b'"disc\n{' in file.read_bytes()


def _flag_often(folder: Path, name: str) -> None:
    for number in range(20):
        Curation(folder).flag(folder / BAG, f"{name} {number}")


def test_two_who_edit_one_folder_wait_for_each_other(tmp_path: Path) -> None:
    folder = copy_of("subject_01", f"{LABEL}_001", target=tmp_path)
    context = get_context("fork")
    workers = [context.Process(target=_flag_often, args=(folder, name)) for name in ("a", "b", "c")]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join(120)
        assert worker.exitcode == 0
    lines = (folder / ".discarded" / "journal.jsonl").read_bytes().splitlines()
    entries = [json.loads(line) for line in lines]
    assert len(entries) == 2 * 60
    assert len({entry["id"] for entry in entries}) == 60
    assert len(Curation(folder).flags()[BAG]) == 60, "none has written over another's"


def test_a_folder_that_cannot_be_written_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = copy_of("subject_01", f"{LABEL}_001", target=tmp_path)
    before = contents(folder)

    def full(*_: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    for verb in (relabel, trim, discard):
        with pytest.raises(UserError, match="No space left on device"):
            verb(Curation(folder))
    monkeypatch.undo()
    Curation(folder).mend()
    assert contents(folder) == before


def test_a_file_system_that_cannot_exchange_names_leaves_the_old_bag(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = copy_of("subject_01", f"{LABEL}_001", target=tmp_path)
    before = contents(folder)

    def cannot(*_: Any) -> None:
        raise OSError(22, "Invalid argument")

    monkeypatch.setattr(journal, "exchange", cannot)
    with pytest.raises(UserError, match="a file system that can exchange two names"):
        trim(Curation(folder))
    assert contents(folder) == before
    curation = Curation(folder)
    assert "had moved nothing" in curation.mend()[0]
    assert contents(folder) == before

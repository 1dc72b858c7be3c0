"""The console: lines with the name of who said them, progress bars, and last words."""

from __future__ import annotations

import io
import os

import pytest

from msrd_ros.stack.console import Console


class Terminal(io.StringIO):
    """A stream that says it is a terminal."""

    def isatty(self) -> bool:
        return True

    def fileno(self) -> int:
        raise OSError("has no number")


def printed(*writes: str, terminal: bool = False) -> str:
    """What is shown of what a process writes."""
    stream = Terminal() if terminal else io.StringIO()
    console = Console(stream)
    for_reading, for_writing = os.pipe()
    thread = console.follow("node", os.fdopen(for_reading, "rb"))
    for text in writes:
        os.write(for_writing, text.encode())
    os.close(for_writing)
    thread.join(10.0)
    assert not thread.is_alive()
    return stream.getvalue()


def test_each_line_has_the_name_of_who_said_it() -> None:
    assert printed("one\ntw", "o\r\n\nthree") == "[node] one\n[node] two\n[node] \n[node] three\n"


def test_of_a_bar_the_first_and_the_last_are_printed_where_nobody_can_redraw_it() -> None:
    bars = [f"\rrecord: {percent}%" for percent in range(0, 101, 5)]
    assert printed(*bars, "\n", "done\n") == "[node] record: 0%\n[node] record: 100%\n[node] done\n" or (
        # Writes may arrive together; then the first that is seen is a later one.
        printed("".join(bars), "\n", "done\n").endswith("[node] record: 100%\n[node] done\n")
    )


def test_on_a_terminal_a_bar_is_drawn_over_the_one_before() -> None:
    shown = printed("\rrecord: 0%", "\rrecord: 50%\n", "done\n", terminal=True)
    assert shown.endswith("\r\x1b[K[node] record: 50%\n[node] done\n")


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ([], "it had printed nothing"),
        (["[INFO] ready"], "its last line: [INFO] ready"),
        (["executor: error: no such file", "bye"], "its last error line: executor: error: no such file"),
        (["[ERROR] joint 3", "[INFO] more"], "its last error line: [ERROR] joint 3"),
        (["Traceback (most recent call last):", "ValueError: no"], "its last error line: ValueError: no"),
        (["the error is 0.1 m", "bye"], "its last line: bye"),
    ],
)
def test_the_last_error_counts_else_the_last_line(lines: list[str], words: str) -> None:
    console = Console(io.StringIO())
    for line in lines:
        console.say("executor", line)
    console.say("other", "[ERROR] not mine")
    assert console.last_words("executor") == words


def test_a_process_that_is_started_again_has_said_nothing_yet() -> None:
    console = Console(io.StringIO())
    console.say("executor", "[ERROR] before")
    console.forget("executor")
    assert console.last_words("executor") == "it had printed nothing"

"""What several processes print, line by line on one terminal, each line with the name of who said it."""

from __future__ import annotations

import os
import re
import threading
import time
from typing import IO, TextIO

PROGRESS_PERIOD_S = 10.0
"""Where nobody can redraw a line, a progress bar is printed this often."""

_ERROR = re.compile(r"\[(ERROR|FATAL)\]|\berror: |\w(Error|Exception)\b: ")
_READ_BYTES = 65536


class Console:
    """Prints lines of several processes, and remembers the last of each.

    Parameters
    ----------
    stream
        Where to print.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._is_terminal = stream.isatty()
        self._lock = threading.Lock()
        self._drawn = False
        self._progress: dict[str, str] = {}
        self._printed_s: dict[str, float] = {}
        self._lines: dict[str, str] = {}
        self._errors: dict[str, str] = {}

    @property
    def columns(self) -> int | None:
        """Width of the terminal; None if it is none."""
        try:
            return os.get_terminal_size(self._stream.fileno()).columns if self._is_terminal else None
        except OSError:
            return None

    def say(self, name: str, line: str) -> None:
        """Print a line."""
        with self._lock:
            self._lines[name] = line
            if _ERROR.search(line):
                self._errors[name] = line
            self._write(f"{self._clear()}[{name}] {line}\n")

    def last_words(self, name: str) -> str:
        """The last error that a process has printed, else its last line, in words."""
        with self._lock:
            if name in self._errors:
                return f"its last error line: {self._errors[name]}"
            return f"its last line: {self._lines[name]}" if name in self._lines else "it had printed nothing"

    def forget(self, name: str) -> None:
        """Forget the last words: who comes now is another process of that name."""
        with self._lock:
            self._lines.pop(name, None)
            self._errors.pop(name, None)

    def follow(self, name: str, pipe: IO[bytes]) -> threading.Thread:
        """Print what comes out of a pipe until it is closed, on a thread of its own."""
        thread = threading.Thread(target=self._read, args=(name, pipe), name=f"lines of {name}", daemon=True)
        thread.start()
        return thread

    def _read(self, name: str, pipe: IO[bytes]) -> None:
        rest = ""
        with pipe:
            while chunk := os.read(pipe.fileno(), _READ_BYTES):
                rest = self._take(name, rest + chunk.decode(errors="replace").replace("\r\n", "\n"))
        if rest:
            self.say(name, rest)

    def _take(self, name: str, text: str) -> str:
        """Print whole lines and progress bars; what is left begins a line."""
        *lines, rest = text.split("\n")
        for line in lines:
            bar, _, said = line.rpartition("\r")
            if bar.strip():
                self._show(name, bar.rpartition("\r")[2])
            if said.strip():
                self.say(name, said.rstrip())
            elif name in self._progress:
                # The end of a bar is worth a line.
                self.say(name, self._progress[name])
            elif not line:
                self.say(name, "")
            self._progress.pop(name, None)
        if "\r" not in rest:
            return rest
        self._show(name, rest.rstrip("\r").rpartition("\r")[2])
        return ""

    def _show(self, name: str, bar: str) -> None:
        """Draw a progress bar over the one before, or print it now and then."""
        if not bar.strip():
            return
        with self._lock:
            self._progress[name] = bar.strip()
            now_s = time.monotonic()
            if self._is_terminal:
                self._write(f"{self._clear()}[{name}] {bar.strip()}")
                self._drawn = True
            elif now_s - self._printed_s.get(name, -PROGRESS_PERIOD_S) >= PROGRESS_PERIOD_S:
                self._printed_s[name] = now_s
                self._write(f"[{name}] {bar.strip()}\n")

    def _clear(self) -> str:
        drawn, self._drawn = self._drawn, False
        return "\r\x1b[K" if drawn else ""

    def _write(self, text: str) -> None:
        try:
            self._stream.write(text)
            self._stream.flush()
        except (OSError, ValueError):
            # Nobody reads any more; the processes must not wait for it.
            self._stream = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115 - stays open
